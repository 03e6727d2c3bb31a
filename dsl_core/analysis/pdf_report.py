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
#: Curves a page, lines of text a page, characters a line, and of one below a picture.
_CURVES, _LINES, _CHARACTERS, _BELOW = 15, 62, 98, 66
#: In inches: edge of a page, gap between pictures, the highest picture; title, bar, line of a legend, indent.
_EDGE, _GAP, _HIGHEST = 0.66, 0.26, 3.4
_TITLE, _BAR, _LINE, _INDENT = 0.06, 0.1, 0.118, 0.13
#: So many classes have a line below the picture; the table has all.
_KEYS = 16
_INK, _QUIET, _ACCENT = "#1d2126", "#646c76", "#2563a8"


def write_pdf(content: ReportContent, path: Path, *, overwrite: bool = False) -> Path:
    """Write a report as PDF, whole or not at all, and return its path; raises `StoreError`."""
    from matplotlib.backends.backend_pdf import PdfPages

    with staged([path], overwrite=overwrite) as (draft,), warnings.catch_warnings():
        # A name in a script that the font lacks shows boxes; that is no reason to have no report.
        warnings.filterwarnings("ignore", message="Glyph .* missing")
        details = {"Title": content.title, "Creator": "dsl-scan", "CreationDate": None}
        # In memory: it says badly that a disk is full, and keeps the file open.
        drawn = BytesIO()
        with PdfPages(drawn, metadata=details) as pdf:
            for page in _pages(content):
                pdf.savefig(page)
        draft.write_bytes(drawn.getbuffer())
    return path


def _pages(content: ReportContent) -> Iterator[Figure]:
    yield from _text_pages(content.title, [*_summary(content), *_tables(content)])
    yield from _picture_pages(pictures_of(content))
    curves = curves_of(content)
    for start in range(0, len(curves), _CURVES):
        yield _page_of(curves[start : start + _CURVES], (5, 3))
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


def _picture_pages(pictures: Sequence[ReportPicture]) -> Iterator[Figure]:
    """Pictures in two columns, each with all of its legend below it; what does not fit begins a page."""
    page, top = _figure(), _A4_INCH[1] - _EDGE
    for start in range(0, len(pictures), 2):
        row = [_Block(picture) for picture in pictures[start : start + 2]]
        height = max(block.height for block in row)
        if top - height < 0.75 * _EDGE and start:
            yield page
            page, top = _figure(), _A4_INCH[1] - _EDGE
        for place, block in enumerate(row):
            block.draw(page, _EDGE + place * (_Block.WIDTH + _GAP), top)
        top -= height + _GAP
    if pictures:
        yield page


class _Block:
    """A picture with its title, colour bar and legend; lengths in inches."""

    WIDTH = (_A4_INCH[0] - 2 * _EDGE - _GAP) / 2

    def __init__(self, picture: ReportPicture) -> None:
        from matplotlib.image import imread

        self.picture = picture
        content = base64.b64decode(picture.uri.partition(",")[2])
        self.pixels = imread(BytesIO(content), format="png")
        rows, columns = self.pixels.shape[:2]
        self._size = self.WIDTH, min(self.WIDTH * rows / columns, _HIGHEST)
        self._bar = 2 * _BAR + _LINE if picture.gradient else 0.0
        self.caption = textwrap.wrap(picture.caption, _BELOW)
        #: Colour of the square before each line ("" for none), and its words.
        self.legend: list[tuple[str, str]] = []
        for key in picture.keys[:_KEYS]:
            first, *others = textwrap.wrap(f"{key.text}  {100 * key.share:.1f} %", _BELOW)
            self.legend += [(key.colour, first), *(("", line) for line in others)]
        if len(picture.keys) > _KEYS:
            self.legend.append(("", f"and {len(picture.keys) - _KEYS} more, see the table"))
        self.height = _TITLE + self._size[1] + self._bar + (len(self.caption) + len(self.legend) + 1) * _LINE

    def draw(self, page: Figure, x: float, top: float) -> None:
        """Draw it with its upper left corner at a place of a page."""
        picture = self.picture
        _write_at(page, x, top, picture.title, size=9, va="bottom")
        axis = page.add_axes(_on_page(x, top - _TITLE, *self._size))
        axis.imshow(self.pixels)
        axis.set_axis_off()
        height, width = self.pixels.shape[:2]
        for across, down, label in picture.pins:
            axis.text(
                across / 100 * width, down / 100 * height, label, color="white", size=6, ha="center",
                va="center", bbox={"boxstyle": "circle", "fc": "black", "alpha": 0.7}, parse_math=False,
            )  # fmt: skip
        y = top - _TITLE - self._size[1] - 0.5 * _LINE
        if picture.gradient:
            _draw_bar(page, picture, x, y)
            y -= self._bar
        for line in self.caption:
            _write_at(page, x, y, line, size=6, color=_QUIET)
            y -= _LINE
        for colour, line in self.legend:
            hollow = colour == "transparent"
            if colour:
                _write_at(page, x, y, "□" if hollow else "■", size=6, color=_QUIET if hollow else colour)
            _write_at(page, x + _INDENT, y, line, size=6)
            y -= _LINE


def _draw_bar(page: Figure, picture: ReportPicture, x: float, top: float) -> None:
    """The colours from the lowest value to the highest, and both."""
    from matplotlib.colors import LinearSegmentedColormap

    axis = page.add_axes(_on_page(x, top, _Block.WIDTH, _BAR))
    colours = LinearSegmentedColormap.from_list("bar", picture.gradient.split(", "))
    axis.imshow([range(256)], cmap=colours, aspect="auto")
    axis.set_axis_off()
    below = top - 1.5 * _BAR
    _write_at(page, x, below, picture.low.strip(), size=6)
    _write_at(page, x + _Block.WIDTH, below, picture.high.strip(), size=6, ha="right")


def _write_at(page: Figure, x: float, top: float, text: str, **how: Any) -> None:
    _write(page, x / _A4_INCH[0], top / _A4_INCH[1], text, **{"va": "top", **how})


def _on_page(x: float, top: float, width: float, height: float) -> tuple[float, float, float, float]:
    """A rectangle in shares of the page, as matplotlib wants it."""
    across, up = _A4_INCH
    return x / across, (top - height) / up, width / across, height / up


def _page_of(curves: Sequence[Curve], grid: tuple[int, int]) -> Figure:
    page = _figure()
    _write(page, 0.08, 0.975, "Reflectance over wavelength in nm, with 95 % bands", size=9)
    axes = page.subplots(*grid, squeeze=False).ravel()
    for place, axis in enumerate(axes):
        if place < len(curves):
            _draw_curve(axis, curves[place])
        else:
            axis.set_axis_off()
    page.subplots_adjust(left=0.08, right=0.95, top=0.95, bottom=0.05, hspace=0.45, wspace=0.2)
    return page


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
