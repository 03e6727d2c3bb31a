from __future__ import annotations

import numpy as np
import pytest

from dsl_core.errors import DecodeError
from dsl_core.evaluation.similarity import angle_map, angle_noise, likeness

NM = np.arange(430.0, 661.0, 5.0)


def test_the_angle_does_not_see_brightness() -> None:
    spectrum = np.linspace(0.1, 0.9, NM.size)
    cube = np.stack([spectrum, 0.2 * spectrum, spectrum[::-1]], 1)[:, None].astype(np.float32)
    angles = angle_map(cube, spectrum)
    assert angles[0, :2] == pytest.approx(0, abs=1e-3)
    assert angles[0, 2] > 0.5
    with pytest.raises(DecodeError, match="complete spectrum"):
        angle_map(cube, np.full(NM.size, np.nan))


def test_metamers_look_alike_and_are_not() -> None:
    from dsl_core.optics.colour import observer_weights

    spectrum = 0.4 + 0.1 * np.sin(NM / 40)
    # What the eye under D65 cannot see: the part of a wiggle that its three weights are blind to.
    wiggle = 0.2 * np.sin(NM / 9)
    weights = observer_weights(NM)
    blind = wiggle - np.linalg.pinv(weights) @ (weights @ wiggle)
    cube = np.stack([spectrum, spectrum + blind, 1.5 * spectrum], 1)[:, None].astype(np.float32)
    found = likeness(cube, spectrum, NM)
    assert found.metamers(1.0, 0.05).tolist() == [[False, True, False]]
    assert found.same_spectrum(0.05).tolist() == [[True, False, True]]


def test_bands_that_hold_no_colour_have_no_metamers_and_are_still_searched() -> None:
    cube = np.full((NM.size, 1, 2), 0.5, np.float32)
    cube[1:, 0, 1] = 0.1
    found = likeness(cube, cube[:, 0, 0], NM + 270)
    assert np.isnan(found.delta_e).all()
    assert not found.metamers(2.0, 0.05).any()
    assert found.same_spectrum(0.05).tolist() == [[True, False]]


def test_deviations_alone_make_an_angle() -> None:
    cube, std = np.full((4, 1, 1), 0.5), np.full((4, 1, 1), 0.05)
    rng = np.random.default_rng(2)
    noisy = rng.normal(np.full((4, 1, 500), 0.5), 0.05)
    # Three of four directions turn a spectrum, the fourth makes it longer.
    assert float(angle_noise(cube, std)[0, 0]) == pytest.approx(0.0997, abs=1e-3)
    assert np.sqrt(np.mean(angle_map(noisy, cube[:, 0, 0]) ** 2)) == pytest.approx(
        0.0997 * np.sqrt(3 / 4), rel=0.1
    )
