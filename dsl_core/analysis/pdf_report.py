"""The report as PDF, A4, drawn by matplotlib: the same content as the HTML page, on paper."""

from __future__ import annotations

import base64
import textwrap
import warnings
from collections.abc import Iterator, Sequence
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dsl_core.evaluation.report.curves import HEIGHT, WIDTH, Curve
from dsl_core.evaluation.report.pictures import ReportPicture
from dsl_core.evaluation.report.scan_report import ReportContent, curves_of, pictures_of
from dsl_core.io.staging import staged

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_A4_INCH = (8.27, 11.69)
#: Pictures and curves a page, lines of text a page, characters a line.
_PICTURES, _CURVES, _LINES, _CHARACTERS = 6, 15, 62, 98
_INK, _QUIET, _ACCENT = "#1d2126", "#646c76", "#2563a8"


def write_pdf(content: ReportContent, path: Path, *, overwrite: bool = False) -> Path:
    """Write a report as PDF, whole or not at all, and return its path; raises `StoreError`."""
    from matplotlib.backends.backend_pdf import PdfPages

    with staged([path], overwrite=overwrite) as (draft,), warnings.catch_warnings():
        # A name in a script that the font lacks shows boxes; that is no reason to have no report.
        warnings.filterwarnings("ignore", message="Glyph .* missing")
        details = {"Title": content.title, "Creator": "dsl-scan", "CreationDate": None}
        with PdfPages(draft, metadata=details) as pdf:
            for page in _pages(content):
                pdf.savefig(page)
    return path


def _pages(content: ReportContent) -> Iterator[Figure]:
    yield from _text_pages(content.title, [*_summary(content), *_tables(content)])
    pictures = pictures_of(content)
    for start in range(0, len(pictures), _PICTURES):
        yield _page_of(pictures[start : start + _PICTURES], (3, 2), _draw_picture)
    curves = curves_of(content)
    for start in range(0, len(curves), _CURVES):
        yield _page_of(curves[start : start + _CURVES], (5, 3), _draw_curve)
    facts = [f"{name}: {value}" for name, value in content.provenance.items()]
    yield from _text_pages("Origin", [line for fact in facts for line in _wrapped(fact)])


def _summary(content: ReportContent) -> list[str]:
    lines = [line for sentence in content.missed for line in _wrapped(sentence)]
    lines += _wrapped(content.summary)
    if content.fit is not None:
        lines += _wrapped(content.fit.words)
    return [*lines, ""]


def _tables(content: ReportContent) -> list[str]:
    lines = []
    for table in content.tables:
        cells = [table.heads, *table.rows]
        widths = [min(max(len(row[i]) for row in cells), 34) for i in range(len(table.heads))]
        lines += [table.title.upper(), ""]
        for row in cells:
            first = row[0][: widths[0]].ljust(widths[0])
            lines.append("  ".join([first, *(c.rjust(w) for c, w in zip(row[1:], widths[1:], strict=True))]))
        lines += ["", *_wrapped(table.note), ""]
    return lines


def _wrapped(text: str) -> list[str]:
    return [line for part in text.splitlines() for line in textwrap.wrap(part, _CHARACTERS)]


def _text_pages(title: str, lines: Sequence[str]) -> Iterator[Figure]:
    for start in range(0, max(len(lines), 1), _LINES):
        page = _figure()
        if start == 0:
            _write(page, 0.08, 0.95, title, size=15, weight="bold")
        text = "\n".join(lines[start : start + _LINES])
        _write(page, 0.08, 0.92, text, size=8, family="monospace", va="top", linespacing=1.35)
        yield page


def _figure() -> Figure:
    from matplotlib.figure import Figure

    return Figure(figsize=_A4_INCH, dpi=150)


def _write(page: Any, x: float, y: float, text: str, **how: Any) -> None:
    """Text of strangers is never read as a formula."""
    page.text(x, y, text, color=how.pop("color", _INK), parse_math=False, **how)


def _page_of(things: Sequence[Any], grid: tuple[int, int], draw: Any) -> Figure:
    page = _figure()
    axes = page.subplots(*grid, squeeze=False).ravel()
    for place, axis in enumerate(axes):
        if place < len(things):
            draw(axis, things[place])
        else:
            axis.set_axis_off()
    page.subplots_adjust(left=0.08, right=0.95, top=0.95, bottom=0.05, hspace=0.45, wspace=0.2)
    return page


def _draw_picture(axis: Axes, picture: ReportPicture) -> None:
    from matplotlib.image import imread

    content = base64.b64decode(picture.uri.partition(",")[2])
    pixels = imread(BytesIO(content), format="png")
    axis.imshow(pixels)
    height, width = pixels.shape[:2]
    for x, y, label in picture.pins:
        axis.text(
            x / 100 * width, y / 100 * height, label, color="white", size=6, ha="center", va="center",
            bbox={"boxstyle": "circle", "fc": "black", "alpha": 0.7}, parse_math=False,
        )  # fmt: skip
    axis.set_axis_off()
    axis.set_title(picture.title, size=9, loc="left", color=_INK, parse_math=False)
    below = textwrap.wrap(picture.caption, 56)
    if picture.gradient:
        below.append(f"{picture.low} to {picture.high}")
    how: dict[str, Any] = {"size": 6, "va": "top", "transform": axis.transAxes, "parse_math": False}
    axis.text(0, -0.03, "\n".join(below), color=_QUIET, **how)
    for place, key in enumerate(picture.keys[:14]):
        line = f"{key.text[:46]}  {100 * key.share:.1f} %"
        y = -0.05 - 0.05 * (len(below) + place)
        swatch = key.colour if key.colour != "transparent" else "white"
        axis.text(0, y, "■", color=swatch, **how)
        axis.text(0.04, y, line, color=_INK, **how)


def _draw_curve(axis: Axes, curve: Curve) -> None:
    if curve.band:
        axis.fill(*_points(curve.band), color=_ACCENT, alpha=0.2, lw=0)
    axis.plot(*_points(curve.line), color=_ACCENT, lw=1)
    axis.set(xlim=(0, WIDTH), ylim=(HEIGHT, 0))
    axis.set_xticks([tick.at for tick in curve.x_ticks], [tick.label for tick in curve.x_ticks])
    axis.set_yticks([tick.at for tick in curve.y_ticks], [tick.label for tick in curve.y_ticks])
    axis.tick_params(labelsize=6, length=2)
    axis.set_title(f"{curve.title}  {curve.note}", size=7, loc="left", color=_INK, parse_math=False)


def _points(text: str) -> tuple[list[float], list[float]]:
    pairs = [pair.split(",") for pair in text.split()]
    return [float(x) for x, _ in pairs], [float(y) for _, y in pairs]
