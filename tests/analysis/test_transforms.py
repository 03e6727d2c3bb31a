import numpy as np
import pytest

from dsl_core.analysis.band_noise import usual_correlation
from dsl_core.analysis.transforms import Transform, transformed, upper_hull

NM = np.arange(430.0, 661.0, 5.0)
#: Curved, so that no three of its corners are on a line.
MEAN = 0.3 + 0.001 * (NM - 430) - 4e-6 * (NM - 545) ** 2 - 0.1 * np.exp(-0.5 * ((NM - 550) / 12) ** 2)
STD = np.full(len(NM), 0.004)


@pytest.mark.slow
@pytest.mark.parametrize("transform", [each for each in Transform if each is not Transform.CONTINUUM])
def test_deviations_are_those_of_repeated_measurements(transform: Transform) -> None:
    rng = np.random.default_rng(1)
    root = np.linalg.cholesky(usual_correlation(NM))
    shots = MEAN + STD * (root @ rng.standard_normal((len(NM), 3000))).T
    found = np.stack([transformed(NM, shot, None, transform)[0] for shot in shots])
    mean, std = transformed(NM, MEAN, STD, transform)
    assert std is not None
    assert found.mean(0) == pytest.approx(mean, abs=1e-3)
    assert found.std(0) == pytest.approx(std, rel=0.1, abs=2e-4)


@pytest.mark.parametrize("shape", [np.full(NM.size, 0.5), np.linspace(0.3, 0.6, NM.size), MEAN])
def test_deviations_without_the_continuum_contain_that_noise_lifts_it(shape: np.ndarray) -> None:
    rng = np.random.default_rng(1)
    root = np.linalg.cholesky(usual_correlation(NM))
    true, std = 0.01 * shape, 0.01 * 0.02 * shape
    true_removed, _ = transformed(NM, true, None, Transform.CONTINUUM)
    covered = []
    for _ in range(60):
        shot, its = transformed(
            NM, true + std * (root @ rng.standard_normal(NM.size)), std, Transform.CONTINUUM
        )
        assert its is not None
        covered.append(np.abs(shot - true_removed) <= 1.96 * its + 1e-12)
    assert 0.91 < np.mean(covered) < 0.98


def test_an_unsure_end_takes_no_deviations_without_the_continuum_from_the_rest() -> None:
    spectrum, even = 0.3 + 0.1 * np.sin(NM / 40), np.full(NM.size, 0.01)
    unsure = np.where(NM[0] == NM, 0.1, even)
    (_, usual), (_, std) = (transformed(NM, spectrum, each, Transform.CONTINUUM) for each in (even, unsure))
    assert usual is not None
    assert std is not None
    assert np.isfinite(std).all()
    assert std[30:] == pytest.approx(usual[30:], rel=0.05, abs=1e-3)
    assert std[1] > 3 * usual[1]
    _, none = transformed(NM, 0.02 * spectrum, even, Transform.CONTINUUM)
    assert none is not None
    assert np.isnan(none).all()


def test_a_level_leaves_a_normalised_spectrum_and_a_line_its_derivative() -> None:
    twice = transformed(NM, 2 * MEAN, 2 * STD, Transform.NORMALISED)
    once = transformed(NM, MEAN, STD, Transform.NORMALISED)
    for a, b in zip(once, twice, strict=True):
        assert a == pytest.approx(b)
    slope = transformed(NM, 0.1 + 0.002 * NM, None, Transform.DERIVATIVE)[0]
    assert slope == pytest.approx(0.002)


def test_the_continuum_touches_from_above_and_leaves_the_band() -> None:
    hull = upper_hull(NM, MEAN)
    assert (hull >= MEAN - 1e-12).all()
    assert np.diff(hull, 2).max() < 1e-12
    removed = transformed(NM, MEAN, None, Transform.CONTINUUM)[0]
    assert removed.max() == pytest.approx(1.0)
    assert NM[removed.argmin()] == 550.0
    assert removed.min() == pytest.approx(1 - 0.1 / (0.3 + 0.12), abs=0.02)


def test_what_has_no_shape_is_not_a_number() -> None:
    values, std = transformed(NM, np.zeros(len(NM)), STD, Transform.NORMALISED)
    assert np.isnan(values).all()
    assert std is not None
    assert np.isnan(transformed(NM, np.full(len(NM), np.nan), None, Transform.CONTINUUM)[0]).all()


@pytest.mark.parametrize("transform", [Transform.NORMALISED, Transform.DERIVATIVE, Transform.CONTINUUM])
def test_what_follows_from_deviations_that_are_not_known_is_not_known(transform: Transform) -> None:
    for unknown in (slice(None), 20):
        some = STD.copy()
        some[unknown] = np.nan
        values, std = transformed(NM, MEAN, some, transform)
        assert np.isfinite(values).all()
        assert std is not None
        assert np.isnan(std).all()
