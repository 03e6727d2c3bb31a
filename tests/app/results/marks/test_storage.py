"""Marks that are on disk stay there, whatever happens while they are read."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from dsl_app.results.controller import ResultsController
from dsl_app.results.marks import storage
from dsl_app.results.marks.storage import annotations_of
from dsl_app.results.state import Mark, ResultsState
from dsl_app.shared.spectrum import Spectrum
from dsl_app.shared.undo import UndoStack

from dsl_core.errors import StoreError
from dsl_core.io.result.annotations_file import Annotations, load_annotations, save_annotations
from dsl_core.io.result.result_file import load_result, save_result
from tests.app.support.doubles import InlineRunner, RecordingNotifier, WaitingRunner
from tests.app.support.results_controller import exports
from tests.app.support.small_result import BLUE, DARK, write_reference, write_small_result

MARKS = "small.marks.json"
SQUARE = ((1.5, 5.5), (6.5, 5.5), (6.5, 9.5), (1.5, 9.5))
READ_AGAIN, START_EMPTY = "Read again", "Rename the file and start with no marks"


class Bench:
    """A controller whose job that reads marks waits."""

    def __init__(self, path: Path, runner: InlineRunner | None = None) -> None:
        self.path = path
        self.runner = WaitingRunner("Marks")
        self.state, self.notifier, self.undo = ResultsState(), RecordingNotifier(), UndoStack()
        self.control = ResultsController(self.state, runner or self.runner, self.notifier, self.undo)
        assert self.control.open(path)

    @property
    def told(self) -> str:
        return self.notifier.told[-1][1]

    @property
    def names(self) -> list[str]:
        return [mark.name for mark in self.state.marks.value]

    @property
    def kept(self) -> Annotations:
        return load_annotations(self.path)


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """A result with three pins of one name and a region beside it."""
    path = write_small_result(tmp_path)
    first = Bench(path, InlineRunner())
    for x in (3, 4, 6):
        first.control.marks.pin((x, 3))
        first.control.marks.rename(first.state.marks.value[-1].key, "leaf")
    first.control.marks.add_outline(SQUARE)
    return path


def test_a_pin_that_is_set_while_marks_are_read_comes_behind_them(path: Path) -> None:
    bench = Bench(path)
    kept = bench.kept
    bench.control.marks.pin((20, 3))
    bench.control.marks.add_outline(SQUARE)
    assert bench.names == []
    assert bench.kept == kept
    assert "are being read" in bench.told
    bench.runner.run()
    assert bench.names == ["leaf", "leaf", "leaf", "region 1", "pin 1", "region 2"]
    assert [pin.name for pin in bench.kept.pins] == ["leaf", "leaf", "leaf", "pin 1"]
    bench.undo.undo()
    bench.undo.undo()
    assert bench.kept == kept


def test_a_reference_waits_too(path: Path) -> None:
    bench = Bench(path)
    bench.control.open(write_reference(path.with_name("tile.csv"), BLUE))
    assert bench.kept.references == ()
    bench.runner.run()
    assert bench.names[-1] == "tile"
    assert len(bench.kept.pins) == 3


def test_what_waits_for_the_marks_of_one_result_is_not_done_to_another(path: Path, tmp_path: Path) -> None:
    (tmp_path / "other").mkdir()
    other = write_small_result(tmp_path / "other")
    bench = Bench(path)
    bench.control.marks.pin((20, 3))
    bench.control.open(other)
    bench.runner.run()
    assert bench.names == []
    assert load_annotations(other) == Annotations()


@pytest.mark.parametrize("way", ["cancelled", "failed"])
def test_marks_that_could_not_be_read_are_not_replaced(
    path: Path, way: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    bench = Bench(path)
    before = path.with_name(MARKS).read_bytes()
    with monkeypatch.context() as patch:
        if way == "cancelled":
            bench.runner.waiting[0].cancel()
        else:

            def fail(*_: object) -> None:
                raise StoreError("the drive is gone.")

            patch.setattr(storage, "marks_of", fail)
        bench.runner.run()
    assert MARKS in bench.told
    assert ("cancelled" if way == "cancelled" else "the drive is gone") in bench.told
    for _ in range(2):
        bench.control.marks.pin((20, 3))
        assert "no mark is added" in bench.told
    assert path.with_name(MARKS).read_bytes() == before
    bench.notifier.offers[READ_AGAIN]()
    bench.runner.run()
    assert bench.names == ["leaf", "leaf", "leaf", "region 1"]
    bench.control.marks.pin((20, 3))
    assert len(bench.kept.pins) == 4


def test_starting_with_no_marks_keeps_the_file(path: Path) -> None:
    bench = Bench(path)
    before = path.with_name(MARKS).read_bytes()
    bench.control.marks.pin((20, 3))
    bench.runner.waiting[0].cancel()
    bench.runner.run()
    bench.notifier.offers[START_EMPTY]()
    assert "small.marks.damaged.json" in bench.told
    assert path.with_name("small.marks.damaged.json").read_bytes() == before
    assert [pin.pixel for pin in bench.kept.pins] == [(20, 3)]
    bench.notifier.offers[START_EMPTY]()
    bench.notifier.offers[READ_AGAIN]()
    assert bench.names == ["pin 1"]


def test_a_file_that_cannot_be_put_aside_is_not_replaced(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("dsl_app.results.marks.storage.set_aside", lambda _: "")
    path.with_name(MARKS).write_text("{")
    bench = Bench(path)
    assert "cannot be read" in bench.told
    bench.control.marks.pin((20, 3))
    bench.notifier.offers[START_EMPTY]()
    assert "cannot be renamed" in bench.told
    bench.control.marks.pin((20, 3))
    assert path.with_name(MARKS).read_text() == "{"
    assert bench.names == []


def test_an_offer_about_another_result_does_nothing(path: Path, tmp_path: Path) -> None:
    (tmp_path / "other").mkdir()
    other = write_small_result(tmp_path / "other")
    bench = Bench(path)
    bench.runner.waiting[0].cancel()
    bench.runner.run()
    bench.control.open(other)
    for do in bench.notifier.offers.values():
        do()
    assert path.with_name(MARKS).exists()
    assert bench.runner.waiting == []


def test_what_has_no_spectrum_now_stays_in_the_list_and_in_the_file(path: Path, tmp_path: Path) -> None:
    first = Bench(path, InlineRunner())
    first.control.marks.add_reference(write_reference(tmp_path / "tile.csv", BLUE))
    first.control.marks.show(False, first.state.marks.value[-1].key)
    kept = first.kept
    (tmp_path / "tile.csv").rename(tmp_path / "away.csv")
    changed = load_result(path).load()
    changed["reflectance"][:, :12, :5] = np.nan
    save_result(changed, path, overwrite=True)
    bench = Bench(path, InlineRunner())
    assert [(mark.name, bool(mark.trouble)) for mark in bench.state.marks.value] == [
        ("leaf", True),
        ("leaf", True),
        ("leaf", False),
        ("region 1", False),
        ("tile", True),
    ]
    assert bench.notifier.told[-1][0] == "warning"
    assert "leaf, leaf, tile" in bench.told
    assert "tile.csv" in bench.state.marks.value[-1].trouble
    bench.control.marks.pin((20, 3))
    assert bench.kept.pins[:3] == kept.pins
    assert bench.kept.references == kept.references
    (tmp_path / "away.csv").rename(tmp_path / "tile.csv")
    again = Bench(path, InlineRunner())
    assert again.state.marks.value[-1].curve is not None
    bench.control.marks.remove(bench.state.marks.value[0].key)
    assert len(bench.kept.pins) == 3


def test_marks_of_spectra_survive_a_result_without(path: Path, tmp_path: Path) -> None:
    kept = load_annotations(path)
    (tmp_path / "depth").mkdir()
    bench = Bench(write_small_result(tmp_path / "depth", spectra=False))
    save_annotations(kept, bench.path)
    bench.control.open(bench.path)
    bench.runner.run()
    assert annotations_of(bench.state.marks.value) == kept
    assert all(mark.trouble for mark in bench.state.marks.value)
    assert exports(bench.control).taken({"csv": tmp_path / "none.csv"}) == []


def test_marks_of_one_name_are_told_apart_without_their_arrays() -> None:
    one, other = (Mark("pin", "leaf", 0, Spectrum(BLUE, BLUE.copy()), pixel=DARK) for _ in range(2))
    state = ResultsState()
    told: list[tuple[Mark, ...]] = []
    state.marks.changed.connect(told.append)
    state.marks.set((one,))
    state.marks.set((other,))
    state.marks.set((other,))
    assert len(told) == 2


def test_what_another_window_saved_meanwhile_is_kept_aside(path: Path) -> None:
    one, other = (Bench(path, InlineRunner()) for _ in range(2))
    one.control.marks.pin((5, 5))
    other.control.marks.pin((2, 2))
    assert "Another window has changed the marks" in other.told
    before = len(other.notifier.told)
    other.control.marks.pin((4, 4))
    assert len(other.notifier.told) == before
    assert [pin.pixel for pin in other.kept.pins][-2:] == [(2, 2), (4, 4)]
    (aside,) = path.parent.glob("small.marks.damaged*")
    aside.replace(path.with_suffix(".marks.json"))
    assert [pin.pixel for pin in one.kept.pins][-1] == (5, 5)
