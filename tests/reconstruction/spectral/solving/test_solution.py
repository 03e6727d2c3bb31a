"""What is left of samples after a spectrum was fitted to them."""

from __future__ import annotations

import pytest
import torch

from dsl_core.reconstruction.spectral.solving.solution import freedom


def test_a_spectrum_takes_25_of_many_samples_and_a_third_of_few() -> None:
    # What data decide of a white spectrum with 30 samples was 5, of coloured ones 15, the prior the rest.
    samples = torch.tensor([240.0, 75.0, 30.0, 1.0, 0.0])
    assert freedom(samples).tolist() == pytest.approx([215.0, 50.0, 20.0, 1.0, 1.0])
