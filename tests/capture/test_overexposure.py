"""White that is overexposed in every setting is told as soon as it was captured; the scan goes on."""

from __future__ import annotations

import logging

import numpy as np
import pytest

from dsl_core.capture.overexposure import MOST_OVEREXPOSED, ExposureWatch
from dsl_core.capture.runner import Status
from dsl_core.model.plan import CapturePlan, GrayCode, ScanLines, Setting
from dsl_core.model.rig import BayerPattern
from dsl_core.optics.sensor import bayer_channels
from dsl_core.pipeline import meter, open_scan, scan
from dsl_core.simulation.sim_devices import open_twin

PLAN = CapturePlan(
    camera_size_px=(10, 10),
    code=GrayCode(rows=False),
    spectral=ScanLines(step_px=5),
    settings=(Setting(exposure_ms=10, level=0.2), Setting(exposure_ms=20, level=0.8)),
    code_settings=(0, 1),
)
FULL_DN = 1023


def white(share: float) -> np.ndarray[tuple[int, ...], np.dtype[np.uint16]]:
    """A picture of which this share of the cells of 2 x 2 pixels is saturated in every colour."""
    cells = np.arange(FULL_DN - 25, FULL_DN, dtype=np.uint16)
    cells[: round(25 * share)] = FULL_DN
    return np.kron(cells.reshape(5, 5), np.ones((2, 2), np.uint16))


@pytest.mark.parametrize(
    ("dark", "bright", "told"),
    [
        (MOST_OVEREXPOSED + 0.02, 1.0, "52%"),
        (1.0, 1.0, "100%"),
        (MOST_OVEREXPOSED - 0.02, 1.0, ""),
        (0.0, 1.0, ""),
    ],
)
def test_what_no_setting_spares_counts(dark: float, bright: float, told: str) -> None:
    watch = ExposureWatch(PLAN, FULL_DN, "RGGB")
    for shot in PLAN.shots():
        share = 1.0 if shot.role != "white" else dark if shot.setting == 0 else bright
        watch.add(shot, white(share))
    assert (told in watch.found) if told else watch.found == ""


def test_what_one_colour_still_measures_does_not_count() -> None:
    watch, pixels = ExposureWatch(PLAN, FULL_DN, "RGGB"), white(1.0)
    pixels[::2, ::2] = FULL_DN - 1
    for shot in PLAN.shots():
        watch.add(shot, pixels)
    assert watch.found == ""


@pytest.mark.parametrize(("bayer", "light"), [("RGGB", (0.62, 0.94, 0.55)), ("MONO", (0.94, 0.94, 0.94))])
@pytest.mark.parametrize("full_dn", [255, 1023, 65535])
@pytest.mark.parametrize("noise_dn", [0.0, 0.15])
def test_white_without_noise_just_below_full_scale_is_not_saturated(
    bayer: BayerPattern, light: tuple[float, float, float], noise_dn: float, full_dn: int
) -> None:
    watch = ExposureWatch(PLAN, full_dn, bayer)
    seen = np.array(light)[bayer_channels(bayer, 60, 90)] * full_dn
    seen += np.random.default_rng(0).normal(0, noise_dn, seen.shape)
    for shot in PLAN.shots():
        watch.add(shot, np.rint(seen).astype(np.uint16))
    assert watch.found == ""


@pytest.mark.parametrize("full_dn", [255, 4095])
@pytest.mark.parametrize(("ends_share", "told"), [(0.92, "69%"), (0.996, "67%")])
def test_white_of_one_colour_that_ends_below_full_scale_is_saturated_there(
    full_dn: int, ends_share: float, told: str
) -> None:
    watch, end_dn = ExposureWatch(PLAN, full_dn, "MONO"), round(ends_share * full_dn)
    light = np.tile(np.linspace(0.0, 3.0, 300) * full_dn, (50, 1))
    for shot in PLAN.shots():
        watch.add(shot, np.minimum(light, end_dn).astype(np.uint16))
    assert told in watch.found


@pytest.mark.parametrize(("full_dn", "noise_dn"), [(255, 0.5), (4095, 3.0)])
@pytest.mark.parametrize(("times", "told"), [(1.5, "80%"), (8.0, "80%"), (0.98, "")])
def test_white_of_one_colour_that_is_far_too_bright_is_saturated_where_its_values_end(
    times: float, told: str, full_dn: int, noise_dn: float
) -> None:
    """Nothing is just below the end, as its surroundings are dark."""
    watch, end_dn = ExposureWatch(PLAN, full_dn, "MONO"), round(0.95 * full_dn)
    light = np.full((60, 90), times * end_dn)
    light[:, :18] = 0.02 * full_dn
    light += np.random.default_rng(0).normal(0, noise_dn, light.shape)
    for shot in PLAN.shots():
        watch.add(shot, np.rint(np.clip(light, 0, end_dn)).astype(np.uint16))
    assert (told in watch.found) if told else watch.found == ""


@pytest.mark.parametrize(("noise_dn", "told"), [(2.0, "100%"), (0.0, "")])
def test_where_white_is_saturated_all_over_stripes_of_the_code_tell_that_values_end(
    noise_dn: float, told: str
) -> None:
    """Their dark halves have noise, which bright light has as well unless values end there."""
    watch, rng = ExposureWatch(PLAN, 4095, "MONO"), np.random.default_rng(0)
    for shot in PLAN.shots():
        light = np.full((60, 90), 3900.0 if shot.role in ("white", "code") else 80.0)
        if shot.role == "code":
            light[:, :45] = np.linspace(80.0, 120.0, 45)
        light += np.where(light < 3900, rng.normal(0, noise_dn, light.shape), 0)
        watch.add(shot, np.rint(light).astype(np.uint16))
    assert (told in watch.found) if told else watch.found == ""


def test_white_that_ends_below_full_scale_is_saturated_there() -> None:
    watch, pixels = ExposureWatch(PLAN, FULL_DN, "RGGB"), white(1.0) - 3
    for shot in PLAN.shots():
        watch.add(shot, pixels)
    assert "100%" in watch.found


def test_a_scan_tells_it_once_and_ends_as_usual(tmp_path, caplog) -> None:  # type: ignore[no-untyped-def]
    rig = open_twin({"size": "48x32", "scene": "plane"})
    plan = CapturePlan(
        code=GrayCode(rows=False),
        spectral=ScanLines(width_px=40, step_px=40),
        settings=(Setting(exposure_ms=1000 / 3, level=0.4),),
        code_settings=(0,),
    ).sized(rig.camera.info, rig.projector.info)
    seen: list[Status] = []
    with caplog.at_level(logging.WARNING), open_scan(rig, plan, tmp_path / "a.dsl") as runner:
        runner.listen(seen.append)
        status = runner.run()
    assert status.overexposed.startswith("White is overexposed in 9")
    assert "wrong pictures hardly show" in status.overexposed
    assert "a darker setting" in status.overexposed
    assert [record.getMessage() for record in caplog.records].count(status.overexposed) == 1
    before = [each.shot for each in seen if not each.overexposed and each.shot is not None]
    assert before[-1].role == "white", "it is told at once"
    darker = plan.model_copy(update={"settings": (Setting(exposure_ms=1000 / 6, level=0.2),)})
    assert scan(rig, darker, tmp_path / "b.dsl").overexposed == ""


def test_exposures_that_were_matched_to_the_scene_are_not_called_too_long(tmp_path, caplog) -> None:  # type: ignore[no-untyped-def]
    """They let white saturate as far as lines, which have less light, do not."""
    rig = open_twin({"size": "48x32", "scene": "plane", "depth_mm": "742.1"})
    plan = CapturePlan(
        code=GrayCode(rows=False),
        spectral=ScanLines(width_px=40, step_px=40),
        settings=(Setting(exposure_ms=1000 / 3, level=0.4),),
        code_settings=(0,),
    ).sized(rig.camera.info, rig.projector.info)
    found = meter(rig, plan)
    assert "exposures are shortened" in found.sentence
    with caplog.at_level(logging.WARNING):
        assert scan(rig, found.plan, tmp_path / "a.dsl", notes=found.notes).overexposed == ""
    assert "overexposed" not in caplog.text
    assert "White is overexposed in" in scan(rig, found.plan, tmp_path / "b.dsl").overexposed
