"""Marks of which drawings in SVG are made: plots, charts and maps share their ink and their type."""

import html
from collections.abc import Sequence

INK, FAINT, LINE = "#1d2329", "#66707a", "#d9dee3"
_FONT = "font-family='system-ui, sans-serif'"


def segment(x1: float, y1: float, x2: float, y2: float, color: str, width: float = 1.0, dashed: bool = False) -> str:
    """A straight line, in pixels."""
    dash = " stroke-dasharray='5 4'" if dashed else ""
    ends = f"x1='{x1:.1f}' y1='{y1:.1f}' x2='{x2:.1f}' y2='{y2:.1f}'"
    return f"<line {ends} stroke='{color}' stroke-width='{width:g}'{dash}/>"


def words(
    x: float,
    y: float,
    said: str,
    *,
    size: int = 12,
    weight: int = 400,
    anchor: str = "start",
    color: str = INK,
    turn: int = 0,
) -> str:
    """Plain text whose baseline starts, ends or has its middle (`anchor`) at x, y; turned by `turn` degrees."""
    turned = f" transform='rotate({turn} {x:.1f} {y:.1f})'" if turn else ""
    style = f"font-size='{size}' font-weight='{weight}' text-anchor='{anchor}' fill='{color}'"
    return f"<text x='{x:.1f}' y='{y:.1f}' {_FONT} {style}{turned}>{html.escape(said)}</text>"


def titled(marks: str, said: str) -> str:
    """Marks that say something, plain text, where a mouse rests on them."""
    return f"<g><title>{html.escape(said)}</title>{marks}</g>"


def drawing(width: int, height: int, title: str, parts: Sequence[str]) -> str:
    """A whole drawing on white; parts are SVG, the title is for who cannot see it."""
    size = f"width='{width}' height='{height}' viewBox='0 0 {width} {height}'"
    label = f"role='img' aria-label='{html.escape(title)}'"
    background = f"<rect width='{width}' height='{height}' fill='#fff'/>"
    return f"<svg xmlns='http://www.w3.org/2000/svg' {size} {label}>{background}{''.join(parts)}</svg>\n"
