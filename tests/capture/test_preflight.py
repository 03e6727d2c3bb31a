"""Exposures that nobody chose suit the projector; chosen ones stay."""

from __future__ import annotations

from dataclasses import replace

import pytest

from dsl_core.api import scans as api
from dsl_core.capture.preflight import find_obstacles, find_remarks, fit_plan
from dsl_core.devices.base import DeviceRig
from dsl_core.devices.registry import open_rig
from dsl_core.model.plan import CapturePlan, LineComb, Setting
from dsl_core.model.presets import PRESETS, preset_plan
from dsl_core.model.rig import Rig
from dsl_core.planning.choice import pattern_sets
from dsl_core.simulation import sim_devices
from dsl_core.simulation.published_rig import published_rig

TWIN = {"size": "160x104", "scene": "plane"}


@pytest.mark.parametrize(("rate_hz", "cycles"), [(60.0, [10, 20]), (50.0, [8, 17])])
def test_default_exposures_are_whole_colour_cycles(rate_hz: float, cycles: list[int]) -> None:
    chosen = CapturePlan(settings=(Setting(exposure_ms=25.0, level=0.5),), code_settings=(0,))
    with open_rig("twin", {**TWIN, "led_cycle_hz": str(rate_hz)}) as rig:
        fitted = fit_plan(CapturePlan(), rig)
        assert [s.exposure_ms * rate_hz / 1000 for s in fitted.settings] == pytest.approx(cycles)
        assert fit_plan(chosen, rig).settings == chosen.settings
    if rate_hz == 60:
        assert fitted.settings == CapturePlan().settings


@pytest.mark.parametrize("rate_hz", [50.0, 59.94, 120.0])
def test_exposures_of_every_preset_are_whole_cycles_of_any_projector(rate_hz: float) -> None:
    with open_rig("twin", {**TWIN, "led_cycle_hz": str(rate_hz)}) as rig:
        for preset in PRESETS:
            for setting in fit_plan(preset.plan, rig).settings:
                cycles = setting.exposure_ms * rate_hz / 1000
                assert cycles == pytest.approx(round(cycles)), preset.key


def test_sizes_and_exposures_that_do_not_fit_are_obstacles(rig: DeviceRig, plan: CapturePlan) -> None:
    assert find_obstacles(rig, plan) == []
    large = plan.model_copy(
        update={
            "camera_size_px": (24, 18),
            "projector_size_px": (30, 18),
            "settings": tuple(Setting(exposure_ms=ms, level=0.5) for ms in (0.9, 1.0, 100.0, 101.0)),
        }
    )
    assert find_obstacles(rig, large) == [
        "the plan is for a camera of 24 x 18 pixels, this one has 24 x 16"
        " (make the plan with this camera's size)",
        "the plan is for a projector of 30 x 18 pixels, this one has 32 x 18"
        " (make the plan with this projector's size)",
        "setting 0 exposes for 0.9 ms, but the camera supports 1 to 100 ms",
        "setting 3 exposes for 101 ms, but the camera supports 1 to 100 ms",
    ]


def test_a_calibration_of_other_devices_is_an_obstacle(rig: DeviceRig, plan: CapturePlan) -> None:
    published = published_rig()
    known = published.model_copy(
        update={"camera": published.camera.resized(24, 15), "projector": published.projector.resized(32, 17)}
    )
    known = known.model_copy(update={"sensor": published.sensor.model_copy(update={"bit_depth": 10})})
    camera, projector, mosaic = find_obstacles(replace(rig, calibration=known), plan)[:3]
    assert camera.startswith("the calibration is for a camera of 24 x 15 pixels, this one has 24 x 16 (")
    assert projector.startswith("the calibration is for a projector of 32 x 17 pixels,")
    assert "this one has 32 x 18 (" in projector
    assert mosaic.startswith(
        "the calibration is for a RGGB mosaic of 10 bits, the camera delivers RGGB of 12"
    )


@pytest.mark.parametrize(
    ("lines_per_mm", "told"), [(300.0, False), (480.0, False), (600.0, False), (1000.0, True)]
)
def test_a_film_whose_orders_miss_the_frame_is_told_before_the_scan(lines_per_mm: float, told: bool) -> None:
    rig = published_rig()
    film = rig.film.model_copy(update={"lines_per_mm": lines_per_mm})
    remarks = find_remarks(rig.model_copy(update={"film": film}))
    assert ["No first order reaches 84% of the bands" in each for each in remarks] == [True] * told


def test_combs_of_presets_suit_the_columns_of_the_projector(monkeypatch: pytest.MonkeyPatch) -> None:
    def wide() -> Rig:
        rig = published_rig()
        return rig.model_copy(update={"projector": rig.projector.resized(1280, 720)})

    plan = preset_plan("comb")
    assert plan is not None
    monkeypatch.setattr(sim_devices, "published_rig", wide)
    with open_rig("twin", TWIN) as rig:
        assert fit_plan(plan, rig).spectral == LineComb(width_px=10, step_px=4, period_px=160)
        assert fit_plan(fit_plan(plan, rig), rig) == fit_plan(plan, rig)
        assert fit_plan(plan, rig, keeps_patterns=True).spectral == plan.spectral
        assert api.plan(rig, "comb").spectral == fit_plan(plan, rig).spectral
        assert api.plan(rig, spectral=plan.spectral).spectral == plan.spectral
        names = pattern_sets(wide())
    assert "comb 10x4x160" in names
    assert "comb 5x2x80" not in names
