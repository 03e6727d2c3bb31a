"""Plots become figures that readers which nobody here wrote open, light whatever the window's theme is."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pyqtgraph as pg
import pytest
from dsl_app.results.spectrum_panel import SpectrumPanel
from dsl_app.results.state import Mark, ResultsState
from dsl_app.shared.spectrum import Spectrum
from dsl_app.shared.theme import DARK, LIGHT
from dsl_app.shared.widgets.figure_file import PNG_SCALE, PlotFigure, save_figure
from PIL import Image
from PySide6.QtWidgets import QFileDialog
from pytestqt.qtbot import QtBot

from dsl_core.errors import StoreError
from tests.app.support.results_bench import Bench
from tests.app.support.results_bench import bench as bench

NM = np.linspace(430.0, 660.0, 24)
PAPER = tuple(bytes.fromhex(LIGHT.base[1:]))


@pytest.fixture
def figure(qtbot: QtBot) -> Iterator[PlotFigure]:
    state = ResultsState()
    panel = SpectrumPanel(state)
    qtbot.addWidget(panel)
    panel.apply_theme(DARK)
    panel.resize(400, 300)
    panel.show()
    qtbot.waitExposed(panel)
    spectrum = Spectrum(NM, np.linspace(0.1, 0.9, NM.size), np.full(NM.size, 0.05))
    state.marks.set((Mark("pin", "sky <1>", 0, spectrum, pixel=(3, 4)),))
    yield PlotFigure("spectra", panel.plot, panel.apply_theme, panel.named_curves)
    assert not any(isinstance(item, pg.LegendItem) for item in panel.plot.scene().items())
    assert panel.plot.backgroundBrush().color().name() == DARK.base


def test_svg_holds_lines_and_text(figure: PlotFigure, tmp_path: Path) -> None:
    save_figure(figure, tmp_path / "figure.svg", DARK)
    text = (tmp_path / "figure.svg").read_text("utf-8")
    root = ET.fromstring(text)
    assert root.tag == "{http://www.w3.org/2000/svg}svg"
    assert "<title>figure</title>" in text
    assert "dsl-scan" in text
    assert 'd=""' not in text
    # Axes and curves fit each other only at the resolution of the screen.
    width, dpi = figure.plot.viewport().width(), figure.plot.logicalDpiX()
    assert float(root.attrib["width"].removesuffix("mm")) == pytest.approx(25.4 * width / dpi, rel=1e-3)
    words = "".join(root.itertext())
    assert "Wavelength (nm)" in words
    assert "sky <1>" in words
    assert LIGHT.pins[0] in text
    assert "<image" not in text


def test_png_is_sharp_and_light(figure: PlotFigure, tmp_path: Path) -> None:
    save_figure(figure, tmp_path / "figure.png", DARK)
    size = figure.plot.viewport().size()
    with Image.open(tmp_path / "figure.png") as picture:
        assert picture.size == (PNG_SCALE * size.width(), PNG_SCALE * size.height())
        assert picture.info["Software"].startswith("dsl-scan")
        pixels = np.asarray(picture)[..., :3]
    assert tuple(pixels[2, 2]) == PAPER
    assert (pixels == tuple(bytes.fromhex(LIGHT.pins[0][1:]))).all(2).any()


def test_what_cannot_be_written_says_so(figure: PlotFigure, tmp_path: Path) -> None:
    with pytest.raises(StoreError, match=r"does not end in \.svg or \.png"):
        save_figure(figure, tmp_path / "figure.pdf", DARK)
    with pytest.raises(StoreError, match="could not be written"):
        save_figure(figure, tmp_path / "nowhere" / "figure.svg", DARK)


def test_the_window_saves_the_figure_of_the_page(
    bench: Bench, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    target = tmp_path / "mine.svg"
    monkeypatch.setattr(QFileDialog, "getSaveFileName", lambda *_: (str(target), ""))
    bench.window.do("save_figure")
    assert f"Saved as {target}" in bench.window.toasts.shown[-1].text
    assert target.stat().st_size > 1000
    target.unlink()
    bench.state.result.set(None)
    bench.window.do("save_figure")
    assert "no plot on this page" in bench.window.toasts.shown[-1].text
    assert not target.exists()
