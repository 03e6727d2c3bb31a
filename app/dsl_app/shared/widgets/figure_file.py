"""A plot as a figure in a file: SVG for print and drawing programs, PNG for everything else."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import Any

from PySide6.QtCore import QBuffer, QByteArray, QIODevice, QRectF
from PySide6.QtGui import QImage, QImageWriter, QPaintDevice, QPainter
from PySide6.QtWidgets import QGraphicsItem, QGraphicsView

import dsl_core
from dsl_app.shared.theme import LIGHT, Theme
from dsl_core.errors import StoreError
from dsl_core.io.atomic import write_atomic

#: Pixels of a PNG for one of the screen; lines, which stay as thin as there, would vanish among more.
PNG_SCALE = 2
FORMATS = "SVG (*.svg);;PNG (*.png)"
SUFFIXES = (".svg", ".png")


@dataclass(frozen=True)
class PlotFigure:
    """A plot that can be saved: its proposed file name, and what applies the colours of a theme.

    ``curves`` are those that the window names next to the plot; the file gets a legend instead.
    """

    name: str
    plot: Any
    apply_theme: Callable[[Theme], object]
    curves: tuple[tuple[Any, str], ...] = ()


def save_figure(figure: PlotFigure, path: Path, theme: Theme) -> None:
    """Write a figure as the screen shows it, but in the light theme; ``theme`` is applied again afterwards.

    Raises `StoreError` for an ending that is not in `SUFFIXES`, and when the file cannot be written.
    """
    if path.suffix.lower() not in SUFFIXES:
        raise StoreError(f"{path.name!r} does not end in .svg or .png. Add the ending to the name.")
    figure.apply_theme(LIGHT)
    legend = _legend(figure)
    try:
        draw = _svg if path.suffix.lower() == ".svg" else _png
        data = draw(figure.plot, path.stem, f"dsl-scan {dsl_core.__version__}")
    finally:
        figure.plot.scene().removeItem(legend)
        figure.apply_theme(theme)
    write_atomic(path, data)


def _legend(figure: PlotFigure) -> Any:
    import pyqtgraph as pg

    legend = pg.LegendItem(offset=(-12, 8), labelTextColor=LIGHT.text, brush=pg.mkBrush(f"{LIGHT.base}d0"))
    # It scales with the figure.
    legend.setFlag(legend.GraphicsItemFlag.ItemIgnoresTransformations, False)
    legend.setParentItem(figure.plot.getViewBox())
    for curve, name in figure.curves:
        legend.addItem(curve, escape(name))
    return legend


def _svg(plot: QGraphicsView, title: str, source: str) -> bytes:
    from PySide6.QtSvg import QSvgGenerator

    buffer, generator = QBuffer(), QSvgGenerator()
    buffer.open(QIODevice.OpenModeFlag.WriteOnly)
    generator.setOutputDevice(buffer)
    # Axes are drawn by a recording, which is scaled where resolutions differ.
    generator.setResolution(plot.logicalDpiX())
    generator.setSize(plot.viewport().size())
    generator.setViewBox(plot.viewport().rect())
    generator.setTitle(title)
    generator.setDescription(source)
    _draw(plot, generator, QRectF(plot.viewport().rect()))
    return bytes(buffer.data().data())


def _png(plot: QGraphicsView, title: str, source: str) -> bytes:
    image = QImage(plot.viewport().size() * PNG_SCALE, QImage.Format.Format_RGB32)
    image.setDevicePixelRatio(PNG_SCALE)
    image.setText("Title", title)
    image.setText("Software", source)
    _draw(plot, image, QRectF(plot.viewport().rect()))
    buffer = QBuffer()
    buffer.open(QIODevice.OpenModeFlag.WriteOnly)
    QImageWriter(buffer, QByteArray(b"png")).write(image)
    return bytes(buffer.data().data())


def _draw(plot: QGraphicsView, device: QPaintDevice, target: QRectF) -> None:
    painter = QPainter(device)
    painter.setRenderHint(QPainter.RenderHint.Antialiasing)
    painter.fillRect(target, plot.backgroundBrush())
    # Axes that the screen keeps as pictures of its resolution are lines and letters in a file.
    none = QGraphicsItem.CacheMode.NoCache
    kept = [(item, item.cacheMode()) for item in plot.items() if item.cacheMode() is not none]
    for item, _ in kept:
        item.setCacheMode(none)
    plot.render(painter, target, plot.viewport().rect())
    for item, mode in kept:
        item.setCacheMode(mode)
    painter.end()
