"""The verdict on a fit: its order, its words, and how it travels in a result."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from dsl_core.io.result.result_file import load_result, save_result
from dsl_core.model.fit import ATTRIBUTE, Fit, FitFinding, Part
from dsl_core.model.result import build_result


def finding(part: Part, value: float, significant: bool) -> FitFinding:
    return FitFinding(
        part=part, name=f"{part} figure", value=value, std=0.1, unit="px", limit=1.0,
        significant=significant, sentence=f"The {part} is off by {value:g} px.", advice="Look there.",
    )  # fmt: skip


def test_findings_that_matter_come_first_and_the_worst_of_them_leads() -> None:
    fit = Fit.of(
        [finding("light", 9.0, False), finding("film", 2.0, True), finding("profile", -3.0, True),
         finding("film", 2.5, True)]
    )  # fmt: skip
    assert fit.parts == ("profile", "film")
    assert [found.value for found in fit.findings] == [-3.0, 2.5, 2.0, 9.0]
    assert fit.headline.endswith("Look at the profile of the lines and the place of the film.")
    assert fit.words.splitlines()[1] == "The profile is off by -3 px. Look there."
    assert "light" not in fit.words


def test_a_fit_without_findings_that_matter_says_that_the_model_fits() -> None:
    assert Fit.of([finding("light", 0.5, False)]).words == "The model fits this rig and scene."


def test_the_part_of_the_model_in_the_deviations_is_told_where_it_matters() -> None:
    error = (((0.03, 0.0), (0.0, 0.03)),)
    told = Fit.of([finding("orders", 1.5, True)], error)
    assert told.model_share == pytest.approx(0.03 / 2**0.5)
    assert told.words.endswith("contain 2.1% of it for the model.")
    assert Fit.of([finding("orders", 0.5, False)], error).words == "The model fits this rig and scene."


def test_what_no_finding_can_tell_comes_last() -> None:
    assert "contain 3.4% of it for what the light may" in Fit(level_rel_std=0.034).words
    assert Fit(level_rel_std=0.004).words == Fit().words
    assert Fit(measured="Own.", unseen="Old.").words.splitlines()[1:] == ["Own.", "Old."]
    assert Fit(scale="Scale.", unseen="Old.").words.splitlines()[1:] == ["Scale.", "Old."]
    assert Fit(unseen="Old.").words == "The model fits this rig and scene.\nOld."
    assert Fit(unseen="Old.", findings=(finding("light", 2.0, True),)).words.endswith("\nOld.")


@pytest.mark.parametrize(
    ("found", "significant"), [(0.3, True), (0.1, False), ((-0.3, 0.05), True), ((0.3, 0.11), False)]
)
def test_a_finding_matters_beyond_its_limit_and_chance(
    found: float | tuple[float, float], significant: bool
) -> None:
    assert FitFinding.judged("light", "drift", found, "1", 0.2, "Drift.", "Wait.").significant == significant


def test_it_travels_in_a_saved_result(tmp_path: Path) -> None:
    fit = Fit.of([finding("orders", 1.5, True), finding("mixed pixels", 0.25, False)], (((0.01,),),))
    arrays: dict[str, NDArray[np.generic]] = {"depth_mm": np.ones((2, 3), np.float32)}
    made = build_result(arrays, np.empty(0), {ATTRIBUTE: fit.model_dump_json()})
    assert Fit.read(load_result(save_result(made, tmp_path / "a.zarr")).attrs) == fit


def test_results_without_a_fit_that_can_be_read_have_none() -> None:
    assert Fit.read({}) is None
    assert Fit.read({ATTRIBUTE: '{"findings": 3}'}) is None
