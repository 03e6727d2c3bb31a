"""Published dataset folders: frames come back to the bit, and every flaw of a folder is told."""

from __future__ import annotations

import re
import shutil
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from dsl_core.errors import Cancelled, StoreError
from dsl_core.io.published.dataset import export_dataset, open_dataset
from dsl_core.io.published.layout import FileRecord, survey
from dsl_core.model.plan import CapturePlan, ScanLines, Setting, Shot
from dsl_core.progress import CallbackProgress

PLAN = CapturePlan(
    camera_size_px=(10, 7),
    projector_size_px=(16, 8),
    spectral=ScanLines(width_px=5, step_px=2),
    settings=(Setting(exposure_ms=160, level=0.2), Setting(exposure_ms=320, level=0.8)),
    code_settings=(0,),
)


@dataclass(frozen=True)
class Memory:
    """Random 12-bit mosaics, the same ones for a shot every time."""

    plan: CapturePlan = PLAN

    def read(self, shot: Shot) -> NDArray[np.uint16]:
        width, height = self.plan.camera_size_px
        return np.random.default_rng(shot.index).integers(0, 4096, (height, width), np.uint16)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    export_dataset(Memory(), tmp_path / "scene")
    return tmp_path / "scene"


def _table(folder: Path) -> dict[str, FileRecord]:
    return {record.expected or str(record.found): record for record in survey(folder, PLAN).records}


@pytest.mark.parametrize("bayer", ["RGGB", "GBRG"])
@pytest.mark.parametrize("bit_depth", [12, 16])
def test_a_scan_comes_back_to_the_bit(tmp_path: Path, bayer: str, bit_depth: int) -> None:
    export_dataset(
        Memory(),
        tmp_path / "scene",
        bayer=bayer,  # type: ignore[arg-type]
        bit_depth=bit_depth,
    )
    scan = open_dataset(tmp_path / "scene", bayer=bayer, bit_depth=bit_depth)  # type: ignore[arg-type]
    assert scan.plan == PLAN
    assert {record.status for record in scan.table} == {"ok", "optional"}
    for shot in scan.plan.shots():
        np.testing.assert_array_equal(scan.read(shot), Memory().read(shot))


def test_files_are_laid_out_as_published(folder: Path) -> None:
    names = {path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file()}
    lines = {f"ldr_exposure{k}/capture_{n:04d}.png" for k in (1, 2) for n in range(6)}
    single = {f"{name}/capture_0000.png" for name in ("intensity1", "black_exposure1", "black_exposure2")}
    code = {f"graycode_exposure1/graycode_{n:02d}.png" for n in range(14)}
    assert names == lines | single | code | {"plan.json"}
    image = cv2.imread(str(folder / "ldr_exposure2" / "capture_0003.png"), cv2.IMREAD_UNCHANGED)
    assert image is not None
    assert image.shape == (7, 10, 3)
    assert image.dtype == np.uint16
    shot = next(s for s in PLAN.shots() if (s.role, s.setting, s.pattern) == ("spectral", 1, 3))
    # Red at the first pixel of RGGB, left-aligned; OpenCV's order is B, G, R.
    assert image[0, 0, 2] == Memory().read(shot)[0, 0] * 16


def test_without_a_plan_the_published_one_is_taken(folder: Path) -> None:
    (folder / "plan.json").unlink()
    scan = open_dataset(folder)
    assert scan.plan.camera_size_px == (10, 7)
    assert scan.plan.spectral_count == 318
    assert [(s.exposure_ms, s.level) for s in scan.plan.settings] == [(160, 0.2), (320, 0.8)]
    statuses = [r.status for r in scan.table if r.expected.startswith("ldr_exposure1/")]
    assert (statuses.count("ok"), statuses.count("missing")) == (6, 312)


def test_names_of_the_readme_are_known(folder: Path) -> None:
    for path in (folder / "ldr_exposure1").iterdir():
        path.rename(path.with_name(f"scene under white scanline pattern {int(path.stem[-4:])}.png"))
    assert {r.status for r in _table(folder).values() if r.expected.startswith("ldr")} == {"ok"}


def test_folders_of_earlier_versions_are_known(folder: Path) -> None:
    for new, old in (
        ("ldr_exposure1", "step2_160ms_crop"),
        ("black_exposure2", "step2_320ms_black_crop"),
        ("intensity1", "intensity_20_white_crop"),
    ):
        (folder / old).mkdir()
        (folder / new).rename(folder / old / "calibration00")
    table = _table(folder)
    assert table["ldr_exposure1/capture_0002.png"].status == "ok"
    assert table["ldr_exposure1/capture_0002.png"].found == "step2_160ms_crop/calibration00/capture_0002.png"
    assert table["black_exposure2/capture_0000.png"].status == "ok"
    assert table["intensity1/capture_0000.png"].status == "ok"


def _spoil(folder: Path, name: str) -> None:
    """Make one flaw of each kind in the frames of the first setting."""
    path = folder / "ldr_exposure1" / "capture_0002.png"
    image = np.asarray(cv2.imread(str(path), cv2.IMREAD_UNCHANGED))
    match name:
        case "missing":
            path.unlink()
        case "misnamed":
            path.rename(path.with_name("line2.png"))
        case "wrong size":
            cv2.imwrite(str(path), image[:, :5])
        case "wrong type":
            cv2.imwrite(str(path), image[..., 0])
        case "unreadable":
            path.write_bytes(path.read_bytes()[:-20])
        case "no image":
            path.write_bytes(b"hello")


@pytest.mark.parametrize(
    ("flaw", "status", "advice"),
    [
        ("missing", "missing", "capture it again"),
        ("misnamed", "misnamed", r"rename it to capture_0002\.png"),
        ("wrong size", "wrong size", "is 5 x 7 px, 10 x 7 is needed"),
        ("wrong type", "wrong type", r"1 channel\(s\) of 16 bit"),
        ("unreadable", "unreadable", "is cut off"),
        ("no image", "unreadable", "is not a PNG image"),
    ],
)
def test_every_flaw_has_a_line_and_an_error(folder: Path, flaw: str, status: str, advice: str) -> None:
    _spoil(folder, flaw)
    table = _table(folder)
    record = table["ldr_exposure1/capture_0002.png"]
    assert record.status == status
    assert re.search(advice, record.advice)
    assert {r.status for r in table.values() if r not in (record, table["depth.npy"])} == {"ok"}
    scan = open_dataset(folder)
    shot = next(s for s in PLAN.shots() if (s.role, s.setting, s.pattern) == ("spectral", 0, 2))
    if status == "misnamed":
        np.testing.assert_array_equal(scan.read(shot), Memory().read(shot))
    else:
        with pytest.raises(StoreError, match=rf"ldr_exposure1/capture_0002\.png is {status}: .*{advice}"):
            scan.read(shot)


def test_numbers_that_start_at_one_are_understood(folder: Path) -> None:
    for number in range(5, -1, -1):
        path = folder / "ldr_exposure1" / f"capture_{number:04d}.png"
        path.rename(path.with_name(f"capture_{number + 1:04d}.png"))
    record = _table(folder)["ldr_exposure1/capture_0005.png"]
    assert (record.status, record.found) == ("misnamed", "ldr_exposure1/capture_0006.png")
    assert "start at 1" in record.advice
    shot = next(s for s in PLAN.shots() if (s.role, s.setting, s.pattern) == ("spectral", 0, 5))
    np.testing.assert_array_equal(open_dataset(folder).read(shot), Memory().read(shot))


def test_a_first_frame_that_is_missing_is_not_taken_for_other_numbers(folder: Path) -> None:
    (folder / "ldr_exposure1" / "capture_0000.png").unlink()
    table = _table(folder)
    assert table["ldr_exposure1/capture_0000.png"].status == "missing"
    assert table["ldr_exposure1/capture_0001.png"].status == "ok"


def test_repeated_and_surplus_files_are_told_and_not_used(folder: Path) -> None:
    lines = folder / "ldr_exposure1"
    shutil.copy(lines / "capture_0001.png", lines / "a copy 1.png")
    shutil.copy(lines / "capture_0001.png", lines / "capture_0006.png")
    shutil.copy(lines / "capture_0001.png", lines / "white.png")
    shutil.copy(lines / "capture_0001.png", folder / "black_exposure1" / "capture_0001.png")
    table = _table(folder)
    extra = {name for name, record in table.items() if record.status == "extra"}
    assert extra == {
        "ldr_exposure1/a copy 1.png",
        "ldr_exposure1/capture_0006.png",
        "ldr_exposure1/white.png",
        "black_exposure1/capture_0001.png",
    }
    assert table["ldr_exposure1/capture_0001.png"].found == "ldr_exposure1/capture_0001.png"


def test_a_folder_misnamed_in_case_and_signs(folder: Path) -> None:
    (folder / "ldr_exposure2").rename(folder / "LDR exposure2")
    record = _table(folder)["ldr_exposure2/capture_0000.png"]
    assert (record.status, record.advice) == ("misnamed", "used; rename the folder to ldr_exposure2")


def test_a_missing_folder_has_one_line(folder: Path) -> None:
    shutil.rmtree(folder / "graycode_exposure1")
    shutil.rmtree(folder / "ldr_exposure2")
    table = _table(folder)
    assert table["graycode_exposure1/"].status == table["ldr_exposure2/"].status == "missing"
    assert "(14 images)" in table["graycode_exposure1/"].advice
    scan = open_dataset(folder)
    with pytest.raises(
        StoreError, match=r"graycode_exposure1 is missing: .*depth\.npy alone cannot be imported"
    ):
        scan.read(next(scan.plan.shots()))


def test_eight_bit_images_are_read_and_told(folder: Path) -> None:
    path = folder / "ldr_exposure1" / "capture_0000.png"
    image = np.asarray(cv2.imread(str(path), cv2.IMREAD_UNCHANGED))
    cv2.imwrite(str(path), (image >> 8).astype(np.uint8))
    record = _table(folder)["ldr_exposure1/capture_0000.png"]
    assert (record.status, record.advice[:10]) == ("ok", "8 bit only")
    shot = next(s for s in PLAN.shots() if (s.role, s.setting, s.pattern) == ("spectral", 0, 0))
    np.testing.assert_array_equal(open_dataset(folder).read(shot), Memory().read(shot) & 0xFF0)


def test_frames_demosaiced_by_opencv_give_the_raw_frame_inside_the_border(folder: Path) -> None:
    shot = next(s for s in PLAN.shots() if (s.role, s.setting, s.pattern) == ("spectral", 0, 0))
    raw = Memory().read(shot)
    image = cv2.cvtColor(raw << np.uint16(4), cv2.COLOR_BayerRGGB2BGR)
    cv2.imwrite(str(folder / "ldr_exposure1" / "capture_0000.png"), image)
    np.testing.assert_array_equal(open_dataset(folder).read(shot)[1:-1, 1:-1], raw[1:-1, 1:-1])


def test_a_truncated_body_is_an_error_and_no_picture(folder: Path) -> None:
    path = folder / "ldr_exposure1" / "capture_0000.png"
    data = path.read_bytes()
    path.write_bytes(data[:33] + data[-12:])  # header and end, nothing between
    shot = next(s for s in PLAN.shots() if (s.role, s.setting, s.pattern) == ("spectral", 0, 0))
    with pytest.raises(StoreError, match="cannot be decoded"):
        open_dataset(folder).read(shot)


def test_folders_that_are_no_dataset(tmp_path: Path, folder: Path) -> None:
    with pytest.raises(StoreError, match="is not a folder"):
        open_dataset(tmp_path / "nowhere")
    (tmp_path / "empty" / "ldr_exposure1").mkdir(parents=True)
    with pytest.raises(StoreError, match="not a published dataset"):
        open_dataset(tmp_path / "empty")
    (folder / "plan.json").write_text("{")
    with pytest.raises(StoreError, match="not a capture plan"):
        open_dataset(folder)


def test_a_cancelled_export_leaves_nothing_and_replaces_nothing(tmp_path: Path, folder: Path) -> None:
    progress = CallbackProgress(lambda stage, done, total: progress.token.cancel() if done == 3 else None)
    with pytest.raises(Cancelled):
        export_dataset(Memory(), tmp_path / "new", progress=progress)
    assert [path.name for path in tmp_path.iterdir()] == ["scene"]
    with pytest.raises(StoreError, match="already exists"):
        export_dataset(Memory(), folder)


def test_other_pixels_make_another_dataset_and_another_place_does_not(tmp_path: Path, folder: Path) -> None:
    before = open_dataset(folder).fingerprint()
    elsewhere = shutil.copytree(folder, tmp_path / "elsewhere")
    assert open_dataset(elsewhere).fingerprint() == before
    file = elsewhere / "intensity1/capture_0000.png"
    cv2.imwrite(str(file), np.asarray(cv2.imread(str(file), cv2.IMREAD_UNCHANGED)) ^ 1)
    assert open_dataset(elsewhere).fingerprint() != before


def _change(folder: Path, change: Callable[[NDArray[np.uint16]], NDArray[np.uint16]]) -> None:
    for path in folder.rglob("*.png"):
        image = np.asarray(cv2.imread(str(path), cv2.IMREAD_UNCHANGED), np.uint16)
        cv2.imwrite(str(path), change(image))


def test_values_at_the_lower_end_of_16_bits_are_refused(folder: Path) -> None:
    _change(folder, lambda image: image >> np.uint16(4))
    with pytest.raises(
        StoreError, match=r"holds a value above 4095, .* right-aligned.*Multiply all values by 16"
    ):
        open_dataset(folder).require_frames()
    # A camera of 16 bits has no room for another alignment.
    open_dataset(folder, bit_depth=16).require_frames()


def test_dark_frames_and_interpolated_values_are_not_taken_for_right_aligned_ones(folder: Path) -> None:
    def dark(image: NDArray[np.uint16]) -> NDArray[np.uint16]:
        raw = np.full(image.shape[:2], 16 * 3, np.uint16)
        raw[::2, ::3] = 16 * 200
        return np.asarray(cv2.cvtColor(raw, cv2.COLOR_BayerRGGB2BGR), np.uint16)

    _change(folder, dark)
    open_dataset(folder).require_frames()


def test_images_are_read_below_names_that_opencv_cannot_open(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def imread(*_: object) -> None:
        """On Windows, OpenCV opens no path with characters of other languages."""

    monkeypatch.setattr(cv2, "imread", imread)
    shot = next(PLAN.shots())
    np.testing.assert_array_equal(open_dataset(folder).read(shot), Memory().read(shot))
