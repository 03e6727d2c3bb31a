"""The self-test of cameras of other kinds: monochrome ones, and those whose values end early or have gaps."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from dsl_core.calibration.selftest.record import analyse
from dsl_core.campaign.selftest.capture import SelfTestRun, load_capture, save_capture
from dsl_core.campaign.selftest.recipe import SelfTestRecipe
from dsl_core.errors import CalibrationError
from dsl_core.model.calibration.selftest import Measured, SelfTest
from dsl_core.model.figure import failures
from dsl_core.progress import NoProgress
from dsl_core.simulation.published_rig import published_rig
from tests.cases import light_rig as light_rig_module
from tests.cases.light_rig import PLAIN, SEEN, LightWorld, light_rig

RECIPE = SelfTestRecipe()


def record_of(world: LightWorld, folder: Path) -> SelfTest:
    """What the self-test finds from its archive."""
    save_capture(SelfTestRun(light_rig(world), NoProgress(), RECIPE.wanted_ms).capture(), folder)
    return analyse(load_capture(folder))


@pytest.fixture(scope="module")
def found(tmp_path_factory: pytest.TempPathFactory) -> SelfTest:
    return record_of(LightWorld(cycle_hz=60.0, jitter_ms=0.5), tmp_path_factory.mktemp("colour"))


@pytest.mark.parametrize(
    ("ends_dn", "known_dn", "expected"),
    [(4095, None, None), (4050, None, 4050), (3800, 3900, 3800), (4095, 3900, None), (None, 3900, 3900)],
    ids=["end of the scale", "early", "earlier than known", "later than known", "nothing clipped"],
)
def test_the_end_that_was_measured_is_the_rigs(
    found: SelfTest, ends_dn: int | None, known_dn: int | None, expected: int | None
) -> None:
    known = published_rig()
    known = known.model_copy(update={"sensor": known.sensor.model_copy(update={"saturation_dn": known_dn})})
    camera = found.camera.model_copy(update={"ends_dn": ends_dn})
    rig = RECIPE.apply(found.model_copy(update={"camera": camera}), known)
    assert found.camera.ends_dn == 4095
    assert rig.sensor.saturation_dn == expected


def test_the_steps_that_were_measured_are_the_rigs_and_no_part_of_its_noise(found: SelfTest) -> None:
    noise_dn = float(np.hypot(8.0, 15.97 / 12**0.5))
    update = {"step_dn": 16, "read_noise_dn": Measured(value=noise_dn, std=0.1)}
    camera = found.camera.model_copy(update=update)
    sensor = RECIPE.apply(found.model_copy(update={"camera": camera}), published_rig()).sensor
    assert sensor.step_dn == 16
    assert sensor.read_noise_dn == pytest.approx(8.0, abs=0.01)


@pytest.mark.slow
@pytest.mark.parametrize(("bits", "clip_dn", "step_dn"), [(12, 4050, 1), (12, 3800, 1), (16, 65520, 16)])
def test_a_camera_whose_values_end_early_is_described_as_it_is(
    tmp_path: Path, bits: int, clip_dn: int, step_dn: int
) -> None:
    world = LightWorld(cycle_hz=60.0, jitter_ms=0.5, bits=bits, clip_dn=clip_dn, step_dn=step_dn)
    sensor = RECIPE.apply(record_of(world, tmp_path), published_rig()).sensor
    assert (sensor.bit_depth, sensor.saturation_dn, sensor.step_dn) == (bits, clip_dn, step_dn)


def test_a_camera_that_exposes_briefly_is_asked_for_nothing_longer(tmp_path: Path) -> None:
    found = record_of(LightWorld(cycle_hz=60.0, jitter_ms=0.5, longest_ms=95.0), tmp_path)
    assert max(found.cycle.advised_ms) == pytest.approx(1000 / 60 * 5, rel=1e-3)
    assert all(beat.exposure_ms <= 95.0 for beat in found.cycle.beats)
    assert not failures(RECIPE.figures(found))


def test_a_camera_that_exposes_too_briefly_is_told_at_once() -> None:
    world = LightWorld(cycle_hz=60.0, jitter_ms=0.5, longest_ms=60.0)
    with pytest.raises(CalibrationError, match=r"exposes 60 ms at most; the self-test needs up to 83\.3 ms"):
        SelfTestRun(light_rig(world), NoProgress(), RECIPE.wanted_ms).capture()


def score(measured: Measured, truth: float) -> float:
    return (measured.value - truth) / measured.std


@pytest.fixture(scope="module")
def grey_seen(tmp_path_factory: pytest.TempPathFactory) -> SelfTest:
    world = LightWorld(cycle_hz=60.0, jitter_ms=0.5, monochrome=True)
    return record_of(world, tmp_path_factory.mktemp("monochrome"))


def test_a_monochrome_camera_passes_and_is_measured_within_its_uncertainty(grey_seen: SelfTest) -> None:
    camera, projector = grey_seen.camera, grey_seen.projector
    scores = {
        "black level": score(camera.black_level_dn, 260.0),
        "electrons per DN": score(camera.electrons_per_dn, 10.0),
        "read noise": score(camera.read_noise_dn, 1.0),
        "gamma": score(projector.gamma, 2.2),
        "black": score(projector.black_fraction, 0.0005),
    }
    assert {name: z for name, z in scores.items() if abs(z) > 3.5} == {}
    assert camera.is_monochrome
    assert failures(RECIPE.figures(grey_seen)) == ()
    assert RECIPE.apply(grey_seen, published_rig()).frame_period_ms == pytest.approx(1000 / 60, rel=1e-3)


def test_a_monochrome_camera_sees_the_beat_of_light_itself(grey_seen: SelfTest) -> None:
    cycle = grey_seen.cycle
    advised, others = (
        [each.ratio_percent.value for each in cycle.beats if cycle.is_advised(each.exposure_ms) is at_advised]
        for at_advised in (True, False)
    )
    assert max(advised) < 0.1
    assert min(others) > 5 * max(advised)


def test_a_small_target_is_refused_in_words_of_the_camera(monkeypatch: pytest.MonkeyPatch) -> None:
    for name, seen in (("SEEN", SEEN), ("PLAIN", PLAIN)):
        monkeypatch.setattr(light_rig_module, name, np.where(np.arange(seen.shape[2]) < 6, seen, 0.0))
    for monochrome, colours in ((True, ""), (False, " in red, green and blue")):
        with pytest.raises(CalibrationError, match=f"bright enough{colours} on too few pixels"):
            SelfTestRun(light_rig(LightWorld(monochrome=monochrome)), NoProgress(), (100.0,)).capture()
