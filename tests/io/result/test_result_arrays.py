from __future__ import annotations

import tracemalloc
from pathlib import Path

import numpy as np
import pytest

from dsl_core.errors import Cancelled
from dsl_core.io.result import result_arrays
from dsl_core.io.result.result_arrays import load_arrays
from dsl_core.io.result.result_file import save_result
from dsl_core.model.result import build_result
from dsl_core.progress import CallbackProgress, CancelToken

NM = np.arange(430.0, 661.0, 5.0)


@pytest.fixture
def stored(tmp_path: Path) -> Path:
    random = np.random.default_rng(0)
    cube = random.random((NM.size, 120, 200), np.float32)
    cube[:, 3, 4] = np.nan
    arrays: dict[str, np.ndarray] = {
        "depth_mm": 900 * cube[0],
        "points_mm": cube[:3],
        "reflectance": cube,
        "reflectance_std": 0.01 * cube,
        "data_share": cube,
        "reach": np.ones(cube.shape, np.uint8),
        "flags": np.zeros(cube.shape[1:], np.uint16),
    }
    return save_result(build_result(arrays, NM, {"rig": "twin"}), tmp_path / "a.zarr")


def test_everything_is_there_as_plain_arrays(stored: Path) -> None:
    result = load_arrays(stored)
    assert result.shape == (120, 200)
    assert result.has_spectra
    assert result["reflectance"].dtype == result["data_share"].dtype == np.float32
    assert result["reach"].dtype == np.uint8
    assert result.at("reflectance", (4, 3)).shape == NM.shape
    assert np.isnan(result.at("reflectance", (4, 3))).all()
    assert result.at("points_mm", (1, 2)).shape == (3,)
    assert result.holds((199, 119))
    assert not result.holds((200, 0))
    assert result.attributes["rig"] == "twin"


def test_memory_stays_near_that_of_the_result(stored: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(result_arrays, "AT_ONCE_BYTES", 400e3)  # four bands of this small one
    load_arrays(stored)  # what is imported on the way does not count
    tracemalloc.start()
    result = load_arrays(stored)
    _, most = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert most < 1.5 * sum(values.nbytes for values in result.arrays.values())


def test_reading_can_be_stopped(stored: Path) -> None:
    token = CancelToken()
    token.cancel()
    with pytest.raises(Cancelled):
        load_arrays(stored, CallbackProgress(lambda *_: None, token))
