"""A controller of results without a window."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from dsl_app.results.controller import ResultsController
from dsl_app.results.export.controller import ExportController
from dsl_app.results.state import ResultsState
from dsl_app.shared.undo import UndoStack

from dsl_core.io.result.result_arrays import ResultArrays
from dsl_core.io.result.result_file import load_result, save_result
from tests.app.support.doubles import InlineRunner, RecordingNotifier
from tests.app.support.small_result import write_small_result

#: Corners of five by four pixels of the small result.
SQUARE = ((1.5, 5.5), (6.5, 5.5), (6.5, 9.5), (1.5, 9.5))


class Bench:
    """A controller on a small result, without a window."""

    def __init__(self, path: Path) -> None:
        self.state, self.undo, self.notifier = ResultsState(), UndoStack(), RecordingNotifier()
        self.control = ResultsController(self.state, InlineRunner(self.notifier), self.notifier, self.undo)
        assert self.control.open(path)

    @property
    def told(self) -> str:
        return self.notifier.told[-1][1]

    @property
    def names(self) -> list[str]:
        return [mark.name for mark in self.state.marks.value]


def opened(state: ResultsState) -> ResultArrays:
    """The result that is open."""
    assert state.result.value is not None
    return state.result.value


def exports(control: ResultsController) -> ExportController:
    """What writes files of the result that is open, as it is looked at now."""
    made = control.export()
    assert made is not None
    return made


@pytest.fixture
def bench(tmp_path: Path) -> Bench:
    return Bench(write_small_result(tmp_path))


@pytest.fixture
def lacking(tmp_path: Path) -> Bench:
    """A controller on a result of which no pixel has the band at 545 nm."""
    result = load_result(write_small_result(tmp_path / "whole")).load()
    result["reflectance"].loc[{"wavelength_nm": 545.0}] = np.nan
    return Bench(save_result(result, tmp_path / "lacking.zarr"))
