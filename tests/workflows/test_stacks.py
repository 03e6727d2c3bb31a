"""Arrays are decoded and triangulated as files are."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from dsl_core.errors import CalibrationError, DecodeError
from dsl_core.model.captured_code import CapturedCode, Stripes
from dsl_core.model.plan import GrayCode
from dsl_core.resources import resource_path
from dsl_core.workflows.stacks import calibrate_stacks, decode_stack, depth_of_columns
from tests.cases import board_sets
from tests.cases.foreign_captures import PROJECTOR, frames, scene
from tests.cases.small_rig import small_rig

CODE = CapturedCode(column_sets=(Stripes(bits=7),))


def test_a_stack_tells_the_columns_of_the_scene_with_and_without_lights() -> None:
    pictures, white, black = frames([("columns", Stripes(bits=7))])
    results = (
        decode_stack(pictures, CODE, PROJECTOR, white, black),
        decode_stack(pictures, CODE, PROJECTOR),
    )
    for result in results:
        error = result["column_px"].values - scene().columns
        known = np.isfinite(error)
        assert known.mean() > 0.95
        assert np.percentile(np.abs(error[known]), 97) < 0.55


def test_pictures_of_true_and_false_are_decoded() -> None:
    pictures, *_ = frames([("columns", Stripes(bits=7))])
    pairs = zip(pictures[::2], pictures[1::2], strict=True)
    bits = [each for one, other in pairs for each in (one > other, other > one)]
    known = np.isfinite(decode_stack(bits, CODE, PROJECTOR)["column_px"].values)
    assert known.mean() > 0.5


def test_depth_of_columns_is_where_rays_meet_them() -> None:
    rig = small_rig()
    z = 600.0
    rows, columns = np.mgrid[: rig.camera.height_px, : rig.camera.width_px]
    plain = {"distortion": (0.0,) * 5}
    rig = rig.model_copy(
        update={
            "camera": rig.camera.model_copy(update=plain),
            "projector": rig.projector.model_copy(update=plain),
            "residual": None,
            "correspondence": None,
        }
    )
    ray = np.linalg.inv(rig.camera.matrix) @ np.stack([columns.ravel(), rows.ravel(), np.ones(rows.size)])
    point = rig.pose.matrix @ (ray * z) + rig.pose.vector_mm[:, None]
    column = (rig.projector.matrix @ point)[0] / point[2]
    column = column.reshape(rows.shape)
    column[0, 0] = np.nan
    depth = depth_of_columns(rig, column)
    assert np.isnan(depth[0, 0])
    assert np.allclose(depth.ravel()[1:], z, atol=1e-3)


def test_what_cannot_be_a_stack_is_refused() -> None:
    small = np.zeros((4, 4))
    with pytest.raises(DecodeError, match="The code has 14 pictures, given 2"):
        decode_stack([small, small], CODE, PROJECTOR)
    with pytest.raises(DecodeError, match="grey and of one size"):
        decode_stack([small, np.zeros((4, 5))], CODE, PROJECTOR)
    with pytest.raises(DecodeError, match="whole numbers from 0 to 65535"):
        decode_stack([small + 0.5] * 14, CODE, PROJECTOR)
    with pytest.raises(DecodeError, match="code and sizes: images must have 1 to 65535"):
        decode_stack([small] * 14, CODE, (0, 96), small + 9, small)
    with pytest.raises(DecodeError, match="White is not brighter than black"):
        decode_stack([small] * 14, CODE, PROJECTOR, small, small + 9)
    with pytest.raises(DecodeError, match="The columns have shape"):
        depth_of_columns(small_rig(), small)


@pytest.mark.slow
def test_the_example_of_the_help_page_runs() -> None:
    page = resource_path("help/importing.md").read_text(encoding="utf-8")
    (example,) = re.findall(r"```python\n(.*?)```", page, re.DOTALL)
    size = board_sets.CAMERA_PX
    pictures, white, black = frames([("columns", Stripes(bits=7, inverse=False))], camera=size)
    names: dict[str, Any] = {"pictures": pictures, "white": white, "black": black}
    names["poses"] = board_sets.board_set()
    exec(example, names)
    assert np.asarray(names["depth_mm"]).shape == size[::-1]
    rig = names["rig"]
    assert rig.rms_px < 0.1
    assert rig.camera.fx_px == pytest.approx(board_sets.CAMERA_FX_PX, rel=0.005)
    assert rig.projector.fx_px == pytest.approx(board_sets.PROJECTOR_FX_PX, rel=0.02)
    assert rig.camera.distortion == rig.projector.distortion == (0.0,) * 5
    depth = depth_of_columns(rig, board_sets.column_of_wall(600.0))
    assert np.nanmedian(depth) == pytest.approx(600.0, rel=0.005)


def test_poses_without_all_their_pictures_are_named() -> None:
    short = [np.zeros((4, 6))] * 2
    with pytest.raises(CalibrationError, match="Pose 1 has 2 pictures"):
        calibrate_stacks([short], board_sets.BOARD, board_sets.PROJECTOR_PX)


def test_rows_alone_are_told() -> None:
    pictures, white, black = frames([("rows", Stripes(bits=7))])
    code = CapturedCode(row_sets=(Stripes(bits=7),))
    result = decode_stack(pictures, code, PROJECTOR, white, black)
    error = result["row_px"].values - scene().rows
    known = np.isfinite(error)
    assert known.mean() > 0.95
    assert np.percentile(np.abs(error[known]), 97) < 0.55
    assert not np.isfinite(result["column_px"].values).any()


def test_dim_pictures_of_our_own_code_have_deviations_that_hold() -> None:
    rng = np.random.default_rng(1)
    captured, bright, dark = frames([("columns", Stripes(bits=7))])
    *pictures, white, black = (
        np.rint(0.05 * gaussian_filter(each.astype(float), 1) + 2 + rng.normal(0, 1.2, each.shape)).clip(0)
        for each in (*captured, bright, dark)
    )
    result = decode_stack(pictures, GrayCode(rows=False), PROJECTOR, white, black)
    std = result["column_std_px"].values
    off = np.abs(result["column_px"].values - scene().columns) / std
    known = np.isfinite(off)
    assert known.mean() > 0.55
    assert np.median(std[known]) > 0.3
    assert (off[known] > 3).mean() < 0.015


def test_columns_behind_a_mask_have_no_depth_and_words_are_no_columns() -> None:
    rig = small_rig()
    shape = (rig.camera.height_px, rig.camera.width_px)
    mask = np.zeros(shape, bool)
    mask[1] = True
    column = np.full(shape, rig.projector.width_px / 2)
    depth = depth_of_columns(rig, np.ma.masked_array(column, mask))
    assert np.isnan(depth[mask]).all()
    assert np.array_equal(depth[~mask], depth_of_columns(rig, column)[~mask], equal_nan=True)
    for given in ("a", [[1.0, 2.0], [3.0]]):
        with pytest.raises(DecodeError, match="an array of numbers"):
            depth_of_columns(rig, given)


def test_white_and_black_of_one_bit_are_those_of_pictures_of_one_bit() -> None:
    code = CapturedCode(column_sets=(Stripes(code="binary", bits=2, inverse=False),))
    shown = np.array([[[0, 0, 1, 1]], [[0, 1, 0, 1]]], bool)
    found = decode_stack(list(shown), code, (4, 1), np.ones((1, 4), bool), np.zeros((1, 4), bool))
    assert found["column_px"].values.round(2).tolist() == [[0.0, 1.0, 2.0, 3.0]]
