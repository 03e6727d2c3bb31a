"""A result that another process replaces while it is opened is read whole: of the old one, or of the new."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from dsl_core.errors import StoreError
from dsl_core.io.result import result_file
from dsl_core.io.result.result_arrays import load_arrays
from dsl_core.io.result.result_file import load_result, save_result
from tests.cases.small_result import small_result


def _save(path: Path, depth_mm: float, rows: int = 6) -> None:
    result = small_result().isel(y=slice(0, rows))
    result = result.assign(depth_mm=result["depth_mm"] * 0 + np.float32(depth_mm))
    save_result(result.assign_attrs(depth_mm=depth_mm), path, overwrite=True)


def _of_result(path: Path) -> tuple[float, float]:
    result = load_result(path)
    return float(result.attrs["depth_mm"]), float(np.nanmax(result["depth_mm"]))


def _of_arrays(path: Path) -> tuple[float, float]:
    result = load_arrays(path)
    return float(result.attributes["depth_mm"]), float(np.nanmax(result["depth_mm"]))


@pytest.fixture
def replaced(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[[int, int], Path]:
    """A result that is replaced so many times, by others of so many rows, when its attributes are read."""
    path, read = tmp_path / "a.zarr", result_file.read_attributes
    _save(path, 1.0)

    def prepare(times: int, rows: int) -> Path:
        left = list(range(times))

        def read_and_replace(at: Path) -> dict[str, object]:
            found = read(at)
            if left:
                _save(at, float(found["depth_mm"]) + 1, rows)
            left[:] = left[1:]
            return found

        monkeypatch.setattr(result_file, "read_attributes", read_and_replace)
        return path

    return prepare


@pytest.mark.parametrize("rows", [6, 4])
@pytest.mark.parametrize("read", [_of_result, _of_arrays])
def test_attributes_are_those_of_the_arrays(
    replaced: Callable[[int, int], Path], read: Callable[[Path], tuple[float, float]], rows: int
) -> None:
    assert read(replaced(2, rows)) == (3.0, 3.0)


@pytest.mark.parametrize("read", [load_result, load_arrays])
def test_one_that_does_not_keep_still_is_told(
    replaced: Callable[[int, int], Path], read: Callable[[Path], object]
) -> None:
    with pytest.raises(StoreError, match=r"a\.zarr was replaced 5 times while it was read\. Wait"):
        read(replaced(9, 6))
