"""A headless Chromium, driven through chromedriver's HTTP interface (W3C WebDriver)."""

import base64
import json
import shutil
import subprocess
import tempfile
import time
import urllib.error
import urllib.request
from collections.abc import Mapping
from pathlib import Path
from types import TracebackType
from typing import Any, Self

FLAGS = (
    *("--headless=new", "--no-sandbox", "--disable-quic", "--no-first-run"),
    *("--disable-background-networking", "--disable-component-update", "--disable-sync"),
    "--hide-scrollbars",
    *("--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"),
)
"""WebGL is rendered in software."""

WITHOUT_WEBGL = ("--disable-3d-apis",)
START_S, ANSWER_S = 30.0, 120.0


def missing_program() -> str | None:
    """What keeps a browser from being driven here, as a sentence; None if nothing does."""
    if shutil.which("chromedriver") is None or _chromium() is None:
        return "no browser: install chromium and chromedriver (Debian: chromium chromium-driver)."
    return None


def _chromium() -> str | None:
    return shutil.which("chromium") or shutil.which("chromium-browser")


class Browser:
    """One window of a headless browser with an empty profile.

    Parameters
    ----------
    width_px, height_px : int
        Inner size of the window.
    is_dark : bool
        Whether pages shall prefer dark colours.
    flags : sequence of str
        Further flags of Chromium.
    """

    def __init__(
        self,
        width_px: int = 1400,
        height_px: int = 1000,
        *,
        is_dark: bool = False,
        flags: tuple[str, ...] = (),
    ) -> None:
        self._profile = tempfile.TemporaryDirectory()
        self._driver = subprocess.Popen(
            ["chromedriver", "--port=0"],
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
        )
        try:
            self._address = f"http://127.0.0.1:{self._announced_port()}/session"
            arguments = [*FLAGS, *flags, f"--user-data-dir={self._profile.name}"]
            options = {"binary": _chromium(), "args": arguments}
            wanted = {"goog:chromeOptions": options, "goog:loggingPrefs": {"browser": "ALL"}}
            session = self._call("POST", "", {"capabilities": {"alwaysMatch": wanted}})
            self._address += f"/{session['sessionId']}"
        except BaseException:
            self._stop()
            raise
        self.resize(width_px, height_px)
        scheme = {"name": "prefers-color-scheme", "value": "dark" if is_dark else "light"}
        self.devtools("Emulation.setEmulatedMedia", {"features": [scheme]})

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        try:
            self._call("DELETE", "")
        finally:
            self._stop()

    def open(self, url: str) -> None:
        """Load a page, and wait until it says that it is ready or has failed."""
        self._call("POST", "/url", {"url": url})
        self.wait_for(
            "return document.documentElement.dataset.ready === 'true' ||"
            " document.getElementById('message').textContent.startsWith('The page cannot')"
        )

    def enter_frame(self, nth: int | None) -> None:
        """Let scripts run in the nth iframe of the page from now on; None: in the page."""
        self._call("POST", "/frame", {"id": nth})

    def run(self, script: str, *arguments: Any) -> Any:
        """The value that a script returns; it may be a promise."""
        return self._call("POST", "/execute/sync", {"script": script, "args": list(arguments)})

    def wait_for(self, script: str, seconds: float = START_S) -> None:
        """Wait until a script returns a true value.

        Raises
        ------
        TimeoutError
            It does not in time.
        """
        end = time.monotonic() + seconds
        while not self.run(script):
            if time.monotonic() > end:
                raise TimeoutError(f"not within {seconds:g} s: {script}")
            time.sleep(0.05)

    def log(self) -> list[dict[str, Any]]:
        """What the console said since the last call."""
        return list(self._call("POST", "/se/log", {"type": "browser"}))

    def devtools(self, command: str, parameters: Mapping[str, Any]) -> Any:
        """One command of the Chrome DevTools Protocol."""
        return self._call("POST", "/goog/cdp/execute", {"cmd": command, "params": parameters})

    def resize(self, width_px: int, height_px: int) -> None:
        """Change the inner size of the window."""
        metrics = {"width": width_px, "height": height_px, "deviceScaleFactor": 1, "mobile": False}
        self.devtools("Emulation.setDeviceMetricsOverride", metrics)

    def screenshot(self, path: Path, *, whole_page: bool = False) -> None:
        """Write a PNG of the window, or of the page in its whole height."""
        parameters: dict[str, Any] = {"format": "png"}
        if whole_page:
            width, height = self.run(
                "const { clientWidth, scrollHeight } = document.documentElement;"
                " return [clientWidth, scrollHeight]"
            )
            clip = {"x": 0, "y": 0, "width": width, "height": height, "scale": 1}
            parameters |= {"captureBeyondViewport": True, "clip": clip}
        shot = self.devtools("Page.captureScreenshot", parameters)
        path.write_bytes(base64.b64decode(shot["data"]))

    def mouse(self, kind: str, x: float, y: float, **more: Any) -> None:
        """A mouse event (``mousePressed``, ``mouseMoved``, ``mouseReleased``, ``mouseWheel``)."""
        self.devtools("Input.dispatchMouseEvent", {"type": kind, "x": x, "y": y, **more})

    def click(self, x: float, y: float) -> None:
        """Press and release the left button."""
        for kind in ("mousePressed", "mouseReleased"):
            self.mouse(kind, x, y, button="left", clickCount=1)

    def drag(self, start: tuple[float, float], end: tuple[float, float], steps: int = 8) -> None:
        """Press the left button, move, release."""
        self.mouse("mousePressed", *start, button="left", clickCount=1)
        for step in range(1, steps + 1):
            x, y = (a + (b - a) * step / steps for a, b in zip(start, end, strict=True))
            self.mouse("mouseMoved", x, y, button="left", buttons=1)
        self.mouse("mouseReleased", *end, button="left", clickCount=1)

    def key(self, key: str, code: str | None = None) -> None:
        """Press and release a key."""
        for kind in ("keyDown", "keyUp"):
            self.devtools("Input.dispatchKeyEvent", {"type": kind, "key": key, "code": code or key})

    def _announced_port(self) -> int:
        assert self._driver.stdout is not None
        for line in self._driver.stdout:
            words = line.strip().rstrip(".").split()
            if "successfully" in words and words[-1].isdigit():
                return int(words[-1])
        raise RuntimeError("chromedriver did not start.")

    def _call(self, method: str, path: str, content: Mapping[str, Any] | None = None) -> Any:
        request = urllib.request.Request(
            self._address + path,
            method=method,
            data=None if content is None else json.dumps(content).encode(),
            headers={"Content-Type": "application/json"},
        )
        try:
            with urllib.request.urlopen(request, timeout=ANSWER_S) as response:
                return json.load(response)["value"]
        except urllib.error.HTTPError as error:
            said = json.load(error)["value"]
            raise RuntimeError(f"{said['error']}: {said['message']}") from None

    def _stop(self) -> None:
        self._driver.terminate()
        self._driver.wait()
        if self._driver.stdout is not None:
            self._driver.stdout.close()
        self._profile.cleanup()
