"""Orders that share the light otherwise are the film's fault only where black has not changed."""

from __future__ import annotations

import pytest

from dsl_core.model.fit import Fit, FitFinding
from dsl_core.reconstruction.findings.band_findings import band_findings
from dsl_core.reconstruction.findings.flag_findings import POOR_AREAS, POOR_FIT, SpectralCounts
from dsl_core.reconstruction.findings.known_causes import (
    with_changes_known,
    with_finer_bands_first,
    with_known_causes,
    without_effects,
)
from dsl_core.reconstruction.findings.model_findings import (
    COLOUR_GAINS,
    COLOURS_DISAGREE,
    DRIFT_LEFT,
    EVENNESS,
    GAIN_OF_BOTH,
    MISFIT,
    ORDERS_APART,
)
from dsl_core.reconstruction.light.told import BLACK_AGAIN, COLOUR, DRIFT, STEP
from dsl_core.reconstruction.spectral.colour_sites import MOSAIC
from dsl_core.reconstruction.spectral.order_balance import BALANCE


def finding(name: str, value: float, sentence: str) -> FitFinding:
    return FitFinding.judged("light", name, value, "1", 0.5, sentence, "Do it.")


@pytest.mark.parametrize(("black_dn", "is_film"), [(0.4, True), (0.8, False)])
def test_a_changed_black_explains_faint_orders(black_dn: float, is_film: bool) -> None:
    black = finding(BLACK_AGAIN, black_dn, "Black changed.")
    orders = finding(BALANCE, -0.26, "The film has been turned over.")
    found = with_known_causes([black, orders])
    assert found[0] == black
    assert (found[1] == orders) == is_film
    assert ("0.74 times as bright against order -1" in found[1].sentence) == (not is_film)


@pytest.mark.parametrize(
    ("left", "course_std", "is_told"),
    [(-0.286, 0.003, False), (0.04, 0.003, True), (-0.2, 0.05, True), (-0.286, None, True)],
)
def test_light_whose_course_is_known_has_not_drifted_much_beyond_it(
    left: float, course_std: float | None, is_told: bool
) -> None:
    seen = FitFinding.judged("light", DRIFT_LEFT, (left, 0.002), "1", 0.014, "It drifted.", "Wait.")
    known = (
        []
        if course_std is None
        else [FitFinding.judged("light", DRIFT, (0.01, course_std), "1", 0.006, "It drifted.", "Wait.")]
    )
    found = with_changes_known([seen], known)
    assert [each.significant for each in found] == [is_told]


@pytest.mark.parametrize("black_dn", [0.4, 0.8])
def test_what_a_changed_black_looks_like_is_no_fault_of_lamp_or_response(black_dn: float) -> None:
    """Sun that rose while lines were captured was told as a lamp that had not warmed up."""
    model = [finding(name, -0.6, "It has changed.") for name in (DRIFT_LEFT, GAIN_OF_BOTH, ORDERS_APART)]
    found = with_changes_known(model, [finding(BLACK_AGAIN, black_dn, "Black changed.")])
    has_changed = black_dn > 0.5
    assert [each.significant for each in found] == [not has_changed, True, True]
    for each in found[1:]:
        assert each.advice.startswith("Scan again with steady black and light first") == has_changed


@pytest.mark.parametrize("name", [DRIFT, STEP, COLOUR, BLACK_AGAIN])
@pytest.mark.parametrize("change", [0.4, 0.8])
def test_light_that_changed_in_time_is_not_uneven_over_the_frame(name: str, change: float) -> None:
    """Lines run over the frame in time: a lamp 10 % dimmer from the middle of a scan on looked uneven."""
    seen = finding(EVENNESS, 0.8, "The light changes to the sides.")
    found = with_changes_known([seen], [finding(name, change, "It changed.")])
    assert [each.significant for each in found] == [change < 0.5 or name == BLACK_AGAIN]


@pytest.mark.parametrize("name", [POOR_AREAS, POOR_FIT, COLOUR_GAINS, COLOURS_DISAGREE, MISFIT])
@pytest.mark.parametrize(("step_nm", "is_told"), [(46.0, False), (5.0, True)])
def test_bands_too_wide_for_the_lines_are_told_alone(name: str, step_nm: float, is_told: bool) -> None:
    misfit = finding(name, 0.98, "Surfaces are fluorescent.")
    drift = finding("change of the light", 0.9, "The light has changed.")
    bands = band_findings(step_nm, 10.0, SpectralCounts())
    fit = Fit.of(without_effects([misfit, drift, *bands]))
    assert ("fluorescent" in fit.words) == is_told
    assert ("coarse for lines" in fit.words) == (not is_told)
    assert "The light has changed." in fit.words, "no width of bands makes light drift"
    assert {each.name for each in fit.findings} >= {name}


@pytest.mark.parametrize(("name", "is_told"), [(POOR_AREAS, False), (BALANCE, False), (BLACK_AGAIN, True)])
def test_pixels_of_other_colours_than_stated_are_told_before_film_and_surface(
    name: str, is_told: bool
) -> None:
    """The film was called missing, and depth none of its business, where the mosaic began a column later."""
    fit = Fit.of(without_effects([finding(MOSAIC, 1.0, "Other colours."), finding(name, 0.98, "It is off.")]))
    assert "Other colours." in fit.words
    assert ("It is off." in fit.words) == is_told


@pytest.mark.parametrize("ratio", [-0.46, -0.1])
def test_a_turned_film_is_told_before_the_surfaces_that_no_spectrum_explains(ratio: float) -> None:
    """All surfaces were called fluorescent or translucent first, as no spectrum suits exchanged orders."""
    surfaces = [finding(name, 0.98, "Surfaces are fluorescent.") for name in (POOR_AREAS, MISFIT)]
    orders = FitFinding.judged("orders", BALANCE, ratio, "1", 0.25, "The film has been turned over.", "")
    fit = Fit.of(without_effects([*surfaces, orders]))
    assert ("The film has been turned over." in fit.words) == (ratio < -0.25)
    assert ("fluorescent" in fit.words) == (ratio > -0.25)


@pytest.mark.parametrize("name", [POOR_AREAS, MISFIT, GAIN_OF_BOTH, ORDERS_APART, DRIFT_LEFT])
@pytest.mark.parametrize("step_nm", [5.0, 10.0])
def test_before_a_rig_is_blamed_bands_are_made_finer(name: str, step_nm: float) -> None:
    """Narrow features in wide bands were told as dirt on the film, and as a response to be measured again."""
    found = with_finer_bands_first([finding(name, 0.98, "It differs.")], step_nm)
    first = step_nm == 10 and name != DRIFT_LEFT
    assert found[0].advice.startswith("Reconstruct with bands of 5 nm first: ones of 10 nm") == first
    assert found[0].advice.endswith("If it stays: do it." if first else "Do it.")
    assert found[0].significant
    # Without a film there is no light in any band.
    (missing,) = with_finer_bands_first(
        [finding(name, 0.98, "It differs.").model_copy(update={"part": "film"})], step_nm
    )
    assert missing.advice == "Do it."
