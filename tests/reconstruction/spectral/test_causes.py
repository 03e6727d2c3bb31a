"""What all probed pixels ask of the model together: a shift over the picture, gains and a drift."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from dsl_core.reconstruction.spectral.causes import MOST_SHIFT_PX, Causes, common_error, fit_causes
from dsl_core.reconstruction.spectral.probing.line_probe import LineProbe
from dsl_core.reconstruction.spectral.probing.probe import Probe
from dsl_core.reconstruction.spectral.probing.probed_light import PARAMETERS

INFORMATION = 1e6
#: Terms of the shifts in 1, x, y, x², xy and y², then what is the same everywhere.
PLUS, MINUS = np.array([0.1, 0.02, -0.03, 0.04, 0.05, -0.06]), np.array([-0.2, 0.0, 0.03, 0.02, 0.0, 0.01])
REST = {"gain +1": 0.03, "gain -1": -0.02, "blur": 0.01, "tail": 0.002, "drift": 0.04}


def probe_of(noise: float = 0.0) -> Probe:
    rng = np.random.default_rng(2)
    cell = np.repeat(np.arange(48), 8)
    place = rng.uniform(-1, 1, (len(cell), 2))
    y, x = place.T
    terms = np.stack([np.ones_like(x), x, y, x * x, x * y, y * y], 1)
    count, p = len(cell), len(PARAMETERS)
    wanted = np.zeros((count, p))
    wanted[:, 0], wanted[:, 1] = terms @ PLUS, terms @ MINUS
    for name, value in REST.items():
        wanted[:, PARAMETERS.index(name)] = value
    wanted[:, :7] += noise * rng.standard_normal((count, 7))
    return Probe(
        normal=np.broadcast_to(INFORMATION * np.eye(p), (count, p, p)).copy(), score=INFORMATION * wanted,
        bias=np.zeros((count, 1, p)), reflectance=np.ones((count, 1)), chi_square=np.ones(count),
        correlation=np.ones(count), place=place, cell=cell, pixel=np.arange(count),
        lines=LineProbe(np.eye(2)[None], np.zeros((1, 2)), np.ones(1)), nm_per_px=2.0,
    )  # fmt: skip


def test_shifts_gains_and_drift_are_found_at_once() -> None:
    probe = probe_of()
    found = fit_causes(probe)
    assert found.shift_px == pytest.approx(probe.score[:, :2] / INFORMATION, abs=1e-4)
    assert found.gain == pytest.approx([0.03, -0.02], abs=1e-5)
    assert found.drift == pytest.approx(0.04, abs=1e-5)
    assert found.rms_px == pytest.approx(np.sqrt(np.mean(found.shift_px**2)), rel=1e-3)


def test_deviations_are_those_of_independent_pixels() -> None:
    found = fit_causes(probe_of())
    one = 1 / np.sqrt(384 * INFORMATION)
    assert found.drift_std == pytest.approx(one, rel=1e-3)
    assert found.common_std == pytest.approx(one / np.sqrt(2), rel=1e-3)
    assert found.difference_std == pytest.approx(one * np.sqrt(2), rel=1e-3)
    # Six terms an order, spread over the pixels.
    noise = 6 / (384 * INFORMATION)
    assert found.rms_std_px == pytest.approx(np.sqrt(noise / 12), rel=1e-3)


def test_where_an_order_is_not_seen_its_shift_is_no_news() -> None:
    probe = probe_of()
    x = probe.place[:, 1]
    left = x < 0
    probe.score[:, :2] = 0.0
    probe.score[left, 0] = INFORMATION * 0.2 * (x[left] + 0.5)
    probe.normal[~left, 0, 0] = 0.0
    found = fit_causes(probe)
    assert found.shift_px[x > 0.9, 0].min() > 0.27
    assert found.mean_px == pytest.approx([0.0, 0.0], abs=0.01)
    # A third of what the pixels say is of this order.
    assert found.rms_px == pytest.approx(np.sqrt(0.2**2 / 12 / 3), rel=0.1)


@pytest.mark.parametrize(("chi_square", "believed"), [(1.2, True), (400.0, True), (1e6, False)])
def test_what_explains_little_of_what_frames_lack_is_no_cause(chi_square: float, believed: bool) -> None:
    """Light from surface to surface asks for gains and shifts, and leaves frames as unlike the model."""
    many = len(probe_of().chi_square)
    asks = replace(probe_of(), chi_square=np.full(many, chi_square), freedom=np.full(many, 2.0))
    asks.score[:, 2] += 0.06 * INFORMATION
    found = fit_causes(asks)
    assert (found.displaced, found.drifts) == (believed, believed)
    assert (found.brighter, found.unequal) == (believed, believed)


def test_a_shift_that_a_few_cells_ask_for_explains_no_others() -> None:
    assert fit_causes(probe_of()).displaced
    few = probe_of()
    few.score[:] = 0.0
    odd = np.isin(few.cell, [29, 30])
    few.score[odd, 1] = 2.0 * INFORMATION
    found = fit_causes(few)
    assert found.rms_px > 3 * found.rms_std_px
    assert found.rms_px > MOST_SHIFT_PX
    assert not found.displaced


def test_noise_alone_is_no_shift() -> None:
    probe = probe_of()
    probe.score[:] = 0.0
    assert fit_causes(probe).rms_px == 0.0
    small = probe_of()
    small.score[:] *= 1e-3
    small.normal[:] *= 1e-3 * np.eye(len(PARAMETERS))
    noise, found = 6 / (384 * INFORMATION * 1e-3), fit_causes(small)
    square = np.mean(found.shift_px**2)
    assert found.rms_px == pytest.approx(np.sqrt(square - noise), rel=1e-3)


def alike(drift: float, difference: float) -> Probe:
    """What asks for these, of a scan to which gains look much as a drift of their difference."""
    probe = probe_of()
    plus, minus, over = (PARAMETERS.index(name) for name in ("gain +1", "gain -1", "drift"))
    seen = np.zeros((2, len(PARAMETERS)))
    seen[0, [plus, minus, over]], seen[1, over] = (1.0, -1.0, 1.0), 0.1
    own = np.ones(len(PARAMETERS))
    own[[plus, minus, over]] = 1e-4
    normal = INFORMATION * (seen.T @ seen + np.diag(own))
    asked = np.zeros(len(PARAMETERS))
    asked[[plus, minus, over]] = 0.5 * difference, -0.5 * difference, drift
    return replace(
        probe,
        normal=np.broadcast_to(normal, probe.normal.shape).copy(),
        score=np.broadcast_to(normal @ asked, probe.score.shape).copy(),
    )


def test_neither_drift_nor_gains_are_told_that_make_up_for_each_other() -> None:
    both = fit_causes(alike(-0.13, 0.13))
    assert both.drift == pytest.approx(-0.13, rel=0.05)
    assert abs(both.drift) > 5 * both.drift_std
    assert abs(both.drift_alone[0]) < 0.01
    assert not both.drifts
    assert not both.unequal
    assert fit_causes(alike(-0.13, 0.0)).drifts
    assert not fit_causes(alike(-0.13, 0.0)).unequal
    assert fit_causes(alike(0.0, 0.1)).unequal
    assert not fit_causes(alike(0.0, 0.1)).drifts


CAUSES = Causes(
    np.zeros((1, 2)), np.zeros(2), 0.0, 0.0, False, np.array([0.02, -0.01]), 0.001, 0.002, 0.015, 0.001,
    drift_alone=(0.015, 0.001), difference_alone=(0.03, 0.001),
)  # fmt: skip


def test_changes_count_from_what_matters_on() -> None:
    assert CAUSES.drifts
    assert not replace(CAUSES, drift=-0.0139).drifts
    # More than doubled light is no drift: white that is taken again would show it.
    assert not replace(CAUSES, drift=1.17).drifts
    assert not replace(CAUSES, drift_std=0.01).drifts
    assert not replace(CAUSES, drift_alone=(0.015, 0.01)).drifts
    assert CAUSES.unequal
    assert not replace(CAUSES, gain=np.array([0.03, 0.0151])).unequal
    assert not replace(CAUSES, difference_std=0.05).unequal
    assert not replace(CAUSES, difference_alone=(0.01, 0.001)).unequal


def test_each_cause_must_explain_by_itself_what_frames_lack() -> None:
    """The shares are those of the shifts, mean and difference of the gains, drift, and second orders."""
    believed = []
    for a, b, c, d, e in np.eye(5).tolist():
        only = replace(CAUSES, second=(0.04, 0.002), explained=(a, b, c, d, e))
        believed.append((only.brighter, only.unequal, only.drifts, only.seconds_differ))
    assert np.array_equal(believed, np.eye(5, dtype=bool)[:, 1:])


@pytest.mark.parametrize(
    ("gain", "common"),
    [((0.02, 0.01), 0.01), ((-0.02, -0.05), -0.02), ((0.02, -0.01), 0.0), ((0.02, 0.0), 0.0)],
)
def test_orders_share_the_smaller_gain_of_one_sign(gain: tuple[float, float], common: float) -> None:
    assert replace(CAUSES, gain=np.array(gain)).common_gain == common


def test_curves_and_drift_add_to_what_no_pixel_sees() -> None:
    def probe(curves: Any) -> Any:
        return SimpleNamespace(sideways=None, curves=curves)

    seen, chance, small = ((0.016, 0.001), (0.016, 0.02), (0.014, 0.001))
    drift = 0.015 / np.sqrt(3)
    for (rms, std), share in ((seen, 0.016), (chance, 0.0), (small, 0.0)):
        found = common_error(probe(SimpleNamespace(rms=0.0, whole_rms=rms, std=std)), CAUSES)
        assert found == pytest.approx(np.hypot(share, drift))
    assert common_error(probe(None), CAUSES) == pytest.approx(drift)
    assert common_error(probe(None), replace(CAUSES, drift=0.001)) == 0.0


def test_a_response_that_is_off_is_more_so_far_from_where_it_was_measured() -> None:
    probe: Any = SimpleNamespace(sideways=None, curves=None)
    quiet = replace(CAUSES, drift=0.0, gain=np.array([0.05, 0.04]), common_std=0.002)
    assert common_error(probe, quiet) == pytest.approx(2 * 0.04)
    assert common_error(probe, replace(quiet, gain=-quiet.gain)) == pytest.approx(2 * 0.04)
    # One order alone is no response; nor is chance, nor what explains little.
    assert common_error(probe, replace(quiet, gain=np.array([0.05, -0.04]))) == 0
    assert common_error(probe, replace(quiet, common_std=0.02)) == 0
    assert common_error(probe, replace(quiet, gain=np.array([0.014, 0.014]))) == 0
    assert common_error(probe, replace(quiet, explained=(1.0, 0.1, 1.0, 1.0, 1.0))) == 0


def test_of_one_order_nothing_is_asked_that_takes_two() -> None:
    """What noise asks of a drift or of an order that is not there made depth ten times as unsure."""
    probe = probe_of()
    minus = [PARAMETERS.index(name) for name in ("shift -1", "gain -1", "stretch -1")]
    normal, score = probe.normal.copy(), probe.score.copy()
    normal[:, minus], normal[:, :, minus], score[:, minus] = 0.0, 0.0, 0.0
    one = replace(probe, normal=normal, score=score)
    assert one.seen_orders.tolist() == [True, False]
    found = fit_causes(one)
    assert np.abs(found.shift_px[:, 1]).max() < 1e-6
    assert found.shift_px[:, 0] == pytest.approx(probe.score[:, 0] / INFORMATION, abs=1e-4)
    assert found.gain == pytest.approx([0.03, 0.03], abs=1e-4)
    assert not found.drifts
    assert not found.unequal
    assert probe.seen_orders.all()
