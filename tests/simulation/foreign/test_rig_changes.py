"""True rigs that their records do not describe: by how much, and only in what was asked."""

from __future__ import annotations

import numpy as np
import pytest

from dsl_core.model.rig import Rig
from dsl_core.optics.sensor import relative_gain
from dsl_core.simulation.foreign.rig_changes import (
    CORNER_LOSS,
    CURVE_SHARE,
    LED_SHARES,
    SECOND_SHARE,
    led_radiance,
    true_rig,
)
from dsl_core.simulation.foreign.variants import Foreign
from dsl_core.simulation.published_rig import published_rig
from dsl_core.simulation.random_rig import random_rig
from dsl_core.simulation.sim_devices import SimCamera, open_twin
from dsl_core.simulation.spot_light import spot_light

RIG = published_rig()
NM = np.arange(420.0, 681.0, 2.0)


def changed(*names: str, seed: int = 0, rig: Rig = RIG) -> Rig:
    return true_rig(rig, Foreign(frozenset(names), seed))


def test_curves_deviate_smoothly_by_five_percent() -> None:
    ours = changed("curves")
    for kind in ("response", "emission"):
        for mine, theirs in zip(getattr(ours, kind), getattr(RIG, kind), strict=True):
            known = np.array(theirs.values) > 0.01 * max(theirs.values)
            ratio = np.array(mine.values)[known] / np.array(theirs.values)[known] - 1
            assert 0.3 * CURVE_SHARE < np.abs(ratio).max() <= CURVE_SHARE + 1e-9
    assert changed("curves") == ours
    assert changed("curves", seed=1) != ours
    assert ours.camera == RIG.camera
    assert ours.flat_field is None


def test_red_begins_at_an_edge_and_the_rest_stays() -> None:
    ours, at_nm = changed("red-edge"), np.array([550.0, 570.6, 575.0, 579.4, 600.0])
    wavy, both = changed("curves"), changed("curves", "red-edge")
    for with_edge, without in ((ours, RIG), (both, wavy)):
        share = with_edge.response[0].at(at_nm) / without.response[0].at(at_nm)
        assert share == pytest.approx([0.002, 0.25, 0.5, 0.75, 1.0], abs=0.01)
        assert (with_edge.response[1:], with_edge.emission) == (without.response[1:], without.emission)


def test_second_orders_gain_a_share_of_the_first() -> None:
    ours = changed("second-order")
    for order in (1, -1):
        more = ours.efficiency[2 * order].at(NM) - RIG.efficiency[2 * order].at(NM)
        assert more == pytest.approx(SECOND_SHARE * RIG.efficiency[order].at(NM))
        assert ours.efficiency[order] == RIG.efficiency[order]


def test_corners_are_darker_also_beside_a_known_flat_field() -> None:
    gain = relative_gain(changed("vignetting"))
    assert float(gain.min()) == pytest.approx(1 - CORNER_LOSS, abs=1e-3)
    assert float(gain.max()) == pytest.approx(1, abs=1e-3)
    drawn = random_rig(1, RIG)
    both = relative_gain(changed("vignetting", rig=drawn)) / relative_gain(drawn)
    assert float(both.min()) == pytest.approx(1 - CORNER_LOSS, abs=3e-3)


def test_leds_leave_the_power_law_at_half_drive_and_keep_full_drive_and_black() -> None:
    response = RIG.projector_response
    levels = np.array([[0.0, 128 / 255, 1.0]])
    bent = led_radiance(response, levels, Foreign(frozenset({"response-curve"})))
    usual = led_radiance(response, levels, None)
    assert bent[:, [0, 2]] == pytest.approx(usual[:, [0, 2]])
    ratio = (bent[:, 1] - response.black_fraction) / (usual[:, 1] - response.black_fraction)
    assert ratio == pytest.approx(1 + np.array(LED_SHARES), abs=1e-4)


@pytest.mark.parametrize(("name", "half"), [("tone-s", 0.6577), ("tone-srgb", 0.2159)])
def test_other_tone_curves_start_at_black_end_at_full_and_pass_a_known_middle(name: str, half: float) -> None:
    response = RIG.projector_response
    light = led_radiance(response, np.array([[0.0, 128 / 255, 1.0]]), Foreign(frozenset({name})))
    black = response.black_fraction
    assert light[:, 0] == pytest.approx(black)
    assert (light[:, 1] - black) / (1 - black) == pytest.approx(half, abs=2e-4)
    assert light[:, 2] == pytest.approx(1.0)


def test_what_is_foreign_is_in_frames_and_measurements_and_not_in_the_calibration() -> None:
    usual, foreign = (
        open_twin({"size": "48x32", "foreign": text}) for text in ("", "vignetting,curves,second-order,blur")
    )
    assert foreign.calibration == usual.calibration
    assert isinstance(foreign.camera, SimCamera)
    assert isinstance(usual.camera, SimCamera)
    worlds = usual.camera.world, foreign.camera.world
    white = np.full((360, 640, 3), 255, np.uint8)
    for world in worlds:
        world.show(white)
    signal = [world.rate() - world.path.ambient_dn_per_ms for world in worlds]
    lit = signal[0] > 1
    # Two rows in, where the projector's frame does not end.
    lit[:2] = lit[-2:] = False
    ratio = signal[1][lit] / signal[0][lit]
    assert 0.85 < ratio.min() < 0.97
    light = [spot_light(world, (16, 24), NM) for world in worlds]
    assert 0.01 < np.abs(light[1] / light[0] - 1).max() < 0.08
