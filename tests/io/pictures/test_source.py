"""Pictures of a folder as a scan: their sizes, their bits, and what stands for white and black."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from dsl_core.errors import StoreError
from dsl_core.io.pictures.mapping import BlackPicture, Mapping, PhasePictures, StripePictures, WhitePicture
from dsl_core.io.pictures.source import open_pictures
from dsl_core.workflows.captures import sensor_of

RNG = np.random.default_rng(1)
FRAMES = [RNG.integers(0, 4000, (3, 5)).astype(np.uint16) for _ in range(4)]
WHITE, BLACK = np.full((3, 5), 4095, np.uint16), np.full((3, 5), 7, np.uint16)
CODE = StripePictures(bits=2)


def folder_of(folder: Path, *pictures: np.ndarray) -> Path:
    folder.mkdir(exist_ok=True)
    for i, picture in enumerate(pictures):
        assert cv2.imwrite(str(folder / f"im{i}.png"), picture)
    return folder


def test_frames_are_read_in_their_order_with_white_and_black(tmp_path: Path) -> None:
    mapping = Mapping(parts=(CODE, WhitePicture(), BlackPicture()), projector_size_px=(4, 6))
    scan = open_pictures(folder_of(tmp_path / "scan", *FRAMES, WHITE, BLACK), mapping)
    assert scan.made_up == ()
    assert (scan.plan.name, scan.plan.camera_size_px, scan.plan.projector_size_px) == ("scan", (5, 3), (4, 6))
    assert [(each.exposure_ms, each.level) for each in scan.plan.settings] == [(1.0, 1.0)]
    assert scan.plan.code_settings == (0,)
    assert scan.bit_depth == 16
    seen = {(shot.role, shot.pattern): scan.read(shot) for shot in scan.plan.shots()}
    for pattern, frame in enumerate(FRAMES):
        np.testing.assert_array_equal(seen["code", pattern], frame)
    np.testing.assert_array_equal(seen["white", 0], WHITE)
    np.testing.assert_array_equal(seen["black", 0], BLACK)


def test_extremes_of_each_pixel_stand_for_white_and_black(tmp_path: Path) -> None:
    mapping = Mapping(parts=(CODE,), projector_size_px=(4, 6), name="named", bit_depth=12)
    scan = open_pictures(folder_of(tmp_path, *FRAMES), mapping)
    assert scan.made_up == ("white", "black")
    assert (scan.plan.name, scan.bit_depth) == ("named", 12)
    seen = {shot.role: scan.read(shot) for shot in scan.plan.shots() if shot.role != "code"}
    np.testing.assert_array_equal(seen["white"], np.max(FRAMES, axis=0))
    np.testing.assert_array_equal(seen["black"], np.min(FRAMES, axis=0))


def test_bytes_have_eight_bits(tmp_path: Path) -> None:
    mapping = Mapping(parts=(CODE,), projector_size_px=(4, 6))
    small = [(frame >> 4).astype(np.uint8) for frame in FRAMES]
    assert open_pictures(folder_of(tmp_path, *small), mapping).bit_depth == 8


def test_a_picture_of_another_size_is_named(tmp_path: Path) -> None:
    mapping = Mapping(parts=(CODE,), projector_size_px=(4, 6))
    scan = open_pictures(folder_of(tmp_path, *FRAMES[:3], FRAMES[3][:2]), mapping)
    with pytest.raises(StoreError, match=r"is 5 x 2 px, the first 5 x 3 px"):
        scan.read(next(shot for shot in scan.plan.shots() if (shot.role, shot.pattern) == ("code", 3)))


def test_a_fingerprint_tells_pictures_and_mappings_apart_but_no_names(tmp_path: Path) -> None:
    mapping = Mapping(parts=(CODE,), projector_size_px=(4, 6))
    one, other = (
        folder_of(tmp_path / name, *FRAMES[:3], last) for name, last in (("a", FRAMES[3]), ("b", WHITE))
    )
    print_of = open_pictures(one, mapping).fingerprint()
    assert print_of == open_pictures(one, mapping).fingerprint()
    assert print_of == open_pictures(one, mapping.model_copy(update={"name": "x"})).fingerprint()
    assert print_of != open_pictures(other, mapping).fingerprint()
    assert (
        print_of != open_pictures(one, mapping.model_copy(update={"projector_size_px": (3, 6)})).fingerprint()
    )


@pytest.mark.parametrize(
    ("stated", "limit", "saturated"),
    [
        ({"bit_depth": 16, "full_scale": 16383}, 16383, 16383),
        ({"bit_depth": 14}, None, 16383),
        ({"bit_depth": 12, "left_aligned": True, "full_scale": 60000}, 3750, 3750),
        ({"bit_depth": 16, "full_scale": 65535}, None, 65535),
        ({"bit_depth": 16, "full_scale": 32767, "encoding": "srgb"}, 14027, 14027),
    ],
)
def test_pixels_are_saturated_where_values_end(
    tmp_path: Path, stated: dict[str, Any], limit: int | None, saturated: int
) -> None:
    white = np.full((8, 8), 9000, np.uint16)
    folder_of(tmp_path, *[white] * 4)
    mapping = Mapping(parts=(PhasePictures(fringes=(1.0,), steps=4),), projector_size_px=(64, 48), **stated)
    found = open_pictures(tmp_path, mapping)
    assert (found.limit_dn, found.full_scale_dn) == (limit, saturated)
    assert sensor_of(found).full_scale_dn == saturated
