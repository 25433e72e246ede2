"""The page in a notebook with the engine behind it: a widget, made with anywidget."""

from importlib.resources import files
from typing import Any

from intervis.errors import IntervisError, MissingExtraError
from intervis.view.page_engine import PageEngine


def require_anywidget() -> None:
    """Raise before the work where no widget can be made.

    Raises
    ------
    MissingExtraError
        anywidget (extra ``notebook``) is not installed.
    """
    try:
        import anywidget  # noqa: F401
    except ImportError:
        raise MissingExtraError("anywidget", "notebook", "A page that answers") from None


def widget_script() -> str:
    """The ES module of the widget."""
    return files("intervis.view").joinpath("notebook_widget.js").read_text(encoding="utf-8")


def reply(engine: PageEngine, message: Any) -> dict[str, Any]:
    """What the widget sends back to the page: the answer, or why there is none.

    Parameters
    ----------
    engine : PageEngine
    message : dict
        ``id``, ``kind`` and ``question``, as the page sends them.
    """
    asked = message if isinstance(message, dict) else {}
    try:
        answer = engine.answer(str(asked.get("kind")), asked.get("question"))
    except IntervisError as error:
        return {"id": asked.get("id"), "error": str(error)}
    return {"id": asked.get("id"), "answer": answer}


def live_page(content: bytes, height_px: int, engine: PageEngine) -> Any:
    """A widget that shows a page and answers its questions.

    Parameters
    ----------
    content : bytes
        The page, UTF-8.
    height_px : int
        Height on the notebook's page.
    engine : PageEngine

    Raises
    ------
    MissingExtraError
        anywidget (extra ``notebook``) is not installed.
    """
    require_anywidget()
    import anywidget
    import traitlets

    class LivePage(anywidget.AnyWidget):  # type: ignore[misc,unused-ignore]
        """The page, and its height."""

        _esm = widget_script()
        page = traitlets.Unicode().tag(sync=True)
        height_px = traitlets.Int().tag(sync=True)

    widget = LivePage(page=content.decode("utf-8"), height_px=height_px)
    widget.on_msg(lambda _, message, __: widget.send(reply(engine, message)))
    return widget
