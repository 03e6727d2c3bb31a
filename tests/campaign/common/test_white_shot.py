"""A test shot of white: what it measures, and the exposures that suit it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from dsl_core.campaign.common.recipe import Bench
from dsl_core.campaign.common.white_shot import (
    FILL,
    LONGEST_MS,
    FilterNote,
    WhiteLevel,
    bracket,
    bright_setting,
    film_light,
    note_of_filter,
    require_filter,
    require_width,
    shoot_white,
)
from dsl_core.devices.base import Camera, CameraInfo
from dsl_core.errors import CalibrationError, DeviceError
from dsl_core.model.figure import failures
from dsl_core.model.frames import Frame
from dsl_core.model.placement import Placement
from dsl_core.model.rig import Rig
from dsl_core.model.spectral import SpectralCurve
from dsl_core.optics.filters import FINE_NM, nominal_filter, passed
from dsl_core.optics.spectra import chain_response
from tests.cases.film_bench import film_bench, place
from tests.cases.small_rig import small_rig

RIG = small_rig()
RANGE_DN = RIG.sensor.full_scale_dn - RIG.sensor.black_level_dn


@pytest.fixture(scope="module")
def bench() -> Bench:
    found = film_bench(Path(), 4, ("camera", "projector", "pose", "emission", "sensor", "flat_field"))
    place(found, Placement(target="spectralon", film=True))
    return found


def white(cycles: float, ambient: float = 0.0) -> WhiteLevel:
    """White that fills the range in so many LED cycles."""
    rate = RANGE_DN / (cycles * RIG.frame_period_ms)
    return WhiteLevel(rate, np.full(3, rate), ambient, False)


def light_of(rig: Rig, level: float) -> float:
    return float(rig.projector_response.radiance(level) - rig.projector_response.radiance(0.0))


def test_the_projector_alone_waits_for_its_latency(bench: Bench) -> None:
    waits: list[float] = []
    shot = shoot_white(replace(bench, devices=replace(bench.devices, sleep=waits.append)))
    assert waits == []
    assert shot.brightest > shot.mean.max() > 0
    assert not shot.saturated
    assert not failures(film_light(shot, bench.rig))


class Brighter(Camera):
    """Adds a constant to every picture, and light of the room, DN per ms, to what it lights meanwhile."""

    def __init__(self, camera: Camera, constant_dn: float = 0.0, room_dn_per_ms: float = 0.0) -> None:
        self.camera, self.constant_dn, self.room = camera, constant_dn, room_dn_per_ms

    @property
    def info(self) -> CameraInfo:
        return self.camera.info

    def configure(self, exposure_ms: float) -> float:
        self.exposure_ms = self.camera.configure(exposure_ms)
        return self.exposure_ms

    def snap(self, timeout_ms: float = 5000.0) -> Frame:
        frame = self.camera.snap(timeout_ms)
        added = self.constant_dn + self.room * self.exposure_ms
        return replace(frame, pixels=np.minimum(frame.pixels + added, 4095).astype(np.uint16))


def test_a_black_level_that_no_data_sheet_states_is_no_light_of_the_room(bench: Bench) -> None:
    place(bench, Placement(target="spectralon", film=True))

    def seen(**more: float) -> WhiteLevel:
        camera = Brighter(bench.devices.camera, **more)
        return shoot_white(replace(bench, devices=replace(bench.devices, camera=camera)))

    dark, high = seen(), seen(constant_dn=1000.0)
    assert high.ambient == pytest.approx(dark.ambient, abs=0.01)
    assert not failures(film_light(high, bench.rig))
    lit = seen(room_dn_per_ms=0.3 * dark.brightest)
    (told,) = failures(film_light(lit, bench.rig))
    assert told.name == "ambient light"


def test_a_monochrome_camera_has_the_mean_of_its_one_colour(bench: Bench) -> None:
    place(bench, Placement(target="spectralon", film=True))
    sensor = bench.rig.sensor.model_copy(update={"bayer": "MONO"})
    shot = shoot_white(replace(bench, rig=bench.rig.model_copy(update={"sensor": sensor})))
    assert shot.mean == pytest.approx([0.0, shot.picture.mean(), 0.0])


def test_another_filter_and_none_are_refused(bench: Bench) -> None:
    place(bench, Placement(target="spectralon", film=True))
    open_white = shoot_white(bench)
    place(bench, Placement(target="spectralon", film=True, filter_nm=600.0))
    note, seen = note_of_filter(bench.devices, 600.0), shoot_white(bench)
    require_filter(bench.rig, seen, note, "Red", open_white.brightest)
    with pytest.raises(CalibrationError, match="Red: the picture is about as bright as without a filter"):
        require_filter(bench.rig, open_white, note, "Red", open_white.brightest)
    other = note_of_filter(bench.devices, 450.0)
    with pytest.raises(CalibrationError, match=r"Blue: the colours are those of a filter of about \d+ nm"):
        require_filter(bench.rig, seen, other, "Blue", open_white.brightest)


def test_a_broad_filter_is_none_that_is_missing(bench: Bench) -> None:
    """As far as its width is known, and where it is not, up to half of white."""
    rig, curve = bench.rig, nominal_filter(450.0, 25.0, 0.9)
    share = passed(rig, curve).sum(1).max() / chain_response(rig, 0, FINE_NM).sum((1, 2)).max()
    assert share > 0.33
    assumed = note_of_filter(replace(bench.devices, filters={}), 450.0)
    for note in (assumed, FilterNote(filter_nm=450.0, transmission=curve, measured=True)):
        require_filter(rig, through(rig, curve, share), note, "Blue", 1.0)
        for open_share in (0.75, 1.0):
            with pytest.raises(
                CalibrationError, match=r"without a filter: (0\.75|1\.00) times, where 0\.\d+"
            ):
                require_filter(rig, through(rig, curve, open_share), note, "Blue", 1.0)


def test_lasers_are_as_narrow_as_the_filter_before_them(bench: Bench) -> None:
    nm = np.arange(390.0, 711.0, 0.5)
    lasers = tuple(SpectralCurve.of(nm, np.exp(-(((nm - at) / 1.2) ** 2))) for at in (638.0, 525.0, 450.0))
    rig, note = bench.rig.model_copy(update={"emission": lasers}), note_of_filter(bench.devices, 450.0)
    share = passed(rig, note.transmission).sum(1).max() / chain_response(rig, 0, FINE_NM).sum((1, 2)).max()
    assert share > 0.5
    require_filter(rig, through(rig, note.transmission, share), note, "Blue", 1.0)
    with pytest.raises(CalibrationError, match=r"as bright as without a filter: 0\.95 times"):
        require_filter(rig, through(rig, note.transmission, 0.95), note, "Blue", 1.0)


def through(rig: Rig, transmission: SpectralCurve, share: float) -> WhiteLevel:
    """White through a filter, so many times as bright as one without."""
    mean = passed(rig, transmission).sum(1)
    return WhiteLevel(share, share * mean / mean.max(), 0.0, False)


def test_filters_that_nobody_measured_are_as_wide_as_stated(bench: Bench) -> None:
    devices = replace(bench.devices, filters={})
    assert note_of_filter(devices, 450.0).transmission == nominal_filter(450.0, 10.0)
    assert note_of_filter(devices, 450.0, 20.0).transmission == nominal_filter(450.0, 20.0)
    measured = replace(bench.devices, filters={450.0: nominal_filter(451.0, 9.0)})
    assert note_of_filter(measured, 450.0, 20.0).transmission == nominal_filter(451.0, 9.0)
    curve = nominal_filter(451.0, 9.0)
    percent = curve.model_copy(update={"values": tuple(100 * value for value in curve.values)})
    devices = replace(bench.devices, filters={450.0: percent})
    with pytest.raises(DeviceError, match=r"filter of 450 nm passes .* of the light; a share .* percent"):
        note_of_filter(devices, 450.0)
    require_width(2.0, "It")
    for fwhm_nm in (0.0, 1.9, 51.0):
        with pytest.raises(CalibrationError, match=rf"It: fwhm_nm={fwhm_nm:g} was given.*2 to 50 nm"):
            require_width(fwhm_nm, "It")


@pytest.mark.parametrize(("cycles", "expected"), [(10.0, 9), (1.2, 1), (1e4, None)])
def test_the_bright_setting_is_whole_cycles_at_full_drive(cycles: float, expected: int | None) -> None:
    found = bright_setting(RIG, white(cycles), "It")
    longest = int(LONGEST_MS / RIG.frame_period_ms)
    assert found.level == 1.0
    assert found.exposure_ms / RIG.frame_period_ms == pytest.approx(expected or longest)


def test_white_that_fills_one_cycle_is_dimmed(bench: Bench) -> None:
    found = bright_setting(RIG, white(0.6), "It")
    assert found.exposure_ms == pytest.approx(RIG.frame_period_ms)
    assert light_of(RIG, found.level) / 0.6 <= FILL < light_of(RIG, 1.0) / 0.6


def test_a_bracket_has_one_level_and_the_ratio_of_exposures() -> None:
    short, long = bracket(RIG, white(30.0), "It", 6.0)
    assert short.level == long.level == 1.0
    assert long.exposure_ms == pytest.approx(6 * short.exposure_ms)
    assert short.exposure_ms / RIG.frame_period_ms == pytest.approx(27)
    dimmed, _ = bracket(RIG, white(2.0), "It", 6.0)
    cycles = dimmed.exposure_ms / RIG.frame_period_ms
    assert cycles >= 6
    assert cycles * light_of(RIG, dimmed.level) / 2.0 <= FILL
    assert len(bracket(RIG, white(30.0), "It", 1.0)) == 1


def test_light_that_is_too_weak_or_not_the_projectors_is_told() -> None:
    with pytest.raises(CalibrationError, match="It is too dark: in 4 s white reaches"):
        bracket(RIG, white(1e5), "It", 6.0)
    assert [figure.name for figure in failures(film_light(white(10.0, 0.3), RIG))] == ["ambient light"]


def test_a_look_finds_too_dark_what_a_capture_would_refuse() -> None:
    for cycles in (10.0, 1e5):
        seen, _ = film_light(white(cycles), RIG)
        try:
            bracket(RIG, white(cycles), "It", 1.0)
        except CalibrationError:
            assert not seen.passed
        else:
            assert str(seen) == "brightness of white in up to 4 s 100 % of the camera's range"
    assert seen.limits == "at least 2 % of the camera's range"
