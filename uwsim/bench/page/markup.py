"""HTML from values. Every text is escaped here; nothing refers to a file outside the page."""

import base64
import html
from collections.abc import Iterable
from pathlib import Path

import numpy as np

FOLDER = Path(__file__).parent
LONGEST_SIDE_PX = 1280


def escape(value: object) -> str:
    return html.escape(str(value), quote=True)


def asset(name: str) -> str:
    """Return a file of this folder that goes into the page, such as the script."""
    return (FOLDER / name).read_text(encoding="utf-8")


def data_uri(image: np.ndarray, *, lossless: bool = False) -> str:
    """Return an (H, W, 3) uint8 image as a data URI: JPEG, or PNG for maps whose values matter."""
    import cv2

    height, width = image.shape[:2]
    factor = LONGEST_SIDE_PX / max(height, width)
    if factor < 1:
        how = cv2.INTER_NEAREST if lossless else cv2.INTER_AREA
        image = cv2.resize(image, (round(width * factor), round(height * factor)), interpolation=how)
    suffix, options = (".png", []) if lossless else (".jpg", [cv2.IMWRITE_JPEG_QUALITY, 92])
    _, encoded = cv2.imencode(suffix, np.ascontiguousarray(image[..., ::-1]), options)
    kind = "png" if lossless else "jpeg"
    return f"data:image/{kind};base64,{base64.b64encode(encoded.tobytes()).decode('ascii')}"


def picture(image: np.ndarray, alt: str, *, lossless: bool = False, attributes: str = "") -> str:
    height, width = image.shape[:2]
    extra = f" {attributes}" if attributes else ""
    source = data_uri(image, lossless=lossless)
    return f'<img src="{source}" width="{width}" height="{height}" alt="{escape(alt)}"{extra}>'


def figure(content: str, title: str, caption: str = "", *, kind: str = "") -> str:
    """Return a figure; `caption` may hold markup, `title` not."""
    words = " ".join(part for part in (f"<b>{escape(title)}</b>" if title else "", caption) if part)
    below = f"<figcaption>{words}</figcaption>" if words else ""
    return f'<figure class="{escape(kind)}">{content}{below}</figure>'


def grid(figures: Iterable[str], kind: str = "small") -> str:
    return f'<div class="grid {escape(kind)}">{"".join(figures)}</div>'


def section(identity: str, title: str, *content: str) -> str:
    body = "\n".join(part for part in content if part)
    return f'<section id="{escape(identity)}"><h2>{escape(title)}</h2>\n{body}\n</section>'


def paragraph(text: str, kind: str = "") -> str:
    """Return a paragraph of plain text."""
    attribute = f' class="{escape(kind)}"' if kind else ""
    return f"<p{attribute}>{escape(text)}</p>"


def cell(shown: str, *, value: float | None = None, kind: str = "", numeric: bool = False) -> str:
    """Return a table cell; `value` is what a numeric column is sorted by (none: last)."""
    kinds = " ".join(word for word in (kind, "number" if numeric else "") if word)
    attributes = f' class="{kinds}"' if kinds else ""
    if numeric:
        number = "" if value is None else repr(float(value)).replace("inf", "Infinity")
        attributes += f' data-value="{number}"'
    return f"<td{attributes}>{shown}</td>"


def sortable_table(heads: list[tuple[str, bool]], rows: list[list[str]], label: str, *, kind: str = "") -> str:
    """Return a table whose heads (text, numeric) are buttons; `rows` hold cells made by `cell`."""
    head = "".join(_head(text, numeric) for text, numeric in heads)
    body = "".join(f"<tr>{''.join(cells)}</tr>" for cells in rows)
    return (
        f'<div class="scroll" role="region" tabindex="0" aria-label="{escape(label)}">'
        f'<table class="{escape(f"sortable {kind}".rstrip())}"><caption>{escape(label)}</caption>'
        f"<thead><tr>{head}</tr></thead><tbody>{body}</tbody></table></div>"
    )


def _head(text: str, numeric: bool) -> str:
    mark = '<span class="mark" aria-hidden="true"></span>'
    shown = escape(text).replace(" ↑", "\u00a0↑").replace(" ↓", "\u00a0↓")
    inside = mark + shown if numeric else shown + mark
    attribute = ' class="number"' if numeric else ""
    return f'<th scope="col"{attribute}><button type="button">{inside}</button></th>'


def pairs_table(pairs: list[tuple[str, str]], label: str) -> str:
    """Return a two-column table of names and values."""
    rows = "".join(_pair(key, value) for key, value in pairs)
    caption = f"<caption>{escape(label)}</caption>"
    return f'<div class="scroll"><table class="pairs">{caption}<tbody>{rows}</tbody></table></div>'


def _pair(key: str, value: str) -> str:
    return f'<tr><th scope="row">{escape(key)}</th><td>{escape(value)}</td></tr>'


def flatten(values: dict, prefix: str = "") -> list[tuple[str, str]]:
    """Return nested settings as (dotted key, text) pairs, in order."""
    pairs = []
    for key, value in values.items():
        name = f"{prefix}{key}"
        if isinstance(value, dict):
            pairs += flatten(value, f"{name}.")
        elif isinstance(value, list | tuple):
            pairs.append((name, ", ".join(str(item) for item in value)))
        else:
            pairs.append((name, "-" if value is None else str(value)))
    return pairs
