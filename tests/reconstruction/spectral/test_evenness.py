"""Light that falls to the sides of the projector's frame is found in the gains of both orders, and told."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from dsl_core.reconstruction.findings.model_findings import cause_findings
from dsl_core.reconstruction.spectral.causes import common_error, fit_causes
from dsl_core.reconstruction.spectral.evenness import MOST_UNEVEN, fit_evenness
from dsl_core.reconstruction.spectral.probing.line_probe import LineProbe
from dsl_core.reconstruction.spectral.probing.probe import Probe
from dsl_core.reconstruction.spectral.probing.probed_light import PARAMETERS
from dsl_core.reconstruction.spectral.probing.probed_pixels import CELLS

#: Deviation of the gain of one pixel, and how far the lines of an order are, in halves of the frame.
STD, APART = 0.05, 0.4
NAME = "evenness of the projector's light"


def probe_of(change: float, *, among: slice = slice(None), plus: float = 0.0) -> Probe:
    """Pixels of which some see light that changes so much to the sides, and order +1 brighter."""
    random = np.random.default_rng(4)
    cell = np.repeat(np.arange(CELLS[0] * CELLS[1]), 8)
    down, across = np.divmod(cell, CELLS[1])
    place = np.stack([2 * (down + 0.5) / CELLS[0] - 1, 2 * (across + 0.5) / CELLS[1] - 1], 1)
    own = 0.6 * place[:, 1]
    sideways = np.stack([(own + APART) ** 2 - own**2, (own - APART) ** 2 - own**2], 1)
    count, p = len(cell), len(PARAMETERS)
    asked = STD * random.standard_normal((count, p))
    asked[among, 2:4] += change * sideways[among]
    asked[:, 2] += plus
    return Probe(
        normal=np.broadcast_to(np.eye(p) / STD**2, (count, p, p)).copy(), score=asked / STD**2,
        bias=np.zeros((count, 1, p)), reflectance=np.ones((count, 1)), chi_square=np.ones(count),
        correlation=np.ones(count), place=place, cell=cell, pixel=np.arange(count),
        lines=LineProbe(np.eye(2)[None], np.zeros((1, 2)), np.ones(1)), nm_per_px=2.0, sideways=sideways,
    )  # fmt: skip


@pytest.mark.parametrize("change", [-0.2, -0.06, 0.1])
def test_light_that_changes_to_the_sides_is_found_told_and_part_of_deviations(change: float) -> None:
    probe = probe_of(change, plus=0.03)
    found = fit_evenness(probe)
    assert found is not None
    assert abs(found.change - change) < 3 * found.std < 0.06
    assert found.matters
    assert probe.sideways is not None
    assert found.error == pytest.approx(abs(found.change) * np.sqrt(np.mean(probe.sideways**2)))
    (told,) = (each for each in cause_findings(probe) if each.name == NAME)
    assert told.significant
    assert f"{found.change:+.1%} from the middle" in told.sentence
    # A film that diffracts less at its sides looks alike.
    assert "the share of it that the film diffracts" in told.sentence
    even = common_error(replace(probe, sideways=None), fit_causes(probe))
    assert common_error(probe, fit_causes(probe)) == pytest.approx(np.hypot(even, found.error))


@pytest.mark.parametrize(
    "probe", [probe_of(0.0), probe_of(0.0, plus=0.1), probe_of(-0.02), probe_of(-2.0, among=slice(0, 12))]
)
def test_even_light_gains_of_an_order_and_a_few_pixels_are_none(probe: Probe) -> None:
    found = fit_evenness(probe)
    assert found is not None
    assert not found.matters
    (told,) = (each for each in cause_findings(probe) if each.name == NAME)
    assert not told.significant
    without = replace(probe, sideways=None)
    assert common_error(probe, fit_causes(probe)) == common_error(without, fit_causes(without))


def test_what_only_part_of_the_picture_asks_for_is_none() -> None:
    found = fit_evenness(probe_of(-3.0, among=slice(0, 12)))
    assert found is not None
    assert abs(found.change) > MOST_UNEVEN
    assert not found.matters


def test_a_probe_without_traced_lines_says_nothing() -> None:
    probe = replace(probe_of(-0.2), sideways=None)
    assert fit_evenness(probe) is None
    assert NAME not in [each.name for each in cause_findings(probe)]
