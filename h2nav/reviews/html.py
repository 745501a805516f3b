"""The frame of the review's pages: HTML that asks nobody for anything, and text that stays text.

What comes from a file (names, texts of an autopilot, parameters) may be anything. `escape` makes it
text, and a page says by its Content-Security-Policy that no script may run but those whose
fingerprints it names, and that nothing may be loaded from anywhere.
"""

import base64
import hashlib
import html
import json
from collections.abc import Iterable, Sequence
from importlib import resources


def escape(text: object) -> str:
    """The text for HTML, in elements and in attributes; what does not print is a replacement sign.

    Marks that turn the direction of writing do not print, so no text can disguise another one.
    """
    shown = "".join(sign if sign.isprintable() else "\ufffd" for sign in str(text))
    return html.escape(shown, quote=True)


def table(heads: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """A table; every cell is text."""
    head = "".join(f'<th scope="col">{escape(cell)}</th>' for cell in heads)
    body = "".join(
        "<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in row) + "</tr>" for row in rows
    )
    # A wide table is moved inside its own box, and not the page with it.
    whole = f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"
    return f'<div class="wide">{whole}</div>'


def asset(name: str) -> str:
    """A file of `h2nav/reviews/assets`."""
    return resources.files("h2nav.reviews").joinpath("assets", name).read_text(encoding="utf-8")


def data_block(name: str, value: object) -> str:
    """A JSON document for the scripts of the page; nothing in it can end the block.

    Args:
        name: id of the element.
        value: what `json` can write, without NaN.
    """
    text = json.dumps(value, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")
    return f'<script type="application/json" id="{escape(name)}">{text}</script>'


def frame(
    title: str,
    body: str,
    *,
    styles: Sequence[str] = (),
    scripts: Sequence[str] = (),
    data: str = "",
) -> str:
    """A whole page.

    Args:
        title: plain text.
        body: HTML; everything in it that came from a file has gone through `escape`.
        styles: CSS beside that of every page (`assets/page.css`).
        scripts: JavaScript, which runs at the end of the page, in this order.
        data: blocks for the scripts, of `data_block`.

    Returns:
        The HTML file.
    """
    allowed = " ".join(f"'sha256-{_fingerprint(script)}'" for script in scripts) or "'none'"
    policy = (
        f"default-src 'none'; script-src {allowed}; style-src 'unsafe-inline'; img-src data:; "
        f"base-uri 'none'; form-action 'none'"
    )
    style = "\n".join((asset("page.css"), *styles))
    run = "".join(f"<script>{script}</script>\n" for script in scripts)
    return f"""<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta http-equiv="Content-Security-Policy" content="{policy}">
<meta name="viewport" content="width=device-width, initial-scale=1">
<link rel="icon" href="data:,">
<title>{escape(title)}</title>
<style>
{style}
</style>
</head>
<body>
{body}
{data}
{run}</body>
</html>
"""


def _fingerprint(script: str) -> str:
    return base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
