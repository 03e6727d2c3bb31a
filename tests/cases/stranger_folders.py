"""Samples of readers of whole folders: of begun results, proofs, poses, datasets to import, scans to lenses.

See `strangers`, whose changes they get.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np

from tests.cases.small_rig import small_rig
from tests.cases.strangers import Sample, make_dataset, make_scan


def _make_begun(folder: Path) -> None:
    """A scan and the beginning of its result, which lacks its second band of rows."""
    from dsl_core.io.scan.folder import ScanReader
    from dsl_core.model.options import Options

    make_scan(folder)
    manifest = ScanReader(folder / "a.dsl").manifest.model_dump_json()
    options = repr(Options(spectra=False))
    facts = json.dumps(["1", manifest, {}, small_rig().model_dump_json(), options])
    work = folder / ".a.zarr.unfinished"
    (work / "result.zarr").mkdir(parents=True)
    (work / "key.json").write_text(f"{facts}\n(8, 12) (0, 0) 4 [430.0, 440.0]")
    (work / "rows.0.4.json").write_text("{}")


def _read_begun(folder: Path) -> object:
    from dsl_core.workflows.unfinished import unfinished_results

    return unfinished_results(folder)


def _make_proof(folder: Path) -> None:
    from dsl_core.io.scan.folder import ScanReader
    from dsl_core.io.scan.proof_file import save_proof
    from dsl_core.model.scan_proof import ScanProof

    make_scan(folder)
    save_proof(
        ScanReader(folder / "a.dsl"),
        small_rig(),
        ScanProof(judged=3, untold=1, wrong=("Frame 2 does not show its pattern.",)),
    )


def _read_proof(folder: Path) -> object:
    from dsl_core.io.scan.folder import ScanReader
    from dsl_core.io.scan.proof_file import read_proof

    return read_proof(ScanReader(folder / "a.dsl"), small_rig())


def _make_poses(folder: Path) -> None:
    import cv2

    for pose in range(2):
        place = folder / "poses" / f"capture_{pose}"
        place.mkdir(parents=True)
        for number in range(6):
            data = cv2.imencode(".png", np.full((8, 12), 20 * number, np.uint8))[1]
            (place / f"graycode_{number:02d}.png").write_bytes(data.tobytes())


def _read_poses(folder: Path) -> object:
    from dsl_core.workflows.pictures import pose_folders, read_pose

    return [read_pose(pose, (1, 1)) for pose in pose_folders(folder / "poses")]


def _look_at(name: str) -> Callable[[Path], object]:
    def read(folder: Path) -> object:
        from dsl_core.workflows.exchange import look_at

        return look_at(folder / name, small_rig())

    return read


def _make_published(folder: Path) -> None:
    """Lenses and pose with the tables of a published calibration."""
    from dsl_core.io.published.calibration import STEREO_NAME, TABLE_FOLDER
    from dsl_core.io.published.stereo import Stereo, save_stereo

    rig, made = small_rig(), folder / "made"
    for place in (made / TABLE_FOLDER, (made / STEREO_NAME).parent):
        place.mkdir(parents=True, exist_ok=True)
    save_stereo(Stereo(camera=rig.camera, projector=rig.projector, pose=rig.pose), made / STEREO_NAME)
    for name, shape in (("CRF", (24, 3)), ("PEF", (24, 3)), ("DG", (3, 24))):
        np.save(made / TABLE_FOLDER / f"{name}.npy", np.full(shape, 0.5))


FOLDERS = (
    Sample("begun result", _make_begun, ".a.zarr.unfinished/key.json", _read_begun),
    Sample("proof", _make_proof, "a.dsl/proof.json", _read_proof),
    Sample("poses", _make_poses, "poses/capture_1/graycode_03.png", _read_poses),
    Sample("import: image", make_dataset, "ldr_exposure1/capture_0001.png", _look_at("")),
    Sample("import: lenses", _make_published, "made/calibration/calibration_propcam.xml", _look_at("made")),
    Sample("import: table", _make_published, "made/dataset/image_formation/DG.npy", _look_at("made")),
)
