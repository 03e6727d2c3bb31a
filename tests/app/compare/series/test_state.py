"""What the panel and the table of a series show for a state, without a window."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from dsl_app.compare.series.state import (
    NOTHING,
    SeriesDisplay,
    SeriesKind,
    SeriesRow,
    SeriesState,
    series_display,
)
from dsl_app.compare.series.table import RowTexts, row_texts

from dsl_core.evaluation.time_sweep import SweepPoint

A, B, GONE = Path("a.zarr"), Path("b.zarr"), Path("gone.zarr")


def state_of(
    paths: tuple[Path, ...], kind: SeriesKind, advice: str = "", busy: str = "", against: Path | None = None
) -> SeriesState:
    state = SeriesState()
    state.kind.set(kind)
    state.rows.set(tuple(SeriesRow(path) for path in paths))
    state.advice.set(advice)
    state.busy.set(busy)
    state.against.set(against)
    return state


TRUTH = ("Ground truth", None)


@pytest.mark.parametrize(
    ("state", "display"),
    [
        (
            state_of((), SeriesKind.STAGE),
            SeriesDisplay(NOTHING[SeriesKind.STAGE], False, True, False, False, (TRUTH,)),
        ),
        (
            state_of((A,), SeriesKind.STAGE, advice="Add two."),
            SeriesDisplay("Add two.", True, True, False, False, (TRUTH, ("a", A))),
        ),
        (
            state_of((A, B), SeriesKind.SWEEP, busy="Read a"),
            SeriesDisplay("Read a…", True, False, False, False, (TRUTH, ("a", A), ("b", B))),
        ),
        (
            state_of((A,), SeriesKind.SWEEP, against=GONE),
            SeriesDisplay("", True, False, False, True, (TRUTH, ("a", A), ("gone", GONE))),
        ),
    ],
)
def test_buttons_remark_and_references_follow_the_state(state: SeriesState, display: SeriesDisplay) -> None:
    assert series_display(state) == display


def test_only_a_selected_row_can_be_removed() -> None:
    state = state_of((A,), SeriesKind.STAGE)
    state.selected.set(GONE)
    assert not series_display(state).can_remove
    state.selected.set(A)
    assert series_display(state).can_remove


def test_rows_say_what_is_known_and_why_they_do_not_count() -> None:
    state = state_of((A, B), SeriesKind.STAGE)
    state.rows.set((replace(state.rows.value[0], position_mm=-3.5), SeriesRow(B, target_trouble="No plane.")))
    assert row_texts(state) == [
        RowTexts("a", ("-3.5", "–", "–", "–", "–"), "Not read yet"),
        RowTexts("b", ("", "–", "–", "–", "–"), "No plane.", True),
    ]


def test_of_scans_the_ones_that_no_faster_one_beats_are_named() -> None:
    state = state_of((A, B), SeriesKind.SWEEP)
    points = [
        SweepPoint(name=name, seconds=seconds, depth_mm=rmse_mm)
        for name, seconds, rmse_mm in (("a", 10.0, 0.5), ("b", 30.0, 0.9))
    ]
    state.rows.set(tuple(SeriesRow(path, point=point) for path, point in zip((A, B), points, strict=True)))
    texts = row_texts(state)
    assert [(row.numbers[0], row.remark) for row in texts] == [
        ("10.0", "No faster scan is better"),
        ("30.0", ""),
    ]


def test_of_scans_of_one_name_in_two_folders_the_better_one_is_named() -> None:
    monday, tuesday = Path("mon/scan.zarr"), Path("tue/scan.zarr")
    state = state_of((monday, tuesday), SeriesKind.SWEEP)
    state.rows.set(
        (
            SeriesRow(monday, point=SweepPoint("scan", 10.0, depth_mm=0.1)),
            SeriesRow(tuesday, point=SweepPoint("scan", 60.0, depth_mm=0.5)),
        )
    )
    assert [row.remark for row in row_texts(state)] == ["No faster scan is better", ""]


def test_a_position_is_shown_as_it_was_typed() -> None:
    state = state_of((), SeriesKind.STAGE)
    state.rows.set((SeriesRow(A, 1000.0025), SeriesRow(B, 700.0)))
    assert [texts.numbers[0] for texts in row_texts(state)] == ["1000.0025", "700"]
