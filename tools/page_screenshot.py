"""A picture of a page of ``intervis view``, as a browser shows it.

``python tools/page_screenshot.py page.html page.png --width 1400 --frame 10 --return 1234 --dark``
"""

import argparse
import sys
from pathlib import Path

from browser import Browser, missing_program

LAYERS = "return [...document.querySelectorAll('.chip.layer')].map((one) => one.classList[2])"


def main() -> int:
    """Take one picture; returns the exit code."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("page", type=Path, help="written by 'intervis view --html'")
    parser.add_argument("picture", type=Path, help="PNG file")
    parser.add_argument("--width", type=int, default=1400, help="pixels")
    parser.add_argument("--height", type=int, default=900, help="of the window, pixels")
    parser.add_argument("--dark", action="store_true")
    parser.add_argument("--frame", type=int, help="frame number")
    parser.add_argument("--return", dest="row", type=int, help="row of the return to select")
    parser.add_argument("--switch", action="append", default=[], help="layer to show or hide")
    asked = parser.parse_args()
    reason = missing_program()
    if reason is not None:
        print(reason, file=sys.stderr)
        return 2
    choice = {"frame": asked.frame, "return": asked.row}
    place = "&".join(f"{name}={value}" for name, value in choice.items() if value is not None)
    with Browser(asked.width, asked.height, is_dark=asked.dark) as browser:
        browser.open(f"{asked.page.resolve().as_uri()}#{place}")
        layers = browser.run(LAYERS)
        unknown = [layer for layer in asked.switch if layer not in layers]
        if unknown:
            print(f"there is no layer {unknown[0]!r}: {', '.join(layers)}.", file=sys.stderr)
            return 2
        for layer in asked.switch:
            browser.run("document.querySelector(arguments[0]).click()", f".chip.layer.{layer}")
        browser.screenshot(asked.picture, whole_page=True)
        for entry in browser.log():
            print(entry["level"], entry["message"], file=sys.stderr)
    reduce_colours(asked.picture)
    return 0


def reduce_colours(path: Path) -> None:
    """Save a picture with 256 colours, where Pillow is installed: a third of the bytes."""
    try:
        from PIL import Image
    except ImportError:
        return
    with Image.open(path) as picture:
        reduced = picture.convert("RGB").quantize(256, dither=Image.Dither.NONE)
    reduced.save(path, optimize=True)


if __name__ == "__main__":
    sys.exit(main())
