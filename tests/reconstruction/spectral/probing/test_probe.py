"""Which pixels are probed, what they weigh, and whether they can tell where the orders are."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import torch

from dsl_core.reconstruction.spectral.probing import probe as probe_module
from dsl_core.reconstruction.spectral.probing.curve_probe import variety
from dsl_core.reconstruction.spectral.probing.line_probe import LineProbe
from dsl_core.reconstruction.spectral.probing.probe import ONE_COLOUR, Probe
from dsl_core.reconstruction.spectral.probing.probed_light import PARAMETERS
from dsl_core.reconstruction.spectral.probing.probed_pixels import samples_of

RISING = np.linspace(0.2, 0.6, 24)


def test_one_colour_at_many_levels_has_no_variety() -> None:
    levels = np.linspace(0.3, 1.0, 40)[:, None]
    assert variety(levels * RISING) == pytest.approx(0.0, abs=1e-12)
    noise = 0.01 * np.random.default_rng(0).standard_normal((40, 24))
    assert variety(levels * RISING + noise) < ONE_COLOUR


def test_a_few_pixels_of_another_colour_are_a_variety() -> None:
    spectra = np.tile(RISING, (40, 1))
    spectra[:4] = RISING[::-1]
    assert variety(spectra) > 2 * ONE_COLOUR


def test_neighbouring_residuals_that_go_together_count_until_they_first_do_not() -> None:
    # Two pixels; of the first one two samples. Autocorrelations of 1, 2/3, 1/3 and of 1, -1/2.
    rows = torch.tensor([[1, 1, 1, 0, 0, 0], [1, 1, 1, 0, 0, 0], [0, 1, -1, 0, 1, -1]], dtype=torch.float64)
    owner = torch.tensor([0, 0, 1])

    def gather(values: torch.Tensor) -> torch.Tensor:
        return torch.zeros(2, dtype=values.dtype).index_add_(0, owner, values)

    assert probe_module._correlation(rows, gather).tolist() == pytest.approx([1 + 2 * (2 / 3 + 1 / 3), 1.0])
    # Nothing divides by nothing, and only eight lags count.
    long = torch.ones((1, 30), dtype=torch.float64)
    wanted = 1 + 2 * sum(1 - lag / 30 for lag in range(1, 9))
    assert probe_module._correlation(long, lambda values: values).tolist() == pytest.approx([wanted])
    assert probe_module._correlation(0 * long, lambda values: values).tolist() == [1.0]


def probe_of(**more: Any) -> Probe:
    """Four pixels that say little."""
    p = len(PARAMETERS)
    values: dict[str, Any] = {
        "normal": np.broadcast_to(np.eye(p), (4, p, p)).copy(), "score": np.zeros((4, p)),
        "bias": np.zeros((4, 1, p)), "reflectance": np.ones((4, 1)), "chi_square": np.ones(4),
        "correlation": np.ones(4), "place": np.zeros((4, 2)), "cell": np.zeros(4, np.int64),
        "pixel": np.arange(4), "lines": LineProbe(np.eye(2)[None], np.zeros((1, 2)), np.ones(1)),
        "nm_per_px": 2.0,
    }  # fmt: skip
    return Probe(**values | more)


def test_pixels_weigh_less_where_frames_fit_less_and_nothing_with_two_surfaces() -> None:
    chi_square, correlation = np.array([0.5, 2.0, 1.0, 40.0]), np.array([1.0, 1.5, 0.5, 1.0])
    found = probe_of(chi_square=chi_square, correlation=correlation)
    assert found.sound.tolist() == [True, True, True, False]
    assert found.weight == pytest.approx([1.0, 1 / 3, 1.0, 0.0])
    score = np.zeros((4, len(PARAMETERS)))
    score[1, 0] = np.nan
    assert probe_of(score=score).weight.tolist() == [1.0, 0.0, 1.0, 1.0]


@pytest.mark.parametrize(("pixels", "each"), [(6000 * 8, 8), (6000 * 10, 10), (6000 * 30, 12), (600, 8)])
def test_as_many_pixels_are_probed_as_the_picture_is_large(
    pixels: int, each: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked = list[int]()
    monkeypatch.setattr(probe_module, "sample_pixels", lambda valid, count: asked.append(count))
    valid = np.zeros((2, pixels), bool)
    valid[0] = True
    probe_module.probe_targets(valid)
    assert asked == [each]


def test_curves_say_nothing_where_nobody_asked() -> None:
    assert probe_of().curves is None


def test_what_is_read_for_a_probe_are_its_pixels_and_the_samples_around_them() -> None:
    valid = np.ones((40, 60), bool)
    targets = probe_module.probe_targets(valid)
    found = probe_module.probed_pixels(valid, "RGGB")
    assert (np.diff(found) > 0).all()
    assert set(targets) < set(found)
    assert set(found) == set(targets) | set(samples_of(targets, (40, 60), "RGGB")[0])
    assert set(probe_module.probed_pixels(valid, "MONO")) == set(targets)
