"""One quick shot tells a rig that is as it was calibrated from one that is not, and what has changed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from dsl_core.calibration.drift.geometry import smooth_part
from dsl_core.campaign.common.white_shot import WhiteLevel
from dsl_core.campaign.drift_check import drift_figures, drift_settings, measure_drift, quick_plan
from dsl_core.errors import CalibrationError, DecodeError
from dsl_core.model.figure import failures
from dsl_core.model.geometry import Pose
from dsl_core.model.plan import CapturePlan
from dsl_core.model.rig import Rig
from dsl_core.model.spectral import SpectralCurve
from dsl_core.simulation import sim_devices
from dsl_core.simulation.published_rig import published_rig
from dsl_core.simulation.sim_devices import SimCamera, open_twin
from tests.cases.rounding import Rounding
from tests.cases.twin_scan import MemoryScan, twin_scan

#: Pixels whose light is compared: enough to see, few enough to be quick.
FEW = 1500
Change = Callable[[Rig], Rig]


@pytest.fixture(scope="module")
def shot() -> tuple[Rig, MemoryScan]:
    """A rig drawn at random, vignetting included, and its quick shot."""
    plane = {"size": "160x104", "scene": "plane", "tilt_x_deg": "5", "tilt_y_deg": "-8"}
    devices, scan = twin_scan(quick_plan(), truth="7", **plane)
    assert isinstance(devices.camera, SimCamera)
    return devices.camera.world.rig, scan


def turned(rig: Rig, angle_deg: float) -> Rig:
    """The projector turned about its own x axis, which moves what it shows up or down."""
    c, s = np.cos(np.deg2rad(angle_deg)), np.sin(np.deg2rad(angle_deg))
    turn = np.array([[1, 0, 0], [0, c, -s], [0, s, c]])
    a, b, d = (turn @ rig.pose.matrix).tolist()
    x, y, z = (turn @ rig.pose.vector_mm).tolist()
    return rig.model_copy(update={"pose": Pose(rotation=(a, b, d), translation_mm=(x, y, z))})


def other_lens(rig: Rig) -> Rig:
    k1, *others = rig.projector.distortion
    return _changed(rig, "projector", distortion=(k1 + 0.05, *others))


def tilted_film(rig: Rig) -> Rig:
    return _changed(rig, "film", tilt_y_deg=rig.film.tilt_y_deg + 1.5)


def other_film(rig: Rig) -> Rig:
    return _changed(rig, "film", lines_per_mm=rig.film.lines_per_mm * 1.004)


def _changed(rig: Rig, part: str, **values: object) -> Rig:
    return rig.model_copy(update={part: getattr(rig, part).model_copy(update=values)})


def test_a_rig_as_it_was_calibrated_passes(shot: tuple[Rig, MemoryScan]) -> None:
    rig, scan = shot
    figures = drift_figures(scan, rig, spectralon=False, pixels=FEW)
    assert [figure.name for figure in figures if not figure.passed] == []
    by_name = {figure.name: figure for figure in figures}
    assert by_name["row drift"].value < 0.05
    assert by_name["column drift on a plane"].value < 0.06
    assert abs(by_name["displacement of order +1"].value) < 0.1
    assert by_name["brightness of order -1, over calibration"].value == pytest.approx(1, abs=0.02)


@pytest.mark.parametrize("rate_hz", [50.0, 60.0, 120.0, 7.0])
def test_exposures_of_the_quick_shot_are_whole_colour_cycles(rate_hz: float) -> None:
    period_ms = 1000 / rate_hz
    for setting, usual in zip(quick_plan(period_ms).settings, quick_plan().settings, strict=True):
        cycles = setting.exposure_ms / period_ms
        assert cycles == pytest.approx(round(cycles))
        assert setting.exposure_ms == pytest.approx(usual.exposure_ms, abs=period_ms / 2)
    assert quick_plan(1000 / 60).settings == CapturePlan().settings


def test_saturated_white_gets_advice_for_a_shot_without_settings_to_lower(
    shot: tuple[Rig, MemoryScan],
) -> None:
    rig, scan = shot
    bright = tuple(np.full_like(frame, rig.sensor.full_scale_dn) for frame in scan.frames)
    with pytest.raises(DecodeError, match="its own exposures") as found:
        drift_figures(replace(scan, frames=bright), rig, spectralon=False, pixels=FEW)
    assert "plan's settings" not in str(found.value)


def test_white_that_is_saturated_nearly_everywhere_is_not_called_a_missing_plane(
    shot: tuple[Rig, MemoryScan],
) -> None:
    rig, scan = shot
    bright = [np.full_like(frame, rig.sensor.full_scale_dn) for frame in scan.frames]
    for frame, seen in zip(bright, scan.frames, strict=True):
        frame[:, :8] = seen[:, :8]
    with pytest.raises(DecodeError, match="saturated in 95% of its pixels"):
        drift_figures(replace(scan, frames=tuple(bright)), rig, spectralon=False, pixels=FEW)


def test_settings_are_the_usual_ones_unless_white_saturates_in_them() -> None:
    rig = published_rig()
    usual, response = quick_plan(rig.frame_period_ms).settings, rig.projector_response
    range_dn = rig.sensor.full_scale_dn - rig.sensor.black_level_dn
    light = float(response.radiance(0.2) - response.radiance(0.0))
    limit = 0.9 * range_dn / (light * usual[0].exposure_ms)
    assert drift_settings(rig, WhiteLevel(0.99 * limit, np.ones(3), 0.0, False)) == usual
    short, long = drift_settings(rig, WhiteLevel(4 * limit, np.ones(3), 0.0, False))
    light = float(response.radiance(short.level) - response.radiance(0.0))
    assert 0.3 * range_dn < 4 * limit * light * short.exposure_ms <= 0.9 * range_dn
    assert long.exposure_ms > short.exposure_ms
    with pytest.raises(CalibrationError, match="overexposed in one colour cycle"):
        drift_settings(rig, WhiteLevel(limit, np.ones(3), 0.0, True))


@pytest.mark.slow
def test_a_brighter_rig_is_checked_and_brighter_light_is_told(tmp_path: Path) -> None:
    devices = open_twin({"size": "112x72", "scene": "plane", "brightness": "4"})
    rig = devices.calibration
    assert rig is not None
    assert failures(measure_drift(devices, rig, tmp_path / "one.dsl", spectralon=True)) == ()
    dimmer = rig.model_copy(update={"white_scale": rig.white_scale / 4})
    missed = failures(measure_drift(devices, dimmer, tmp_path / "two.dsl", spectralon=True))
    assert [figure.name.split(",")[0] for figure in missed] == ["white signal"] * 3
    assert [figure.value for figure in missed] == pytest.approx([4.0] * 3, rel=0.01)


@pytest.mark.slow
def test_a_camera_that_rounds_exposures_is_no_change_of_the_light(tmp_path: Path) -> None:
    devices = open_twin({"size": "112x72", "scene": "plane"})
    devices = replace(devices, camera=Rounding(devices.camera, lambda ms: 1.045))
    rig = devices.calibration
    assert rig is not None
    assert failures(measure_drift(devices, rig, tmp_path / "one.dsl", spectralon=True)) == ()


@pytest.mark.slow
def test_the_light_is_compared_with_a_spectralon(shot: tuple[Rig, MemoryScan]) -> None:
    """The plane of the twin is one."""
    rig, scan = shot
    for figure in drift_figures(scan, rig, spectralon=True, pixels=FEW):
        if figure.name.startswith("white"):
            assert figure.value == pytest.approx(1, abs=0.005), figure
            assert figure.std is not None
            assert figure.std < 0.002
    brighter = rig.model_copy(update={"white_scale": rig.white_scale * 1.06})
    missed = [
        figure for figure in drift_figures(scan, brighter, spectralon=True, pixels=FEW) if not figure.passed
    ]
    assert [figure.name.split(",")[0] for figure in missed] == ["white signal"] * 3


@pytest.mark.slow
def test_the_light_is_compared_with_the_white_it_was_calibrated_with() -> None:
    devices, scan = twin_scan(quick_plan(), size="112x72", scene="plane", reflectance="0.5")
    rig = devices.calibration
    assert rig is not None
    grey = rig.model_copy(update={"white_reflectance": SpectralCurve.of([400.0, 700.0], [0.5, 0.5])})
    assert failures(drift_figures(scan, grey, spectralon=True, pixels=FEW)) == ()
    missed = failures(drift_figures(scan, rig, spectralon=True, pixels=FEW))
    assert [figure.value for figure in missed] == pytest.approx([0.5 / 0.99] * 3, rel=0.01)
    # Another white than that of the calibration.
    wrong = rig.model_copy(update={"white_reflectance": SpectralCurve.of([400.0, 700.0], [0.95, 0.95])})
    missed = failures(drift_figures(scan, wrong, spectralon=True, pixels=FEW))
    assert [figure.value for figure in missed] == pytest.approx([0.5 / 0.95] * 3, rel=0.01)


@pytest.mark.parametrize(
    ("change", "name"),
    [
        (lambda rig: turned(rig, 0.03), "row drift"),
        (other_lens, "column drift on a plane"),
        (tilted_film, "displacement of order"),
        (other_film, "displacement of order"),
    ],
)
def test_what_has_changed_is_named(shot: tuple[Rig, MemoryScan], change: Change, name: str) -> None:
    rig, scan = shot
    missed = failures(drift_figures(scan, change(rig), False, pixels=FEW))
    assert any(figure.name.startswith(name) for figure in missed), missed
    assert all(figure.advice for figure in missed)


@pytest.fixture(scope="module")
def fine_film() -> tuple[Rig, MemoryScan]:
    """A rig whose film has 1000 lines/mm, most of whose first orders miss the picture, and its quick shot."""
    rig = _changed(published_rig(), "film", lines_per_mm=1000.0)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sim_devices, "published_rig", lambda: rig)
        devices, scan = twin_scan(quick_plan(), size="160x104", scene="plane")
    assert devices.calibration is not None
    return devices.calibration, scan


@pytest.mark.slow
def test_a_film_of_many_lines_has_not_moved_because_little_of_it_is_seen(
    fine_film: tuple[Rig, MemoryScan],
) -> None:
    rig, scan = fine_film
    figures = drift_figures(scan, rig, spectralon=False)
    assert failures(figures) == ()
    assert [figure.name.split(" ")[0] for figure in figures if "order" in figure.name] == [
        "light",
        "brightness",
    ] * 2


@pytest.mark.slow
def test_another_film_is_told_where_little_of_the_calibrated_one_is_seen(
    fine_film: tuple[Rig, MemoryScan], shot: tuple[Rig, MemoryScan]
) -> None:
    _, scan = shot
    calibrated = _changed(shot[0], "film", lines_per_mm=fine_film[0].film.lines_per_mm)
    missed = failures(drift_figures(scan, calibrated, spectralon=False))
    assert [figure.name for figure in missed] == [
        f"brightness of order {order}, over calibration" for order in ("+1", "-1")
    ]


def test_a_target_that_is_too_small_is_told() -> None:
    known = np.zeros((104, 160), bool)
    known[40:50, 60:80] = True
    with pytest.raises(CalibrationError, match="fills only"):
        smooth_part(np.zeros(known.sum()), known)
