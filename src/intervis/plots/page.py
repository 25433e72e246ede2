"""A self-contained HTML page: embedded pictures, escaped texts, no external resources."""

import base64
import html
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from intervis.plots.tables import Table

_STYLE = """
:root { color-scheme: light; }
body { font: 16px/1.5 system-ui, sans-serif; color: #22262b; background: #fff;
       max-width: 1080px; margin: 2rem auto; padding: 0 1rem; }
h1 { font-size: 1.7rem; margin: 0 0 .2rem; overflow-wrap: anywhere; }
h2 { font-size: 1.2rem; margin: 2.4rem 0 .6rem; }
p.lead { margin: 0 0 1.4rem; color: #555c66; overflow-wrap: anywhere; }
figure { margin: 0 0 2rem; }
img { width: 100%; height: auto; display: block; }
figcaption, p.note { font-size: .88rem; color: #555c66; margin: .5rem 0 0; }
.wide { overflow-x: auto; }
table { border-collapse: collapse; font-size: .84rem; font-variant-numeric: tabular-nums;
        min-width: 40%; }
caption { text-align: left; font-weight: 600; padding: .3rem 0; }
th, td { text-align: right; padding: .25rem .5rem; border-bottom: 1px solid #e3e6ea;
         white-space: nowrap; }
th:first-child, td:first-child { text-align: left; }
th { border-bottom: 1px solid #8a9099; }
footer { margin-top: 3rem; font-size: .82rem; color: #555c66; overflow-wrap: anywhere; }
"""


@dataclass(frozen=True)
class Picture:
    """A PNG file with heading and caption."""

    path: Path
    heading: str
    caption: str


@dataclass(frozen=True)
class Remark:
    """A paragraph that starts with words in bold."""

    opening: str
    text: str


@dataclass(frozen=True)
class Page:
    """Content of a page in order: title, lead, parts (a str is a heading), small print."""

    title: str
    lead: str
    parts: Sequence[Picture | Table | Remark | str]
    small_print: Sequence[str] = ()

    def as_html(self) -> str:
        """The page as text; reads the picture files.

        Raises
        ------
        OSError
            A picture cannot be read.
        """
        body = "\n".join(map(_part, self.parts))
        small = "".join(f"<p>{html.escape(text)}</p>" for text in self.small_print)
        title = html.escape(self.title)
        return (
            "<!DOCTYPE html>\n<html lang='en'>\n<head>\n<meta charset='utf-8'>\n"
            "<meta name='viewport' content='width=device-width, initial-scale=1'>\n"
            f"<title>{title}</title>\n<style>{_STYLE}</style>\n</head>\n<body>\n"
            f"<h1>{title}</h1>\n<p class='lead'>{html.escape(self.lead)}</p>\n"
            f"{body}\n<footer>{small}</footer>\n</body>\n</html>\n"
        )


def _part(part: Picture | Table | Remark | str) -> str:
    if isinstance(part, Table):
        return part.as_html()
    if isinstance(part, Remark):
        return f"<p><strong>{html.escape(part.opening)}</strong> {html.escape(part.text)}</p>"
    if isinstance(part, str):
        return f"<h2>{html.escape(part)}</h2>"
    data = base64.b64encode(part.path.read_bytes()).decode("ascii")
    return (
        f"<figure><img alt='{html.escape(part.heading, quote=True)}'"
        f" src='data:image/png;base64,{data}'>"
        f"<figcaption><strong>{html.escape(part.heading)}.</strong>"
        f" {html.escape(part.caption)}</figcaption></figure>"
    )
