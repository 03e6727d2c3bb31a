"""Lenses whose focal lengths and principal point have names of their own are those of a matrix."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dsl_core.errors import CalibrationError
from dsl_core.io.published.any_stereo import FoundStereo, load_any_stereo

FX, FY, CX, CY = (1200.0, 1900.0), (1210.0, 1905.0), (640.0, 500.0), (512.0, 700.0)
DISTORTION = ((-0.1, 0.02, 0.001, -0.002, 0.003), (-0.05, 0.01, 0.0, 0.001, 0.0))
POSE: dict[str, Any] = {"R": np.eye(3).tolist(), "T": [-200.0, 10, 40]}


def read(tmp_path: Path, parts: dict[str, Any]) -> FoundStereo:
    path = tmp_path / "c.json"
    path.write_text(json.dumps({**parts, **POSE}), encoding="utf-8")
    return load_any_stereo(path, (1280, 1024), (1024, 768))


def _realsense(k: int) -> dict[str, Any]:
    return {"intrinsics": {"fx": FX[k], "fy": FY[k], "ppx": CX[k], "ppy": CY[k], "coeffs": DISTORTION[k]}}


def _nested(k: int) -> dict[str, Any]:
    terms = dict(zip(("k1", "k2", "p1", "p2", "k3"), DISTORTION[k], strict=True))
    return {"fx": FX[k], "fy": FY[k], "cx": CX[k], "cy": CY[k], **terms}


def _flat(k: int, form: str, device: str) -> dict[str, Any]:
    return {form.format(device, name): value for name, value in _nested(k).items()}


def _matlab(k: int) -> dict[str, Any]:
    k1, k2, p1, p2, k3 = DISTORTION[k]
    size = [(1024, 1280), (768, 1024)][k]
    return {"Intrinsics": {
        "FocalLength": [FX[k], FY[k]], "PrincipalPoint": [CX[k] + 1, CY[k] + 1], "ImageSize": size, "Skew": 0,
        "RadialDistortion": [k1, k2, k3], "TangentialDistortion": [p1, p2],
    }}  # fmt: skip


def _toolbox(k: int, side: str) -> dict[str, Any]:
    named = {"fc": [FX[k], FY[k]], "cc": [CX[k], CY[k]], "alpha_c": 0.0, "kc": DISTORTION[k]}
    return {f"{name}_{side}": value for name, value in named.items()}


@pytest.mark.parametrize(
    "parts",
    [
        {"camera": _realsense(0), "projector": _realsense(1)},
        {"camera": _nested(0), "projector": _nested(1)},
        {**_flat(0, "{}_{}", "cam"), **_flat(1, "{}_{}", "proj")},
        {**_flat(0, "{1}_{0}", "cam"), **_flat(1, "{1}_{0}", "proj")},
        {"CameraParameters1": _matlab(0), "CameraParameters2": _matlab(1)},
        {**_toolbox(0, "left"), **_toolbox(1, "right")},
    ],
)
def test_lengths_by_name_make_the_lenses(tmp_path: Path, parts: dict[str, Any]) -> None:
    found = read(tmp_path, parts)
    for k, lens in enumerate((found.stereo.camera, found.stereo.projector)):
        assert (lens.fx_px, lens.fy_px, lens.cx_px, lens.cy_px) == (FX[k], FY[k], CX[k], CY[k])
        assert lens.distortion == DISTORTION[k]
    assert found.assumed == ()
    is_matlab = any("PrincipalPoint is written as in MATLAB" in each for each in found.taken)
    assert is_matlab == ("CameraParameters1" in parts)


@pytest.mark.parametrize("skew", [{"skew": 12.0}, {"alpha_c": 0.01}])
def test_skew_next_to_lengths_is_refused(tmp_path: Path, skew: dict[str, float]) -> None:
    with pytest.raises(CalibrationError, match="and no skew"):
        read(tmp_path, {"camera": {**_nested(0), **skew}, "projector": _nested(1)})


def test_a_lens_with_a_length_missing_is_none(tmp_path: Path) -> None:
    partly = {name: value for name, value in _nested(0).items() if name != "cy"}
    with pytest.raises(CalibrationError, match="lacks camera matrix"):
        read(tmp_path, {"camera": partly, "projector": _nested(1)})


def test_places_in_a_matrix_are_no_terms_of_distortion(tmp_path: Path) -> None:
    places = {"k11": FX[0], "k12": 0.0, "k21": 0.0, "k22": FY[0]}
    lenses = {
        f"{name}{k + 1}": value[k]
        for name, value in zip(("fx", "fy", "cx", "cy"), (FX, FY, CX, CY), strict=True)
        for k in (0, 1)
    }
    found = read(tmp_path, {**lenses, **places})
    assert found.stereo.camera.distortion == (0, 0, 0, 0, 0)
