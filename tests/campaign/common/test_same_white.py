"""White of a scan is held against the test shot before it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from dsl_core.campaign.common.recipe import Bench, Step
from dsl_core.campaign.common.same_white import (
    NOTE_NAME,
    OTHER_LEVEL,
    SAME_LEVEL,
    keep_white,
    require_same_white,
)
from dsl_core.campaign.common.white_shot import WhiteLevel
from dsl_core.errors import CalibrationError
from dsl_core.model.placement import Placement
from dsl_core.model.plan import CapturePlan, GrayCode, NoCode, ScanLines, Setting, Shot
from tests.cases.small_rig import small_rig

STEP = Step("it", "It", "Do it.", Placement(target="spectralon"))
RATE = 0.6  # DN per ms at full drive
RIG = small_rig()


class Scanned(Bench):
    """A bench whose scan shows white of a brightness, for ``factor`` times the exposure."""

    factor = 1.0
    level = 1.0
    code: GrayCode | NoCode = GrayCode(rows=False)
    #: Light of the room's lamps beside that in black, DN, which beats from picture to picture.
    lamps_dn = 0.0
    #: How far the camera is turned about its axis, degrees.
    roll_deg = 0.0

    def scan_of(self, step: Step) -> Any:
        return self

    @property
    def plan(self) -> CapturePlan:
        return CapturePlan(
            code=self.code,
            spectral=ScanLines(width_px=5, step_px=5),
            settings=(Setting(exposure_ms=200.0, level=self.level),),
            code_settings=(0,),
        )

    def read(self, shot: Shot) -> np.ndarray:
        response = RIG.projector_response
        light = float(response.radiance(self.level) - response.radiance(0.0))
        # Lines that tile the frame are white together.
        share = {"white": 1.0, "spectral": 1 / self.plan.spectral_count}.get(shot.role, 0.0)
        more = RATE * 200.0 * light * self.factor * share
        beat = np.sin(1.1 * shot.index + 1.5) if shot.role == "spectral" else 1.0
        lit = _line(self.roll_deg, shot.index % 16) if shot.role == "spectral" else 1.0
        return _dithered(RIG.sensor.black_level_dn + more * lit + 1 + beat * self.lamps_dn)


def _line(roll_deg: float, index: int) -> np.ndarray:
    """Light of one of 16 lines that tile a turned picture, 1 for all together, brightest in the middle."""
    y, x = np.mgrid[:60, :80]
    across = x * np.cos(np.radians(roll_deg)) + y * np.sin(np.radians(roll_deg))
    place = np.argsort(np.argsort(across, None, kind="stable")).reshape(60, 80)
    fall_off = 1 + 0.3 * np.cos(2 * np.pi * (index - 7.5) / 16)
    return np.where(place // 300 == index, 16.0 * fall_off, 0.0)


def _dithered(mean: float | np.ndarray) -> np.ndarray:
    """Whole numbers with this mean all over the picture, as noise of a camera makes them, (60, 80)."""
    steps = np.random.default_rng(0).permutation(np.linspace(0, 1, 4800, endpoint=False))
    return np.floor(mean + steps.reshape(60, 80)).astype(np.uint16)


@pytest.fixture
def bench(tmp_path: Path) -> Scanned:
    devices: Any = SimpleNamespace(nominal=RIG, calibration=None)
    made = Scanned(devices, tmp_path, RIG)
    made.step_folder(STEP).mkdir()
    keep_white(made, STEP, shot())
    return made


def shot(level: float = 1.0, saturated: bool = False) -> WhiteLevel:
    return WhiteLevel(RATE, np.full(3, RATE), 0.0, saturated, np.full((6, 8), RATE), level)


def seen(bench: Scanned, factor: float, level: float = 1.0) -> Scanned:
    """The bench with white of another brightness or level."""
    Scanned.factor, Scanned.level = factor, level
    return replace(bench)


@pytest.fixture(autouse=True)
def as_it_was(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Scanned, "factor", 1.0)
    monkeypatch.setattr(Scanned, "level", 1.0)
    monkeypatch.setattr(Scanned, "code", GrayCode(rows=False))
    monkeypatch.setattr(Scanned, "lamps_dn", 0.0)
    monkeypatch.setattr(Scanned, "roll_deg", 0.0)


def test_white_of_the_same_light_is_accepted(bench: Scanned) -> None:
    for level in (1.0, 0.5):
        require_same_white(seen(bench, 1.0, level), STEP)


@pytest.mark.parametrize("code", [GrayCode(rows=False), NoCode()])
@pytest.mark.parametrize("level", [1.0, 0.6])
def test_another_exposure_than_the_one_requested_is_told(
    bench: Scanned, level: float, code: GrayCode | NoCode, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Scanned, "code", code)
    allowed = SAME_LEVEL if level == 1.0 else OTHER_LEVEL
    for factor in (1 - 0.8 * allowed, 1 + 0.8 * allowed):
        require_same_white(seen(bench, factor, level), STEP)
    for factor in (1 - 1.2 * allowed, 1 + 1.2 * allowed):
        with pytest.raises(CalibrationError, match=rf"It: white of the scan has {factor:.2f} times"):
            require_same_white(seen(bench, factor, level), STEP)


@pytest.mark.parametrize("roll_deg", [-90.0, 20.0, 45.0, 90.0, 180.0])
def test_a_camera_may_be_turned_about_its_axis(bench: Scanned, roll_deg: float) -> None:
    Scanned.code, Scanned.roll_deg = NoCode(), roll_deg
    require_same_white(seen(bench, 1.0), STEP)
    with pytest.raises(CalibrationError, match=r"has 0\.8[0-9] times"):
        require_same_white(seen(bench, 0.85), STEP)


@pytest.mark.parametrize("factor", [1.0, 0.83, 1.17])
def test_lamps_that_flicker_do_not_decide(bench: Scanned, factor: float) -> None:
    # One black picture of lamps at their brightest is taken off all lines: a fifth of their light.
    Scanned.code, Scanned.lamps_dn = NoCode(), 0.2 * RATE * 200.0 / bench.plan.spectral_count
    here = seen(bench, factor)
    if factor == 1.0:
        require_same_white(here, STEP)
    else:
        with pytest.raises(CalibrationError, match=rf"has {factor - 0.01:.2f}|has {factor:.2f}"):
            require_same_white(here, STEP)


@pytest.mark.parametrize("seed", range(4))
def test_noise_of_a_faint_filter_is_no_other_exposure(
    bench: Scanned, monkeypatch: pytest.MonkeyPatch, seed: int
) -> None:
    """Lines of a third of a DN under noise of 2.5 DN, all against one picture of black."""
    rng, read = np.random.default_rng(seed), Scanned.read
    monkeypatch.setattr(Scanned, "code", NoCode())

    def noisy(self: Scanned, shot: Shot) -> np.ndarray:
        seen = read(self, shot) + 20.0 + 2.5 * rng.standard_normal((60, 80))
        return np.asarray(np.rint(seen), np.uint16)

    monkeypatch.setattr(Scanned, "read", noisy)
    faint = WhiteLevel(RATE, np.full(3, RATE), 0.0, False, np.full((6, 8), 0.3 * RATE), 1.0)
    keep_white(bench, STEP, faint)
    require_same_white(seen(bench, 0.3), STEP)
    with pytest.raises(CalibrationError, match=r"white of the scan has [12]\.[0-9]+ times"):
        require_same_white(seen(bench, 0.6), STEP)


def test_a_room_lit_for_good_after_black_is_told(bench: Scanned, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Scanned, "code", NoCode())
    read = Scanned.read

    def lit(self: Scanned, shot: Shot) -> np.ndarray:
        return read(self, shot) + np.uint16(shot.role == "spectral")

    monkeypatch.setattr(Scanned, "read", lit)
    more = bench.plan.spectral_count / (RATE * 200.0)
    assert more > SAME_LEVEL
    with pytest.raises(CalibrationError, match=rf"has {1 + more:.2f} times"):
        require_same_white(seen(bench, 1.0), STEP)


def test_levels_are_known_after_the_self_test(bench: Scanned) -> None:
    other = RIG.projector_response.model_copy(update={"gamma": RIG.projector_response.gamma + 0.1})
    bench.devices.nominal = RIG.model_copy(update={"projector_response": other})
    with pytest.raises(CalibrationError, match=r"has 0\.80 times"):
        require_same_white(seen(bench, 0.8, 0.6), STEP)


def test_nothing_is_said_without_a_test_shot_that_was_not_saturated(bench: Scanned) -> None:
    (bench.step_folder(STEP) / NOTE_NAME).unlink()
    keep_white(bench, STEP, shot(saturated=True))
    require_same_white(seen(bench, 0.1), STEP)
