"""The planner leaves out what it may and no more, says why, and the twin does as it says."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from dsl_core import pipeline
from dsl_core.devices.base import DeviceRig
from dsl_core.devices.guard import guarded
from dsl_core.errors import DeviceError
from dsl_core.io.scan.manifest import read_manifest
from dsl_core.model.plan import CapturePlan, GrayCode, NoSpectral, Setting
from dsl_core.model.projector.tone_curve import ToneCurve
from dsl_core.model.rendered_effects import RenderedEffects
from dsl_core.model.rig import FilmShape
from dsl_core.simulation.effects.base import Limits
from dsl_core.simulation.effects.catalogue import EXTRAS, NAMES, NEEDED, USUAL, Choice, with_effects
from dsl_core.simulation.effects.planner import EffectPlan, describe, plan_effects
from dsl_core.simulation.effects.tolerance import Tolerance
from dsl_core.simulation.rendered_scene import EffectRequest
from dsl_core.simulation.rendering.renderer import Renderer
from dsl_core.simulation.sim_devices import SimCamera, open_twin
from dsl_core.simulation.world import World
from tests.cases.effect_scenes import HEIGHT, WIDTH, world_of


@pytest.fixture(scope="module")
def plane() -> EffectPlan:
    return plan_effects(world_of("plane").everything())


@pytest.mark.parametrize("tolerance", ["0.01", "1 DN", "100DN", "3 sigma", "9000"])
def test_what_is_left_out_stays_below_the_tolerance(tolerance: str) -> None:
    plan = plan_effects(world_of("sphere gloss=1e-6").everything(), Tolerance.of(tolerance))
    assert plan.left_out_bound < plan.tolerance.value
    spare = plan.tolerance.value - plan.left_out_bound
    # Nothing else would have fitted.
    for decision in plan.decisions:
        if decision.on and not decision.effect.needed:
            assert plan.tolerance.of_bound(decision.bound) >= spare
    assert plan.names >= NEEDED


def test_more_tolerance_saves_more() -> None:
    path = world_of("box").everything()
    seconds = [plan_effects(path, Tolerance(value)).seconds for value in (0.01, 1.0, 5000.0)]
    rendered = [pair[0] for pair in seconds]
    assert rendered[0] >= rendered[1] > rendered[2]
    assert all(pair[0] <= pair[1] for pair in seconds)


def test_every_decision_is_told_in_a_sentence(plane: EffectPlan) -> None:
    assert [decision.effect.name for decision in plane.decisions] == list(NAMES)
    why = {decision.effect.name: decision.why for decision in plane.decisions}
    assert all(text[0].isupper() and text.endswith(".") for text in why.values())
    assert why["interreflection"] == "No surface in view faces another."
    assert "allowed" in why["ambient"]
    assert "more than 1 DN" in why["halo"]
    assert all(decision.effect.summary for decision in plane.decisions)


def test_the_cost_of_colours_is_counted_once(plane: EffectPlan) -> None:
    wax = plan_effects(world_of("wax").everything())
    both = wax.frame_s(USUAL | {"subsurface", "depth-of-field"})
    singly = [wax.frame_s(USUAL | {name}) for name in ("subsurface", "depth-of-field")]
    assert both < sum(singly)
    assert wax.frame_s(USUAL | {"subsurface"}) > 3 * 0.9 * wax.frame_s(USUAL)
    assert plane.frame_s(USUAL | {"interreflection"}) > plane.frame_s(USUAL) > plane.frame_s(NEEDED)


def test_sigmas_are_those_of_a_dark_pixel(plane: EffectPlan) -> None:
    ambient = next(decision.bound for decision in plane.decisions if decision.effect.name == "ambient")
    assert ambient.dn == pytest.approx(0.002 * 1000 / 3)
    assert ambient.sigmas == pytest.approx(ambient.dn / np.sqrt(1 + 1 / 12))


def test_a_darker_plan_allows_more_to_be_left_out() -> None:
    path = world_of("plane").everything()
    dark = (Setting(exposure_ms=1.0, level=0.02),)
    names = [plan_effects(path, settings=settings).names for settings in (dark, Limits(path).settings)]
    assert names[0] < names[1]


def test_texts_of_choices() -> None:
    assert Choice.of("all").names == frozenset(NAMES)
    assert Choice.of("none").names == NEEDED
    assert Choice.of("usual").names == frozenset(NAMES) - {extra.name for extra in EXTRAS}
    assert Choice.of("auto").names is None
    assert Choice.of("halo, glare").names == NEEDED | {"halo", "glare"}
    with pytest.raises(DeviceError, match=r"'hallo'.*second-orders"):
        Choice.of("hallo,glare")


@pytest.mark.parametrize("text", ["", "DN", "-1", "1 mm", "nan", "1e3"])
def test_bad_tolerances_are_refused(text: str) -> None:
    with pytest.raises(DeviceError, match=r"0\.5DN"):
        Tolerance.of(text)


@pytest.mark.parametrize("value", [1.0, 0.5, 1e-5, 0.1 + 0.2, 12345678.0])
def test_a_tolerance_is_read_as_it_is_written(value: float) -> None:
    for tolerance in (Tolerance(value), Tolerance(value, "sigma")):
        assert Tolerance.of(str(tolerance)) == tolerance


def world_in(rig: DeviceRig) -> World:
    assert isinstance(rig.camera, SimCamera)
    return rig.camera.world


def test_the_twin_renders_what_it_is_asked_to() -> None:
    options = {"size": "64x42", "scene": "plane"}
    usual = open_twin(options)
    assert usual.expect is None
    assert isinstance(world_in(usual).renderer, Renderer)
    auto = open_twin({**options, "effects": "auto", "tolerance": "0.5sigma"})
    plan = world_in(auto).effect_plan()
    assert str(plan.tolerance) == "0.5 sigma"
    assert {extra.name for extra in world_in(auto).path.extras} == plan.names - USUAL
    none = open_twin({**options, "effects": "none"})
    path = world_in(none).path
    assert path.orders == (1, -1)
    assert path.extras == ()
    assert path.rig.sensor.read_noise_dn == 0
    with pytest.raises(DeviceError, match="no effect"):
        open_twin({**options, "effects": "sparkle"})


def test_a_scan_notes_the_effects_that_its_own_settings_call_for(tmp_path: Path) -> None:
    twin = open_twin({"size": "64x48", "scene": "plane", "effects": "auto"})
    devices = guarded(twin, None)
    bright = (Setting(exposure_ms=3000.0, level=0.8),)
    made = CapturePlan(code=GrayCode(rows=False), spectral=NoSpectral(), settings=bright, code_settings=(0,))
    plan = pipeline.fit_plan(made, devices)
    with pipeline.open_scan(devices, plan, tmp_path / "s.dsl", notes=dict(devices.notes)):
        devices.projector.show(np.full((360, 640, 3), 204, np.uint8))
        devices.camera.configure(3000.0)
        devices.camera.snap()
    rendered = world_in(twin).effect_plan()
    note = RenderedEffects.of_note(read_manifest(tmp_path / "s.dsl").notes["effects"])
    assert note == describe(rendered, "auto")
    assert "ambient" in rendered.names


def test_leaving_out_everything_ends_in_an_ideal_rig() -> None:
    world = world_of("sphere")
    everything = world.everything().with_value("rig.film.shape", FilmShape())
    curve = ToneCurve(coefficients=(2.0, 0.1), lowest_level=0.1)
    path = with_effects(everything.with_value("rig.projector_response.tone", curve), NEEDED)
    rig = path.rig
    assert rig.film.shape is None
    assert not any(rig.camera.distortion + rig.projector.distortion)
    assert rig.film.bend_per_mm == rig.film.tilt_x_deg == rig.film.roll_deg == 0
    assert rig.projector_response.gamma == 1
    assert rig.projector_response.tone is None
    assert rig.projector_response.halo_peak_per_px == rig.projector_response.black_fraction == 0
    assert path.truth.lit.all()
    # What is true of the scene stays true.
    assert world.rig.camera.distortion != rig.camera.distortion


def test_a_moved_stage_and_a_brighter_exposure_are_decided_again() -> None:
    world = world_of("plane", request=EffectRequest(Choice.of("auto")), noise=False)
    world.scene_at = lambda position_mm: world_of("box" if position_mm > 750 else "plane").scene
    assert world.path.extra("interreflection") is None
    world.position_mm = 760.0
    assert world.path.extra("interreflection") is not None
    world.position_mm = 740.0
    assert world.path.ambient_dn_per_ms == 0
    world.show(np.zeros((HEIGHT, WIDTH), np.uint8))
    world.expose(300.0, 0)
    assert world.path.ambient_dn_per_ms == 0
    world.expose(2000.0, 1)
    assert world.path.ambient_dn_per_ms > 0
    assert world.request.settings[-1].exposure_ms == 2000.0
