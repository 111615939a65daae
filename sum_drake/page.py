"""The parts of a page of HTML that opens without a network: reports of runs and of benches are made of them."""

import base64
import html
from collections.abc import Iterable, Sequence

import cv2
import numpy as np
from numpy.typing import NDArray


def page(title: str, parts: Sequence[str]) -> str:
    """A whole page; parts are HTML."""
    return (
        '<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{text(title)}</title><style>{_STYLE}</style></head>\n<body><main>\n"
        + "\n".join(parts)
        + "\n</main></body></html>\n"
    )


def text(value: str) -> str:
    """Plain text as HTML."""
    return html.escape(value)


def tiles(figures: Sequence[tuple[str, str]]) -> str:
    """Names and values, plain text, as large figures side by side."""
    shown = "".join(f"<div><b>{text(value)}</b><span>{text(name)}</span></div>" for name, value in figures)
    return f'<div class="figures">{shown}</div>'


def table(heads: Iterable[str], rows: Iterable[Iterable[str]]) -> str:
    """Cells are HTML; columns in which no row has anything are left out.

    On a narrow screen rows are stacked, so each cell carries its column's name.
    """
    columns = [column for column in zip(heads, *rows, strict=True) if any(column[1:]) or len(column) == 1]
    heads, *rows = zip(*columns, strict=True)
    head = "".join(f"<th>{text(name)}</th>" for name in heads)
    body = "".join(
        "<tr>"
        + "".join(f'<td data-name="{text(name)}"><div>{cell}</div></td>' for name, cell in zip(heads, row, strict=True))
        + "</tr>"
        for row in rows
    )
    return f'<div class="scroll"><table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table></div>'


def picture(image: NDArray[np.uint8], words: str) -> str:
    """An image (h, w, 3), RGB, within the page; words: what it shows, for who cannot see it."""
    return f'<img src="{_address(image)}" alt="{text(words)}">'


def video(webm: bytes, poster: NDArray[np.uint8], words: str) -> str:
    """A film within the page, and the picture (h, w, 3), RGB, that stands for it until it plays, and on paper."""
    data = base64.b64encode(webm).decode()
    h, w = poster.shape[:2]
    source = f'<source src="data:video/webm;base64,{data}" type="video/webm">'
    size = f'width="{w}" height="{h}" poster="{_address(poster)}"'
    return f'<video controls muted loop playsinline {size} aria-label="{text(words)}">{source}</video>'


def figure(svg: str) -> str:
    """A drawing in SVG within the page, in a box of its own that scrolls where the page is narrower."""
    # Within HTML an SVG needs no address of what it is, and a page without addresses visibly needs no network.
    bare = svg.replace(" xmlns='http://www.w3.org/2000/svg'", "")
    return f'<div class="scroll figure">{bare}</div>'


def jpeg(image: NDArray[np.uint8]) -> bytes:
    """An image (h, w, 3), RGB, as pages hold it."""
    _, data = cv2.imencode(".jpg", cv2.cvtColor(image, cv2.COLOR_RGB2BGR), [cv2.IMWRITE_JPEG_QUALITY, 82])
    return data.tobytes()


def _address(image: NDArray[np.uint8]) -> str:
    """One that holds an image (h, w, 3), RGB."""
    return f"data:image/jpeg;base64,{base64.b64encode(jpeg(image)).decode()}"


def chip(words: str, kind: str) -> str:
    """Words on a colour; kind: good, bad, poor or plain."""
    return f'<span class="chip {kind}">{text(words)}</span>'


_STYLE = """
:root { --ink: #1d2329; --faint: #66707a; --line: #d9dee3; --good: #1a7f4b; --bad: #b3261e; --poor: #9a6700; }
* { box-sizing: border-box; }
body { margin: 0; background: #f5f6f8; color: var(--ink); font: 15px/1.5 system-ui, sans-serif; }
main { max-width: 1100px; margin: 0 auto; padding: 24px 16px 64px; }
h1 { font-size: 26px; margin: 0; } h2 { font-size: 20px; margin: 36px 0 10px; } h3 { font-size: 17px; margin: 0; }
small, .legend { color: var(--faint); } h3 small { font-weight: normal; }
p { margin: 6px 0; }
section { background: #fff; border: 1px solid var(--line); border-radius: 8px; padding: 14px; margin: 14px 0; }
.problem { background: #fff4e0; border-left: 4px solid var(--poor); padding: 8px 12px; overflow-wrap: anywhere; }
.figures { display: flex; flex-wrap: wrap; gap: 10px; margin: 16px 0; }
.figures div { background: #fff; border: 1px solid var(--line); border-radius: 8px; }
.figures div { padding: 8px 14px; flex: 1 1 130px; }
.figures b { display: block; font-size: 20px; } .figures span { color: var(--faint); font-size: 13px; }
.pictures { display: flex; flex-wrap: wrap; gap: 8px; align-items: flex-start; margin: 10px 0; }
.pictures img { width: 100%; min-width: 0; border-radius: 4px; }
.pictures img:first-child { flex: 2.1 1 480px; } .pictures img:last-child { flex: 1 1 230px; }
table { width: 100%; border-collapse: collapse; background: #fff; font-size: 14px; }
th { text-align: left; color: var(--faint); font-weight: 600; font-size: 12.5px; }
th, td { padding: 5px 8px; border-bottom: 1px solid var(--line); vertical-align: top; }
td { font-variant-numeric: tabular-nums; }
.chip { border-radius: 10px; padding: 1px 9px; font-size: 13px; background: #e8ebee; white-space: nowrap; }
.chip.good { background: #dcf3e6; color: var(--good); } .chip.bad { background: #fbe3e1; color: var(--bad); }
.chip.poor { background: #fff0d6; color: var(--poor); }
h1 + p .chip, .head .chip { white-space: normal; }
h1 + p .chip { font-size: 15px; }
.name { white-space: nowrap; }
.name i { display: inline-block; width: 11px; height: 11px; border-radius: 3px; margin-right: 6px; }
.bar { display: inline-block; height: 11px; margin-right: 8px; background: #5b8def; min-width: 2px; }
.digest { font: 12px monospace; color: var(--faint); overflow-wrap: anywhere; }
details { margin: 14px 0; } summary { cursor: pointer; padding: 4px 0; }
pre { overflow-x: auto; background: #fff; border: 1px solid var(--line); padding: 10px; font-size: 12.5px; }
.gallery { display: grid; grid-template-columns: repeat(auto-fill, minmax(420px, 1fr)); gap: 12px; }
.gallery.three { grid-template-columns: repeat(auto-fit, minmax(280px, 1fr)); }
.gallery figure { margin: 0; } .gallery img { width: 100%; border-radius: 4px; display: block; }
.gallery figcaption { font-size: 13px; color: var(--faint); }
.scroll { overflow-x: auto; }
.figure { background: #fff; border: 1px solid var(--line); border-radius: 8px; padding: 6px; }
.figure svg { display: block; }
.scene { display: flex; flex-wrap: wrap; gap: 0 20px; align-items: flex-start; }
.scene > div { flex: 1 1 440px; min-width: 0; max-width: 680px; }
.scene svg, .pair .figure svg { width: 100%; height: auto; }
video { width: 100%; height: auto; border-radius: 8px; display: block; background: #23282d; }
.cards { display: grid; grid-template-columns: repeat(auto-fill, minmax(min(100%, 500px), 1fr)); gap: 14px; }
.attempt { display: flex; flex-wrap: wrap; gap: 8px 14px; margin: 0; align-items: flex-start; }
.attempt img { flex: 1.2 1 230px; min-width: 0; width: 100%; max-width: 480px; border-radius: 4px; }
.attempt > div { flex: 1 1 200px; min-width: 0; }
.attempt > .because { flex: 1 1 100%; font-size: 13px; color: var(--faint); } .because p { margin: 2px 0; }
dl { display: grid; grid-template-columns: max-content 1fr; gap: 3px 10px; margin: 8px 0 0; font-size: 13.5px; }
dt { color: var(--faint); } dd { margin: 0; overflow-wrap: anywhere; }
.pair { display: grid; grid-template-columns: repeat(auto-fit, minmax(min(100%, 340px), 1fr)); gap: 0 14px; }
.pair > div { min-width: 0; } .pair img { width: 100%; border-radius: 4px; display: block; }
.pair .head { margin: 8px 0; }
.pair + .scroll td, .wraps td { overflow-wrap: anywhere; }
.plots { display: flex; flex-wrap: wrap; gap: 12px; align-items: flex-start; }
.plots svg { max-width: 100%; height: auto; }
@media (max-width: 640px) {
  thead { display: none; }
  tr { display: grid; grid-template-columns: 1fr 1fr; padding: 6px 0; border-bottom: 1px solid var(--line); }
  td { border: 0; padding: 2px 8px; }
  td::before { content: attr(data-name); color: var(--faint); font-size: 12.5px; display: block; }
  td:has(> div:empty) { display: none; }
}
@media print {
  body { background: #fff; font-size: 11pt; } main { max-width: none; padding: 0; }
  section, .figures div, tr, .figure, video { break-inside: avoid; } * { print-color-adjust: exact; }
  h2, h3, .legend { break-after: avoid; } .scroll { overflow: visible; } section { padding: 10px; margin: 10px 0; }
  .pictures { flex-wrap: nowrap; } .pictures img:first-child, .pictures img:last-child { flex-basis: 0; }
  h2 { margin-top: 22px; } table { font-size: 9.5pt; }
  .figure svg { max-width: 100%; height: auto; } .scene { display: block; } .scene > div { max-width: 560px; }
}
"""
