"""Two results against each other on the command line."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from dsl_core.io.result.result_file import load_result, save_result
from tests.cases.small_result import small_result

from .conftest import Give


def test_two_results_are_compared_first_minus_second(give: Give, tmp_path: Path) -> None:
    first, second = tmp_path / "first.zarr", tmp_path / "second.zarr"
    save_result(small_result(), first)
    nearer = load_result(first).load()
    nearer["depth_mm"] = nearer["depth_mm"] - 2 - 0.001 * (np.indices(nearer["depth_mm"].shape).sum(0) % 2)
    save_result(nearer, second)
    figures = give("compare", first, second, "--json").json["figures"]
    mean = figures["Depth, mean difference"]
    assert mean["value"] == pytest.approx(2.0005, abs=2e-4)
    assert 0 < mean["std"] < 1e-3
    assert figures["Pixels that both have"]["std"] is None
    assert "Depth, mean difference" in give("compare", first, second).out


def test_a_result_that_is_not_there_is_named(give: Give, tmp_path: Path) -> None:
    ending = give("compare", tmp_path / "a.zarr", tmp_path / "b.zarr")
    assert ending.code == 2
    assert "a.zarr" in ending.sentence
