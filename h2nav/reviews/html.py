"""The frame of the review's pages: self-contained HTML in which foreign text stays text.

Strings from a file (names, texts of an autopilot, parameters) may be anything. `escape` makes them
text, and the page's Content-Security-Policy allows only scripts with the named fingerprints and
loads nothing from elsewhere.
"""

import base64
import hashlib
import html
import json
from collections.abc import Iterable, Sequence
from importlib import resources


def escape(text: object) -> str:
    """Escapes text for HTML elements and attributes; replaces unprintable characters.

    Characters that change the direction of writing count as unprintable, so that no text can
    disguise another.
    """
    shown = "".join(sign if sign.isprintable() else "\ufffd" for sign in str(text))
    return html.escape(shown, quote=True)


def table(heads: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """A table; every cell is text."""
    head = "".join(f'<th scope="col">{escape(cell)}</th>' for cell in heads)
    body = "".join(
        "<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in row) + "</tr>" for row in rows
    )
    # A wide table scrolls inside its own box, not with the page.
    whole = f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"
    return f'<div class="wide">{whole}</div>'


def asset(name: str) -> str:
    """A file of `h2nav/reviews/assets`."""
    return resources.files("h2nav.reviews").joinpath("assets", name).read_text(encoding="utf-8")


def data_block(name: str, value: object) -> str:
    """A JSON document for the page's scripts; its content cannot end the block.

    Args:
        value: anything that `json` can write, without NaN.
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
        body: HTML; every string from a file has gone through `escape`.
        styles: CSS besides that of every page (`assets/page.css`).
        scripts: JavaScript, run at the end of the page, in order.
        data: blocks for the scripts, from `data_block`.

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
