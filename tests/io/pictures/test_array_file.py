"""Arrays of NumPy and MATLAB give the pictures of the camera, whatever else is in their file."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.io
from numpy.typing import NDArray

from dsl_core.errors import StoreError
from dsl_core.io.pictures import array_file
from dsl_core.io.pictures.arrange import picture_files
from dsl_core.io.pictures.array_file import read_pictures
from dsl_core.io.pictures.picture_file import pictures_in
from tests.cases.foreign_captures import write

STACK = np.arange(7 * 9 * 12, dtype=np.uint16).reshape(7, 9, 12)
COLOUR = np.stack([STACK, STACK + 1, STACK + 2], -1)
EACH = {f"img{i}": picture for i, picture in enumerate([*STACK, *STACK, *STACK])}
OTHERS = {
    "patterns": np.zeros((5, 40, 60)),
    "depth": np.zeros((9, 12)),
    "name": np.array("a ball"),
    "K": np.eye(3),
}


@pytest.mark.parametrize(
    ("arrays", "wanted"),
    [
        ({"frames": STACK}, STACK),
        ({"frames": COLOUR}, COLOUR),
        ({"frames": STACK, **OTHERS}, STACK),
        ({"pattern_images": STACK}, STACK),
        ({"pattern_images": STACK[2:], "white": STACK[1], "black": STACK[0]}, STACK),
        (EACH, np.concatenate([STACK, STACK, STACK])),
        ({**EACH, **OTHERS}, np.concatenate([STACK, STACK, STACK])),
        ({"picture": STACK[0]}, STACK[0]),
    ],
)
@pytest.mark.parametrize("ending", ["npz", "mat"])
def test_pictures_are_found_among_other_arrays(
    tmp_path: Path, ending: str, arrays: dict[str, NDArray[Any]], wanted: NDArray[Any]
) -> None:
    path = tmp_path / f"a.{ending}"
    if ending == "npz":
        np.savez_compressed(path, **arrays)  # type: ignore[arg-type]
    else:
        is_stack = {name: array.ndim > 2 for name, array in arrays.items()}
        scipy.io.savemat(
            path, {name: np.moveaxis(a, 0, -1) if is_stack[name] else a for name, a in arrays.items()}
        )
    np.testing.assert_array_equal(read_pictures(path), wanted)
    assert len(pictures_in(path)) == (1 if wanted.ndim == 2 else len(wanted))


@pytest.mark.parametrize(
    ("arrays", "told"),
    [
        ({"left": STACK, "right": STACK}, r"left: 7 x 9 x 12, right: 7 x 9 x 12\), and none alone is"),
        ({"K": np.eye(3)}, r"K: 3 x 3\), and none alone is the pictures"),
        ({"name": np.array("a ball")}, "holds no array of numbers"),
    ],
)
def test_what_is_not_one_capture_is_refused_with_what_is_there(
    tmp_path: Path, arrays: dict[str, NDArray[Any]], told: str
) -> None:
    np.savez(tmp_path / "a.npz", **arrays)  # type: ignore[arg-type]
    with pytest.raises(StoreError, match=told):
        read_pictures(tmp_path / "a.npz")


@pytest.mark.parametrize("ending", ["npz", "mat"])
def test_more_than_fits_is_refused_before_it_is_read(
    tmp_path: Path, ending: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    # Zeros take little room in the file, and all of theirs in memory.
    frames = np.zeros((7, 300, 400), np.uint16)
    path = tmp_path / f"a.{ending}"
    if ending == "npz":
        np.savez_compressed(path, frames=frames)
    else:
        scipy.io.savemat(path, {"frames": np.moveaxis(frames, 0, -1)}, do_compression=True)
    assert read_pictures(path).shape == frames.shape
    monkeypatch.setattr(array_file, "MOST_BYTES", frames.nbytes - 1)
    with pytest.raises(StoreError, match=r"is larger than .* GB\. Save its pictures one by one"):
        read_pictures(path)


def test_cells_and_damaged_files_are_refused_with_what_to_do(tmp_path: Path) -> None:
    cells = np.empty(2, object)
    cells[:] = [STACK[0], STACK[1]]
    scipy.io.savemat(tmp_path / "cells.mat", {"pictures": cells})
    with pytest.raises(
        StoreError, match=r"holds cells\. Save one array of pictures, cat\(3, pictures\{:\}\)"
    ):
        read_pictures(tmp_path / "cells.mat")
    for name in ("a.npz", "a.mat", "a.npy"):
        (tmp_path / name).write_bytes(b"1234")
        with pytest.raises(StoreError, match=rf"{name} is not an array that can be read .* Save it again"):
            read_pictures(tmp_path / name)


def test_an_archive_next_to_pictures_is_something_else(tmp_path: Path) -> None:
    write(tmp_path, {f"{i}.png": picture for i, picture in enumerate(STACK)})
    np.savez(tmp_path / "calibration.npz", K=np.eye(3))
    assert [path.name for path in picture_files(tmp_path, ("*",))] == [f"{i}.png" for i in range(7)]


@pytest.mark.parametrize(
    ("names", "taken"),
    [
        (("white", "black", "dark", "ambient"), ("black", "white")),
        (("white", "dark", "ambient"), ("ambient", "white")),
        (("white", "dark"), ("dark", "white")),
        (("light_on", "light_off", "dark"), ("light_off", "light_on")),
    ],
)
def test_an_archive_has_one_black_and_it_is_that_of_the_projector(
    tmp_path: Path, names: tuple[str, ...], taken: tuple[str, ...]
) -> None:
    lights = {name: STACK[0] + 3 * k for k, name in enumerate(names)}
    np.savez(tmp_path / "a.npz", images=STACK, **lights)
    wanted = np.concatenate([np.stack([lights[name] for name in taken]), STACK])
    np.testing.assert_array_equal(read_pictures(tmp_path / "a.npz"), wanted)
