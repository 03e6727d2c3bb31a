"""Colours that disagree about the same light say how far curves are off; noise and agreement say nothing."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from dsl_core.reconstruction.spectral.probing.curve_probe import (
    KNOTS_NM,
    USUAL_STEEPNESS,
    bright_knots,
    curve_changes,
    curve_misfit,
    normal_of_all_curves,
    of_all_curves,
    steepness_per_nm,
    tells_of_curves,
)

PIXELS, OTHERS, LEVEL = 50, 2, 2e3


def equations(off: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Pixels that know two other parameters, and of curves only what differs from colour to colour."""
    rng = np.random.default_rng(2)
    knots = len(KNOTS_NM)
    contrast = np.kron(np.eye(3) - 1 / 3, np.eye(knots))
    normal = np.zeros((OTHERS + 3 * knots, OTHERS + 3 * knots))
    normal[:OTHERS, :OTHERS], normal[OTHERS:, OTHERS:] = np.eye(OTHERS), contrast
    normal = LEVEL * np.broadcast_to(normal, (PIXELS, *normal.shape))
    truth = np.r_[np.full(OTHERS, 0.1), off * rng.choice([-1.0, 1.0], 3 * knots)]
    noise = np.sqrt(LEVEL) * rng.standard_normal((PIXELS, len(truth)))
    noise[:, OTHERS:] = noise[:, OTHERS:] @ contrast
    return normal, normal @ truth + noise, np.ones(PIXELS)


def test_curves_are_off_by_what_colours_disagree() -> None:
    prior = np.full(OTHERS, 0.2)
    found = curve_misfit(*equations(0.04), prior, 5.0)
    assert found is not None
    # Straight pieces between knots have two thirds of the mean square of the knots.
    assert found.rms == pytest.approx(0.04 * (2 / 3) ** 0.5, rel=0.25)
    assert 0.002 < found.std < found.rms / 3
    right = curve_misfit(*equations(0.0), prior, 5.0)
    assert right is not None
    assert right.rms == 0
    # Wide bands leave as much of spectra that are not straight.
    coarse = curve_misfit(*equations(0.04), prior, 10.0)
    assert coarse is not None
    assert coarse.rms == 0


def test_a_curve_does_not_count_where_its_colour_is_faint() -> None:
    prior, knots = np.full(OTHERS, 0.2), len(KNOTS_NM)
    normal, score, weight = equations(0.0)
    # The first colour disagrees by a tenth at three knots.
    off = np.zeros(OTHERS + 3 * knots)
    off[OTHERS : OTHERS + 3] = 0.1
    known = normal, score + normal @ off, weight, prior, 5.0
    bright = np.ones(3 * knots, bool)
    everywhere = curve_misfit(*known, bright=bright)
    assert everywhere == curve_misfit(*known)
    assert everywhere is not None
    assert everywhere.rms > 0.015
    bright[:3] = False
    without = curve_misfit(*known, bright=bright)
    assert without is not None
    assert without.rms == 0
    # What is not faint counts as before.
    more = curve_misfit(*equations(0.04), prior, 5.0, bright=bright)
    assert more is not None
    assert more.rms == pytest.approx(0.04 * (2 / 3) ** 0.5, rel=0.25)


def test_knots_are_bright_from_a_twentieth_of_the_brightest_light_of_their_colour_on() -> None:
    nm = np.arange(430.0, 661.0, 5.0)
    rising, even = np.exp(0.1 * (nm - 660)), np.full(len(nm), 0.01)
    found = bright_knots(np.stack([[rising, even], [0 * rising, even]]), nm).reshape(2, -1)
    assert found[0].tolist() == (KNOTS_NM > 660 - 30).tolist()
    assert found[1].all()


def test_light_that_changes_twice_as_fast_leaves_four_times_as_much() -> None:
    normal, score, weight = equations(0.04)
    known = normal, score, weight, np.full(OTHERS, 0.2), 5.0
    usual, steep = (curve_misfit(*known, by * USUAL_STEEPNESS) for by in (1.0, 2.0))
    assert usual is not None
    assert steep is not None
    assert usual.rms == usual.whole_rms == steep.whole_rms
    assert (steep.rms, steep.std) == (0.0, usual.std)


def test_light_is_as_steep_as_its_logarithm_where_it_is_bright() -> None:
    nm = np.arange(430.0, 661.0, 5.0)
    rising = np.exp(0.1 * (nm - 660))
    # What is below a twentieth of the brightest does not count.
    light = np.where(nm > 630, rising, np.where(nm % 10 > 0, 0.0, 0.01))
    assert steepness_per_nm(np.stack([light, 3 * light]), 5.0) == pytest.approx(0.1)
    assert steepness_per_nm(rising**0.5, 5.0) == USUAL_STEEPNESS
    assert steepness_per_nm(np.zeros(47), 5.0) == USUAL_STEEPNESS


def test_colours_that_know_too_little_say_nothing() -> None:
    normal, score, weight = equations(0.04)
    assert curve_misfit(normal, score, 1e-3 * weight, np.full(OTHERS, 0.2), 5.0) is None


def test_only_many_smooth_spectra_tell_of_curves() -> None:
    nm = np.linspace(-1, 1, 40)
    slopes = np.linspace(-0.9, 0.9, 30)[:, None]
    waves = np.cos(np.pi * np.arange(1, 6)[:, None] * (nm + 1) / 2)
    many = 0.5 + np.random.default_rng(4).uniform(-0.09, 0.09, (30, 5)) @ waves
    assert tells_of_curves(many)
    assert not tells_of_curves(many[np.arange(30) % 3])
    assert not tells_of_curves(np.full((30, 40), 0.5) + 0.02 * slopes * nm)
    assert not tells_of_curves(np.exp(-(((nm - slopes) / 0.04) ** 2)))
    assert not tells_of_curves(np.empty((0, 40)))


def test_changes_of_curves_are_those_of_the_data() -> None:
    rng = np.random.default_rng(0)
    nm = np.arange(400.0, 701.0, 10.0)
    rows, spectra = (torch.as_tensor(rng.random(shape)) for shape in ((4, 6, nm.size), (4, nm.size)))
    changed = rows * torch.as_tensor(1 + 0.01 * np.interp(nm, KNOTS_NM, np.arange(len(KNOTS_NM))))
    wanted = ((changed - rows) @ spectra[..., None])[..., 0]
    found = curve_changes(rows, spectra, nm) @ torch.arange(len(KNOTS_NM)).double() * 0.01
    assert found.numpy() == pytest.approx(wanted.numpy())


def test_each_colour_has_its_own_place_in_the_equations() -> None:
    rng = np.random.default_rng(1)
    changes = torch.as_tensor(rng.random((3, 7, 3)))
    # One other parameter, and two knots of each of three colours.
    whole = torch.zeros((3, 7, 7), dtype=torch.float64)
    for colour in range(3):
        whole[colour, :, 0] = changes[colour, :, 0]
        whole[colour, :, 1 + 2 * colour : 3 + 2 * colour] = changes[colour, :, 1:]
    flat = whole.flatten(0, 1)
    found = normal_of_all_curves((changes.mT @ changes)[None], 1)[0]
    assert found.numpy() == pytest.approx((flat.T @ flat).numpy())
    assert of_all_curves(changes.sum(1)[None], 1)[0].numpy() == pytest.approx(flat.sum(0).numpy())


def test_differences_known_to_better_than_a_little_over_a_percent_count_without_their_noise() -> None:
    """Knots that nothing couples, but one to another parameter, whose prior leaves it a part."""
    std = np.array([0.001, 0.002, 0.004, 0.006, 0.008, 0.0119, 0.0121, 0.02])
    off = np.array([0.05, -0.04, 0.03, 0.06, -0.05, 0.02, 0.9, -0.9])
    normal, score = np.diag(np.r_[300.0, std**-2]), np.r_[40.0, off * std**-2]
    normal[0, 1] = normal[1, 0] = 2000.0
    own = 300.0 + 1 / 0.1**2
    first = std[0] ** -2 - 2000.0**2 / own
    found = np.r_[(score[1] - 2000.0 / own * 40.0) / first, off[1:6]]
    variance = np.r_[1 / first, std[1:6] ** 2]
    square = np.mean(found**2 - variance)
    answer = curve_misfit(normal[None] / 2, score[None] / 2, np.array([2.0]), np.array([0.1]), 4.0)
    assert answer is not None
    assert answer.rms == pytest.approx((2 / 3 * (square - 0.014**2)) ** 0.5)
    assert answer.std == pytest.approx((2 / 3 * square / 12) ** 0.5)
    # One of six less is too few, and pixels of no weight say nothing.
    normal[6, 6] = 0.0121**-2
    assert curve_misfit(normal[None], score[None], np.ones(1), np.array([0.1]), 4.0) is None
    assert curve_misfit(normal[None], score[None], np.zeros(1), np.array([0.1]), 4.0) is None


def test_knots_are_nine_from_blue_to_red() -> None:
    changes = curve_changes(
        torch.eye(301, dtype=torch.float64)[None], torch.ones((1, 301)).double(), np.arange(400.0, 701.0)
    )
    peaks = changes[0].argmax(0) + 400
    # Beyond the outermost their curves go on level.
    assert peaks[1:-1].tolist() == pytest.approx([430 + 28.75 * k for k in range(1, 8)], abs=1)
    assert changes[0, :31, 0].tolist() == [1.0] * 31
    assert changes[0, 260:, -1].tolist() == [1.0] * 41
    assert changes[0, 259, -1] < 1
