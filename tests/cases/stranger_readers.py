"""Samples of further readers: of what is received, lies in the folders of this program, or is a list.

See `strangers`, whose changes they get.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any

import numpy as np

from tests.cases.small_result import small_result
from tests.cases.small_rig import small_rig
from tests.cases.stranger_folders import FOLDERS
from tests.cases.strangers import Sample, make_scan, small_plan

#: Attributes of a result, each JSON of its own, with something in it.
_ATTRIBUTES: dict[str, Any] = {
    "stage_costs": [{"name": "columns", "seconds": 1.5, "peak_bytes": 10, "start_bytes": 5}],
    "frames_in_doubt": ["Frame 3 does not show its pattern."],
    "calibration_missed": ["geometry: 2 px"],
    "fit": {"findings": [], "model_error": []},
    "capture_seconds": 12.5,
    "captured": "2026-01-01T00:00:00+00:00",
    "scanned_with": "twin",
    "scanned_with_options": {"stage_mm": "700"},
}


def _make_attributes(folder: Path) -> None:
    attributes = _ATTRIBUTES | {"capture_plan": json.loads(small_plan().model_dump_json())}
    (folder / "attributes.json").write_text(json.dumps(attributes))


def _read_attributes(folder: Path) -> object:
    """Everything that tells something from attributes, of a result that is otherwise sound."""
    from dsl_core.evaluation.report.scan_report import report_content
    from dsl_core.io.reading import read_json
    from dsl_core.workflows.batch.task import doubts_of
    from dsl_core.workflows.series import position_of, seconds_of

    try:
        content = read_json(folder / "attributes.json")
    except (OSError, ValueError):
        return None
    if not isinstance(content, dict):
        return None
    # Text of a result holds JSON as text; numbers and plain text are kept.
    attributes = {
        str(key): value if isinstance(value, str | int | float) else json.dumps(value)
        for key, value in content.items()
    }
    result = small_result().assign_attrs(attributes)
    path = folder / "a.zarr"
    return (
        report_content("a", result),
        doubts_of(result),
        position_of(path, attributes),
        seconds_of(attributes),
    )


def _make_profile(folder: Path) -> None:
    part = {"driver": "twin", "settings": {"size": "12x8", "scene": "plane"}}
    profile = {"schema_version": 1, "name": "lab", "camera": part, "projector": part, "note": "ours"}
    (folder / "lab.json").write_text(json.dumps(profile))


def _read_profile(folder: Path) -> object:
    from dsl_core.io.rig_profile import load_profile

    return load_profile(folder / "lab.json")


def _make_library(folder: Path) -> None:
    from dsl_core.io.calibration_library import CalibrationLibrary

    CalibrationLibrary(folder).store("lab", small_rig())
    (version,) = (folder / "lab" / "versions").iterdir()
    version.rename(version.with_name("20260101-000000-000000.json"))
    (folder / "lab" / "current").write_text("20260101-000000-000000")


def _read_library(folder: Path) -> object:
    from dsl_core.io.calibration_library import CalibrationLibrary

    library = CalibrationLibrary(folder)
    return library.lines(), library.find("lab")


_STEREO: dict[str, Any] = {
    "cam_K": [[900.0, 0.0, 320.0], [0.0, 900.0, 180.0], [0.0, 0.0, 1.0]],
    "cam_dist": [0.1, -0.05, 0.0, 0.0, 0.01],
    "proj_K": [[700.0, 0.0, 320.0], [0.0, 700.0, 180.0], [0.0, 0.0, 1.0]],
    "R": [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
    "T": [100.0, 0.0, 0.0],
    "camera_size": [640, 360],
    "projector_size": [640, 360],
}


def _make_any_stereo(folder: Path) -> None:
    (folder / "b.json").write_text(json.dumps(_STEREO))
    lines = [f"{name}: {json.dumps(value)}" for name, value in _STEREO.items()]
    (folder / "b.yml").write_text("\n".join(["%YAML:1.0", "---", *lines]))
    rows = [f"<{name}>{' '.join(map(str, np.ravel(value)))}</{name}>" for name, value in _STEREO.items()]
    (folder / "b.xml").write_text(
        "<?xml version='1.0'?>\n<opencv_storage>\n" + "\n".join(rows) + "\n</opencv_storage>"
    )


def _read_any_stereo(name: str) -> Callable[[Path], object]:
    def read(folder: Path) -> object:
        from dsl_core.errors import CalibrationError
        from dsl_core.io.published.any_stereo import load_any_stereo

        try:
            return load_any_stereo(folder / name, (640, 360), (640, 360))
        except CalibrationError:
            return load_any_stereo(folder / name, (640, 360), (640, 360), inverse=True)

    return read


_CURVES = "\n".join(
    ["wavelength_nm,R,G,B"]
    + [
        f"{nm},{','.join(f'{np.exp(-(((nm - centre) / 40) ** 2)):.4f}' for centre in (620, 540, 460))}"
        for nm in range(400, 701, 10)
    ]
)


def _make_curves(folder: Path) -> None:
    (folder / "curves.csv").write_text(_CURVES)


def _read_curves(folder: Path) -> object:
    from dsl_core.io.published.curves import load_curves

    return load_curves(folder / "curves.csv", "camera")


def _make_pictures(folder: Path) -> None:
    """Four bits of columns with their inverses, white and black, as files of each format."""
    import cv2
    import OpenEXR
    import scipy.io

    height, width = 12, 32
    columns = np.repeat(np.arange(16) ^ (np.arange(16) >> 1), width // 16)
    shown = [(columns >> bit & 1) ^ inverse for bit in (3, 2, 1, 0) for inverse in (0, 1)]
    rows = [*shown, np.ones(width, int), np.zeros(width, int)]
    noise = np.random.default_rng(7).integers(0, 4, (len(rows), height, width))
    pictures = [
        (np.tile(10 + 200 * row, (height, 1)) + n).astype(np.uint8)
        for row, n in zip(rows, noise, strict=True)
    ]
    for name, _ in _PICTURE_FILES:
        (folder / name).mkdir()
    for name in ("png", "bmp", "pgm", "tif", "jpg", "webp"):
        for number, picture in enumerate(pictures):
            content = cv2.imencode(f".{name}", picture)[1].tobytes()
            (folder / name / f"{number:02d}.{name}").write_bytes(content)
    for number, values in enumerate(np.array(pictures, np.float32)):
        OpenEXR.File({}, {"Y": values}).write(str(folder / "exr" / f"{number:02d}.exr"))
        head = f"Pf\n{width} {height}\n-1.0\n".encode()
        (folder / "pfm" / f"{number:02d}.pfm").write_bytes(head + values[::-1].astype("<f4").tobytes())
    (folder / "paged" / "all.tif").write_bytes(cv2.imencodemulti(".tif", pictures)[1].tobytes())
    np.save(folder / "npy" / "all.npy", np.array(pictures))
    np.savez_compressed(folder / "npz" / "all.npz", frames=np.array(pictures))
    scipy.io.savemat(folder / "mat" / "all.mat", {"frames": np.stack(pictures, -1)})
    for number, picture in enumerate(pictures):
        (folder / "raw" / f"{number:02d}.raw").write_bytes(picture.tobytes())
    mapping = {
        "schema_version": 1,
        "parts": [{"kind": "stripes", "bits": 4, "unit_px": 1}, {"kind": "white"}, {"kind": "black"}],
        "projector_size_px": [16, 8],
    }
    for name, _ in _PICTURE_FILES:
        (folder / f"{name}.json").write_text(json.dumps(mapping))
    raw = {"width_px": width, "height_px": height, "bits": 8}
    (folder / "raw.json").write_text(json.dumps(mapping | {"raw": raw}))


def _read_pictures(name: str) -> Callable[[Path], object]:
    def read(folder: Path) -> object:
        from dsl_core.io.pictures.source import open_pictures
        from dsl_core.workflows.captures import load_mapping

        scan = open_pictures(folder / name, load_mapping(folder / f"{name}.json"))
        return scan.fingerprint()

    return read


def _guess(name: str) -> Callable[[Path], object]:
    def read(folder: Path) -> object:
        from dsl_core.io.pictures.guess import guess_mapping

        return guess_mapping(folder / name, (16, 8))

    return read


def _make_archive(folder: Path) -> None:
    """An archive of arrays with the names that a self-test has, and one number in each."""
    from dsl_core.calibration.selftest.readings import Readings
    from dsl_core.campaign.selftest import capture

    names = [f"cycle/{each.name}" for each in fields(Readings)]
    names += ["pixels", "beside"]
    arrays: dict[str, Any] = {name: np.ones(3) for name in names}
    arrays |= {name: np.ones((2, 4, 6), np.uint16) for name in ("bars", "inverse", "dark_frames")}
    about: dict[str, Any] = dict.fromkeys(capture._NUMBERS, 1.0)
    about |= {"version": capture._VERSION, "bit_depth": 12, "parts": ["cycle"], "wanted_ms": [1.0, 2.0]}
    np.savez_compressed(folder / capture.ARCHIVE_NAME, about=np.array(json.dumps(about)), **arrays)


def _read_archive(folder: Path) -> object:
    from dsl_core.campaign.selftest.capture import load_capture

    return load_capture(folder)


def _add_to_manifest(path: Path, content: dict[str, Any]) -> None:
    from dsl_core.io.sealed import unseal

    path.write_text(json.dumps(json.loads(unseal(path.read_bytes())) | content))


def _make_step(folder: Path) -> None:
    from dsl_core.campaign.common.captures import CaptureNote
    from dsl_core.devices.base import CameraInfo, ProjectorInfo
    from dsl_core.devices.conditions import conditions_of
    from dsl_core.io.campaign_folder import NOTE_NAME
    from dsl_core.io.records import replace_record

    camera = CameraInfo("camera", "1", 12, 8, "RGGB", 12, (0.1, 1000.0))
    projector = ProjectorInfo("projector", "2", 8, 6, 20.0, 16.7)
    note = CaptureNote(conditions=conditions_of(camera, projector), started="2026-01-01T00:00:00+00:00")
    replace_record(folder / "step" / NOTE_NAME, note)
    make_scan(folder / "step")
    devices = {"camera": asdict(camera), "projector": asdict(projector)}
    _add_to_manifest(folder / "step" / "a.dsl" / "manifest.json", devices)


def _read_step(folder: Path) -> object:
    from dsl_core.campaign.common.captures import other_conditions, read_note, scan_settings

    note = read_note(folder / "step")
    scan_settings(folder / "step")
    return None if note is None else other_conditions(folder / "step", note.conditions)


def _make_list(folder: Path) -> None:
    from dsl_core.model.rig import Sensor

    make_scan(folder)
    notes = {"imported_sensor": Sensor().model_dump_json(), "scanned_with": "twin"}
    _add_to_manifest(folder / "a.dsl" / "manifest.json", {"notes": notes})
    (folder / "scans.txt").write_text("# those of today\na.dsl\nb.dsl\n")


def _read_list(folder: Path) -> object:
    from dsl_core.io.scan.folder import ScanReader
    from dsl_core.workflows.batch.batch import find_scans, picture_px
    from dsl_core.workflows.captures import sensor_of_scan

    found = find_scans(folder / "scans.txt")
    picture_px(folder / "a.dsl")
    return found, sensor_of_scan(ScanReader(folder / "a.dsl"))


def _make_groups(folder: Path) -> None:
    (folder / "groups.csv").write_text("name,group\nleaf 1,leaf\nleaf 2,leaf\nsoil,ground\n")


def _read_groups(folder: Path) -> object:
    from dsl_core.analysis.library import read_groups

    return read_groups(folder / "groups.csv")


def _make_predictions(folder: Path) -> None:
    from dsl_core.planning.store import PredictionStore

    store = PredictionStore(folder / "kept", small_rig(), 10.0)
    (folder / "kept").mkdir()
    (folder / "name").write_text(store._path.name)
    store._path.write_text(json.dumps({"a": {"depth_mm": 1.0}}))
    store._path.rename(folder / "kept.json")


def _read_predictions(folder: Path) -> object:
    from dsl_core.planning.store import PredictionStore

    path = folder / "kept" / (folder / "name").read_text()
    path.unlink(missing_ok=True)
    path.hardlink_to(folder / "kept.json")
    return PredictionStore(folder / "kept", small_rig(), 10.0).find(small_plan())


def _make_home(folder: Path) -> None:
    from dsl_app.session.records import Session
    from dsl_app.shared.settings import Settings

    (folder / "settings.json").write_text(Settings().model_dump_json())
    (folder / "session.json").write_text(Session().model_dump_json())


def _read_settings(folder: Path) -> object:
    from dsl_app.shared.known_files import kind_of
    from dsl_app.shared.settings import load_settings

    # What cannot be read is set aside, and would be gone for the next change.
    (folder / "home").mkdir(exist_ok=True)
    path = folder / "home" / "settings.json"
    path.unlink(missing_ok=True)
    path.hardlink_to(folder / "settings.json")
    return kind_of(path), load_settings(path)


def _read_session(folder: Path) -> object:
    from dsl_app.session.records import Session
    from dsl_app.session.store import SessionStore

    path = folder / "home" / "session-4000000000.json"
    path.parent.mkdir(exist_ok=True)
    path.unlink(missing_ok=True)
    path.hardlink_to(folder / "session.json")
    return SessionStore(folder / "home", Session).crashed_session()


_PICTURE_FILES = (
    *(("png", "03.png"), ("bmp", "03.bmp"), ("pgm", "03.pgm"), ("tif", "03.tif"), ("jpg", "03.jpg")),
    *(("webp", "03.webp"), ("pfm", "03.pfm"), ("exr", "03.exr")),
    *(("paged", "all.tif"), ("npy", "all.npy"), ("npz", "all.npz"), ("mat", "all.mat"), ("raw", "03.raw")),
)
MORE = (
    Sample("attributes", _make_attributes, "attributes.json", _read_attributes),
    Sample("profile", _make_profile, "lab.json", _read_profile),
    Sample("library", _make_library, "lab/versions/20260101-000000-000000.json", _read_library),
    Sample("library: current", _make_library, "lab/current", _read_library),
    *(
        Sample(f"any stereo: {n}", _make_any_stereo, n, _read_any_stereo(n))
        for n in ("b.xml", "b.yml", "b.json")
    ),
    Sample("curves", _make_curves, "curves.csv", _read_curves),
    *(
        Sample(f"pictures: {n}", _make_pictures, f"{n}/{file}", _read_pictures(n))
        for n, file in _PICTURE_FILES
    ),
    Sample("pictures: mapping", _make_pictures, "png.json", _read_pictures("png")),
    Sample("guess: png", _make_pictures, "png/03.png", _guess("png")),
    Sample("guess: paged", _make_pictures, "paged/all.tif", _guess("paged")),
    Sample("self-test", _make_archive, "selftest.npz", _read_archive),
    Sample("step: note", _make_step, "step/capture.json", _read_step),
    Sample("step: manifest", _make_step, "step/a.dsl/manifest.json", _read_step),
    Sample("list", _make_list, "scans.txt", _read_list),
    Sample("list: manifest", _make_list, "a.dsl/manifest.json", _read_list),
    Sample("groups", _make_groups, "groups.csv", _read_groups),
    Sample("predictions", _make_predictions, "kept.json", _read_predictions),
    Sample("settings", _make_home, "settings.json", _read_settings),
    Sample("session", _make_home, "session.json", _read_session),
    *FOLDERS,
)
