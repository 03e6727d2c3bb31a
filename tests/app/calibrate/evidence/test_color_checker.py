"""The evidence of a chart: its picture, patches and residuals; corners that are moved are asked for."""

from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from dsl_app.calibrate.evidence.base import make_evidence
from dsl_app.calibrate.evidence.chart_picture import patch_outlines, screen_colours
from dsl_app.calibrate.evidence.color_checker import ColorCheckerEvidence
from dsl_app.calibrate.wizard.state import Fit
from dsl_app.shared.theme import Theme
from PySide6.QtCore import QEvent, QPoint, QPointF, Qt
from PySide6.QtGui import QMouseEvent
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication
from pytestqt.qtbot import QtBot

from dsl_core.calibration.colour.color_checker import expected_colours
from dsl_core.calibration.colour.patches import patch_samples
from dsl_core.campaign.color_checker.recipe import ColorCheckerRecipe
from dsl_core.campaign.common.recipe import Bench
from dsl_core.campaign.recipes import load_recipe
from dsl_core.campaign.session import CalibrationSession
from dsl_core.model.calibration.accepted import AcceptedCalibration
from dsl_core.model.calibration.color_checker import ColorCheckerCalibration, PatchResult
from dsl_core.model.rig import Rig
from dsl_core.optics.charts import chart_reflectance
from dsl_core.progress import NoProgress
from dsl_core.simulation.sim_devices import open_twin
from tests.app.calibrate.evidence_bench import THEMES, bars, curves, row_texts, shown

CHART = "BabelColor Average"
#: Where the chart stands in the twin's picture of 222 x 145 pixels.
CORNERS = ((12.0, 5.0), (210.0, 5.0), (210.0, 137.0), (12.0, 137.0))


@pytest.fixture(scope="module")
def session(tmp_path_factory: pytest.TempPathFactory) -> CalibrationSession:
    """The chart, captured; only what evidence asks of a session."""
    devices = open_twin({"size": "222x145"})
    assert devices.calibration is not None
    assert devices.place is not None
    bench = Bench(devices, tmp_path_factory.mktemp("chart"), devices.calibration)
    recipe = ColorCheckerRecipe()
    (step,) = recipe.steps(bench)
    devices.place(step.placement)
    recipe.capture(bench, step, NoProgress())
    return cast(CalibrationSession, SimpleNamespace(bench=bench, steps=(step,)))


def calibration(rig: Rig, **changes: Any) -> ColorCheckerCalibration:
    """What the rig expects, measured exactly but for the first patch, which is 10 % brighter."""
    expected = expected_colours(rig, CHART)
    expected[0] *= 1.1
    patches = tuple(
        PatchResult(
            name=name,
            pixels=100,
            saturated=0.0,
            signal=tuple((0.0, 0.0, 0.0, float(value)) for value in expected[index]),
            std=tuple((0.0, 0.0, 0.0, 0.001 * float(value)) for value in expected[index]),
            residual=0.001 * index,
            held_out=0.002 * index,
            start=0.003 * index,
        )
        for index, name in enumerate(chart_reflectance(np.arange(400.0, 701.0), CHART))
    )
    made = ColorCheckerCalibration(
        chart=CHART,
        corners_px=CORNERS,
        quarter_turns=0,
        patches=patches,
        response=rig.response,
        emission=rig.emission,
        white_scale=rig.white_scale,
        weight=0.005,
        reflectance_error=0.01,
        chart_level=0.0,
        published_held_out=0.01,
        tilt_deg=0.4,
        distance_mm=700.0,
    )
    return made.model_copy(update=changes)


def evidence(qtbot: QtBot, session: CalibrationSession, theme: Theme = THEMES[0]) -> Any:
    widget = shown(qtbot, "color-checker", calibration(session.bench.rig), session, theme)
    qtbot.waitUntil(lambda: widget.chart.image.image is not None, timeout=20_000)
    return widget


@pytest.mark.parametrize("theme", THEMES)
def test_chart_patches_and_curves_are_shown(qtbot: QtBot, session: CalibrationSession, theme: Theme) -> None:
    widget = evidence(qtbot, session, theme)
    assert widget.chart.image.image.shape == (145, 222, 3)
    assert np.allclose(widget.chart.corners_px, CORNERS)
    rig, record = session.bench.rig, calibration(session.bench.rig)
    before, held_out, inside = bars(widget.residuals)
    assert before == pytest.approx([0.3 * i for i in range(24)])
    assert held_out == pytest.approx([0.2 * i for i in range(24)])
    assert inside == pytest.approx([0.1 * i for i in range(24)])
    first, last = row_texts(widget.table, 0), row_texts(widget.table, 23)
    red, _, _ = (float(part) for part in first[4].split(" / "))
    assert first[0] == "dark skin"
    assert float(first[1].split(" ± ")[0]) == pytest.approx(1.1 * red, rel=0.01)
    assert last[5:] == ["2.30", "4.60"]
    assert widget.table.item(23, 6).foreground().color().name() == theme.bad
    # Six curves after and six before; the emission is the rig's own, up to nothing.
    assert any(np.array_equal(values, record.response[0].values) for values in curves(widget.response))
    assert len(curves(widget.emission)) == 6
    assert rig.white_scale == record.white_scale


def test_measured_stands_beside_expected(qtbot: QtBot, session: CalibrationSession) -> None:
    widget = evidence(qtbot, session)
    assert widget.swatches.measured[1] == widget.swatches.expected[1]
    assert widget.swatches.measured[0].lightness() > widget.swatches.expected[0].lightness()
    assert "black 2" in widget.swatches.accessibleDescription()
    (red,) = screen_colours(np.array([[1.0, 0.0, 0.0]]))
    assert red.name() == "#ff0000"


def test_outlines_are_what_the_calibration_measures() -> None:
    corners = np.array([(12.0, 9.0), (208.0, 5.0), (201.0, 131.0), (20.0, 137.0)])
    ours = patch_outlines(corners)
    for outline, pixels in zip(ours, patch_samples(corners, (145, 222)).pixels, strict=True):
        rows, columns = np.divmod(pixels, 222)
        middle = np.array([columns.mean(), rows.mean()])
        assert np.abs(outline.mean(0) - middle).max() < 0.6
        assert outline[:, 0].min() - 0.01 <= columns.min()
        assert columns.max() <= outline[:, 0].max() + 0.01


def drag(widget: Any, start: QPoint, end: QPoint) -> None:
    """Press, move and release the left button on the canvas."""
    viewport = widget.chart.canvas.viewport()
    QTest.mousePress(viewport, Qt.MouseButton.LeftButton, pos=start)
    for share in (0.25, 0.5, 0.75, 1.0):
        at = start + (end - start) * share
        QApplication.sendEvent(
            viewport,
            QMouseEvent(
                QEvent.Type.MouseMove,
                QPointF(at),
                QPointF(viewport.mapToGlobal(at)),
                Qt.MouseButton.NoButton,
                Qt.MouseButton.LeftButton,
                Qt.KeyboardModifier.NoModifier,
            ),
        )
        QTest.qWait(15)
    QTest.mouseRelease(viewport, Qt.MouseButton.LeftButton, pos=end)


def test_a_dragged_corner_is_asked_for(qtbot: QtBot, session: CalibrationSession) -> None:
    widget = evidence(qtbot, session)
    qtbot.waitExposed(widget)
    assert not widget.again.isEnabled()
    canvas, box = widget.chart.canvas, widget.chart.box
    scene_at = [box.mapViewToScene(QPointF(*at)) for at in (CORNERS[2], (200.0, 130.0))]
    start, end = (canvas.mapFromScene(at) for at in scene_at)
    drag(widget, start, end)
    corners = widget.chart.corners_px
    assert corners[2] == pytest.approx((200, 130), abs=3)
    with qtbot.waitSignal(widget.settings_requested) as heard:
        QTest.mouseClick(widget.again, Qt.MouseButton.LeftButton)
    recipe = load_recipe("color-checker", heard.args[0])
    assert isinstance(recipe, ColorCheckerRecipe)
    assert recipe.corners_px is not None
    assert np.allclose(recipe.corners_px, corners, atol=0.01)
    QTest.mouseClick(widget.back, Qt.MouseButton.LeftButton)
    assert np.allclose(widget.chart.corners_px, CORNERS)
    assert not widget.again.isEnabled()


def test_corners_move_by_keys(qtbot: QtBot, session: CalibrationSession) -> None:
    widget = evidence(qtbot, session)
    QTest.keyClick(widget.chart, Qt.Key.Key_2)
    QTest.keyClick(widget.chart, Qt.Key.Key_Left, Qt.KeyboardModifier.ShiftModifier)
    QTest.keyClick(widget.chart, Qt.Key.Key_Down)
    assert np.allclose(widget.chart.corners_px[1], (200, 6))
    with qtbot.waitSignal(widget.settings_requested) as heard:
        QTest.mouseClick(widget.again, Qt.MouseButton.LeftButton)
    assert json.loads(heard.args[0]["corners_px"])[1] == [200.0, 6.0]


def test_corners_are_set_by_hand_where_no_chart_was_found(qtbot: QtBot, session: CalibrationSession) -> None:
    widget = make_evidence("color-checker")
    assert isinstance(widget, ColorCheckerEvidence)
    qtbot.addWidget(widget)
    widget.resize(700, 500)
    assert widget.show_captures(unfitted(session, ColorCheckerRecipe()))
    widget.show()
    qtbot.waitUntil(lambda: widget.chart.image.image is not None, timeout=20_000)
    corners = widget.chart.corners_px
    assert corners.mean(0) == pytest.approx((110.5, 72))
    assert np.ptp(corners, axis=0)[0] == pytest.approx(1.5 * np.ptp(corners, axis=0)[1])
    assert "Drag the four corners" in widget.words.text()
    assert not widget.again.isEnabled()
    QTest.keyClick(widget.chart, Qt.Key.Key_Right)
    with qtbot.waitSignal(widget.settings_requested) as heard:
        QTest.mouseClick(widget.again, Qt.MouseButton.LeftButton)
    wanted = load_recipe("color-checker", heard.args[0])
    # The next attempt begins where the person left the corners.
    assert widget.show_captures(unfitted(session, wanted))
    qtbot.waitUntil(lambda: not widget._reader.is_busy, timeout=20_000)
    assert np.allclose(widget.chart.corners_px, corners + np.eye(4, 2) * (1, 0), atol=0.01)
    fitted = AcceptedCalibration(name="color-checker", title="")
    widget.show_fit(Fit(fitted, calibration(session.bench.rig), session))
    assert np.allclose(widget.chart.corners_px, CORNERS)
    qtbot.waitUntil(lambda: not widget._reader.is_busy, timeout=20_000)


def unfitted(session: CalibrationSession, recipe: object) -> CalibrationSession:
    found = SimpleNamespace(bench=session.bench, steps=session.steps, recipe=recipe)
    return cast(CalibrationSession, found)


def test_missing_captures_are_said_in_words(
    qtbot: QtBot, session: CalibrationSession, tmp_path: Path
) -> None:
    bench = session.bench
    empty = SimpleNamespace(bench=Bench(bench.devices, tmp_path, bench.rig), steps=session.steps)
    widget = shown(qtbot, "color-checker", calibration(bench.rig), cast(CalibrationSession, empty))
    qtbot.waitUntil(lambda: widget.words.property("role") == "bad", timeout=20_000)
    assert str(tmp_path) in widget.words.text()
