"""Results as small HTML tables, which notebooks show; texts are escaped, and there is no script."""

import html
from collections.abc import Mapping


def result_table(title: str, rows: Mapping[str, str]) -> str:
    """A table of two columns, names and values, with a title.

    Examples
    --------
    >>> print(result_table("Frame 1", {"file": "a<b>"}))
    <table><caption>Frame 1</caption><tr><th>file</th><td>a&lt;b&gt;</td></tr></table>
    """
    cells = (
        f"<tr><th>{html.escape(name)}</th><td>{html.escape(value)}</td></tr>"
        for name, value in rows.items()
    )
    return f"<table><caption>{html.escape(title)}</caption>{''.join(cells)}</table>"


def share(count: int, total: int) -> str:
    """A count with its share of a total.

    Examples
    --------
    >>> share(1500, 4000), share(0, 0)
    ('1,500 (37.5 %)', '0')
    """
    return f"{count:,} ({100 * count / total:.1f} %)" if total else f"{count:,}"


def percent(part: float) -> str:
    """A share from 0 to 1 as a whole percentage; 0 and 100 only where it is exactly that.

    Examples
    --------
    >>> [percent(part) for part in (0.0, 0.002, 0.374, 0.9999, 1.0, float("nan"))]
    ['0 %', '< 1 %', '37 %', '> 99 %', '100 %', '-']
    """
    if part != part:
        return "-"
    if 0.0 < part < 0.005:
        return "< 1 %"
    if 0.995 <= part < 1.0:
        return "> 99 %"
    return f"{100.0 * part:.0f} %"


def metres(length_m: float, unknown: str = "-") -> str:
    """A length with its unit, or a word where it is not finite.

    Examples
    --------
    >>> metres(9.24), metres(float("nan"))
    ('9.2 m', '-')
    """
    return f"{length_m:.1f} m" if abs(length_m) < float("inf") else unknown
