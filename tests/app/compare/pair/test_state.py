"""What the panel of a pair shows for a state, without a window."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from dsl_app.compare.pair.state import (
    Pair,
    PairQuantity,
    PairState,
    Side,
    cursor_text,
    pair_display,
    side_texts,
)
from dsl_app.shared.widget_state import LabelState

from dsl_core.evaluation.summary import Truth
from dsl_core.io.result.result_arrays import ResultArrays
from dsl_core.io.scan.origin import rig_notes


def side(name: str, depth_mm: float, reflectance: float, truth: Truth | None = None) -> Side:
    arrays = {
        "depth_mm": np.full((2, 3), depth_mm, np.float32),
        "reflectance": np.full((1, 2, 3), reflectance, np.float32),
    }
    return Side(name, ResultArrays(Path(f"{name}.zarr"), np.array([550.0]), arrays), truth)


def state_of(sides: str, busy: str = "", trouble: str = "") -> PairState:
    """A state with the sides ``a``, ``b`` and ``t`` (the ground truth of A)."""
    state = PairState()
    if "a" in sides:
        state.first.set(side("chart", 700.0, 0.5))
    if "b" in sides:
        state.second.set(side("box", 702.5, 0.75))
    if "t" in sides:
        state.second.set(side("truth", 700.0, 0.5, Truth(depth_mm=np.full((2, 3), 700.0))))
    first, second = state.first.value, state.second.value
    if first is not None and second is not None and not trouble:
        state.pair.set(Pair(first, second, ((0, 0),), ()))
    state.busy.set(busy)
    state.trouble.set(trouble)
    return state


@pytest.mark.parametrize(
    ("state", "names", "hint", "usable"),
    [
        (state_of(""), ("–", "–"), "", "open"),
        (state_of("a"), ("chart", "–"), "", "open truth"),
        (state_of("ab"), ("chart", "box"), "", "open truth swap report"),
        (state_of("at"), ("chart", "truth"), "", "open truth report"),
        (state_of("at", busy="Compare"), ("chart", "truth"), "Compare…", ""),
    ],
)
def test_buttons_and_hint_follow_the_state(
    state: PairState, names: tuple[str, str], hint: str, usable: str
) -> None:
    shown = pair_display(state)
    assert (shown.name_a, shown.name_b) == (f"A: {names[0]}", f"B: {names[1]}")
    assert shown.hint == LabelState(hint, "muted")
    buttons = (shown.open_first, shown.open_second, shown.report)
    assert [each.is_enabled for each in buttons] == ["open" in usable, "open" in usable, "report" in usable]
    assert (shown.truth.is_enabled, shown.swap.is_enabled) == ("truth" in usable, "swap" in usable)


@pytest.mark.parametrize(
    ("sides", "at_hand", "following"),
    [
        ("", None, "open_first"),
        ("", "box.zarr", "at_hand"),
        ("a", "box.zarr", "open_second"),
        ("a", "chart.zarr", "open_second"),
        ("at", "box.zarr", "report"),
        ("ab", None, "report"),
    ],
)
def test_the_blue_button_is_what_a_person_does_next(sides: str, at_hand: str | None, following: str) -> None:
    state = state_of(sides)
    state.at_hand.set(None if at_hand is None else Path(at_hand))
    shown = pair_display(state)
    names = ("open_first", "open_second", "truth", "at_hand", "report")
    assert [name for name in names if getattr(shown, name).is_primary] == [following] * bool(following)


def test_a_scan_of_the_simulated_rig_is_compared_with_its_truth_next() -> None:
    state = state_of("a")
    first = state.first.value
    assert first is not None
    notes = rig_notes("twin", {"scene": "color-checker"})
    state.first.set(replace(first, arrays=replace(first.arrays, attributes=notes)))
    shown = pair_display(state)
    assert (shown.truth.is_primary, shown.open_second.is_primary) == (True, False)


def test_the_open_result_is_offered_for_a_free_side_alone() -> None:
    offers = {}
    for sides, path in (("", "box.zarr"), ("a", "box.zarr"), ("a", "chart.zarr"), ("at", "box.zarr")):
        state = state_of(sides)
        state.at_hand.set(Path(path))
        button = pair_display(state).at_hand
        offers[sides, path] = button.text if button.is_visible else ""
    assert list(offers.values()) == ["box as A", "box as B", "", ""]


def test_a_free_place_says_what_may_come_there_and_a_taken_one_what_it_is() -> None:
    nothing = side_texts(state_of(""))
    assert "Open A" in nothing[0][1]
    assert "if A is of the simulated rig" in nothing[1][1]
    one = state_of("a")
    first, second = side_texts(one)
    assert first == ("A: chart", "3 × 2 px, 1 band, 100 % of the pixels have a depth")
    assert second[1] == "Another result of the same size in pixels."
    assert one.first.value is not None
    arrays = replace(one.first.value.arrays, attributes=rig_notes("twin", {}))
    one.first.set(replace(one.first.value, arrays=arrays))
    assert side_texts(one)[1][1].endswith("choose Truth as B.")
    assert side_texts(state_of("b"))[1][0] == "B: box"


def test_the_hint_is_what_went_wrong() -> None:
    assert pair_display(state_of("ab", trouble="They differ.")).hint == LabelState("They differ.", "bad")


def test_the_cursor_reads_both_sides_and_their_difference() -> None:
    state = state_of("ab")
    assert cursor_text(state) == "Point at a picture to compare values."
    state.cursor.set((2, 1))
    assert cursor_text(state) == "column 2, row 1:   A 700.00   B 702.50   A − B −2.50 mm"
    state.shown.set(PairQuantity.BAND)
    assert cursor_text(state) == "column 2, row 1:   A 0.500   B 0.750   A − B −0.250"
    state.band.set(1)
    assert cursor_text(state) == ""


def test_values_under_the_cursor_have_their_deviations_but_for_the_truth() -> None:
    state = state_of("at")
    first, second = state.first.value, state.second.value
    assert first is not None
    assert second is not None
    stds = {
        "depth_std_mm": np.full((2, 3), 0.03, np.float32),
        "reflectance_std": np.full((1, 2, 3), 0.012, np.float32),
    }
    first = replace(first, arrays=replace(first.arrays, arrays={**first.arrays.arrays, **stds}))
    state.cursor.set((2, 1))
    state.pair.set(Pair(first, second, ((0, 0),), ()))
    assert cursor_text(state) == "column 2, row 1:   A 700.00 ± 0.03   B 700.00   A − B 0.00 ± 0.03 mm"
    state.pair.set(Pair(first, replace(first, name="again"), ((0, 0),), ()))
    assert cursor_text(state).endswith("B 700.00 ± 0.03   A − B 0.00 ± 0.04 mm")
    # A deviation that is known is no zero.
    tiny = {name: each / 100 for name, each in stds.items()}
    small = replace(first, arrays=replace(first.arrays, arrays={**first.arrays.arrays, **tiny}))
    state.pair.set(Pair(small, second, ((0, 0),), ()))
    assert "A 700.00 ± 0.01   B 700.00 " in cursor_text(state)
    # Where one states none, nobody knows how sure the difference is.
    state.pair.set(Pair(first, side("plain", 702.5, 0.75), ((0, 0),), ()))
    assert cursor_text(state).endswith("A 700.00 ± 0.03   B 702.50   A − B −2.50 mm")
    state.pair.set(Pair(first, replace(first, name="again"), ((0, 0),), ()))
    state.shown.set(PairQuantity.BAND)
    assert cursor_text(state).endswith("A 0.500 ± 0.012   B 0.500 ± 0.012   A − B 0.000 ± 0.017")


def test_the_mean_over_bands_leaves_out_those_that_no_pixel_has() -> None:
    arrays = side("a", 700.0, 0.5).arrays
    cube = np.repeat(arrays["reflectance"], 2, axis=0)
    cube[1] = np.nan
    two = Side(
        "a",
        replace(
            arrays, wavelengths_nm=np.array([550.0, 560.0]), arrays={**arrays.arrays, "reflectance": cube}
        ),
    )
    means = Pair(two, two, ((0, 0), (1, 1)), ()).mean_reflectance()
    assert means is not None
    assert means[0] == pytest.approx(np.full((2, 3), 0.5))
    assert Pair(two, two, ((1, 1),), ()).mean_reflectance() is None
