"""Files as strangers send them: a sound sample for each reader, and what may be wrong with it.

Changes are made of hypothesis' choices, so that a case that was found shrinks to the least that shows it.
JSON is changed by its structure (a value, a key, the depth of it), everything else by its bytes.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from hypothesis import strategies as st

from dsl_core.io.sealed import unseal
from tests.cases.small_result import small_result
from tests.cases.small_rig import small_rig
from tests.cases.spectra_files import SPECTRA_FILES, reader_of, write_all

#: Text of JSON values that no field expects.
NASTY = (
    *("NaN", "Infinity", "-1", "0", "1e400", "9" * 6000, "20000000", "1e9", "4294967296", "-0.5"),
    *('"\\u0000"', '"/etc/passwd"', '"../../up"', '""', '"<b>bold</b>"', '"\\ud800"'),
    *("null", "true", "[]", "{}", "[[0, 0], [0]]", '"' + "x" * 9000 + '"'),
    *("[" * 5000 + "]" * 5000, '{"a":' * 3000 + "1" + "}" * 3000),
)
#: Bytes that mean something to some format.
PIECES = (
    *(b"\0", b"\xff" * 8, b"9" * 6000, b"nan", b"-1", b"1e999", b"\n" * 500, b" " * 3000, b"{" * 3000),
    *(b"<a>" * 3000, b"= {", b",,,,", b'"', b"\xf0\x28\x8c\x28", struct.pack("<Q", 1 << 60), b"IHDR"),
)


@dataclass(frozen=True)
class Change:
    """What is done to a file, where in it (of a million), and with which of the nasty values."""

    kind: str
    place: int
    value: int


KINDS = ("value", "drop", "double", "flip", "cut", "insert")
changes = st.lists(
    st.builds(Change, st.sampled_from(KINDS), st.integers(0, 999_999), st.integers(0, 999)),
    min_size=1,
    max_size=3,
)


@dataclass(frozen=True)
class Sample:
    """A reader of ``name``: how its files are made in a folder, which one is changed, and how it is read."""

    name: str
    make: Callable[[Path], None]
    file: str
    read: Callable[[Path], object]


def changed(data: bytes, what: list[Change]) -> bytes:
    """The content of a file after some changes."""
    for change in what:
        try:
            content = json.loads(unseal(data)) if change.kind in ("value", "drop", "double") else None
        except (ValueError, RecursionError):
            content = None
        data = _of_bytes(data, change) if content is None else _of_json(content, change)
    return data


def _of_json(content: Any, change: Change) -> bytes:
    places = list(_places(content))
    mark = "!of a stranger!"
    if not places:
        return NASTY[change.value % len(NASTY)].encode()
    holder, key = places[change.place % len(places)]
    if change.kind == "drop":
        del holder[key]
    elif change.kind == "double" and isinstance(holder, list):
        holder.extend(holder[:1] * 50)
    else:
        holder[key] = mark
    text = json.dumps(content)
    return text.replace(json.dumps(mark), NASTY[change.value % len(NASTY)]).encode("utf-8", "replace")


def _places(content: Any, depth: int = 0) -> Any:
    """Every value of nested lists and objects, by what it is in."""
    keys = (
        list(content)
        if isinstance(content, dict)
        else range(len(content))
        if isinstance(content, list)
        else ()
    )
    for key in keys:
        yield content, key
        if depth < 8:
            yield from _places(content[key], depth + 1)


def _of_bytes(data: bytes, change: Change) -> bytes:
    at = change.place * len(data) // 1_000_000
    piece = PIECES[change.value % len(PIECES)]
    match change.kind:
        case "cut":
            return data[:at]
        case "drop":
            return data[:at] + data[at + 1 + change.value % 40 :]
        case "double":
            return data[:at] + data[max(at - 60, 0) :]
        case "flip" if data:
            flipped = bytearray(data)
            flipped[min(at, len(data) - 1)] ^= 1 << change.value % 8
            return bytes(flipped)
    return data[:at] + piece + data[at + (len(piece) if change.kind == "value" else 0) :]


# Samples ---------------------------------------------------------------------------------------------


def small_plan() -> Any:
    """A plan of few frames of 12 x 8 pixels."""
    from dsl_core.model.plan import CapturePlan, GrayCode, LineComb, Setting

    return CapturePlan(
        camera_size_px=(12, 8),
        projector_size_px=(8, 6),
        code=GrayCode(rows=False),
        spectral=LineComb(width_px=2, step_px=2, period_px=4),
        settings=(Setting(exposure_ms=10.0, level=0.4),),
        code_settings=(0,),
    )


def make_scan(folder: Path) -> None:
    """The scan ``a.dsl`` of that plan, of noise."""
    from dsl_core.io.scan.folder import ScanWriter
    from dsl_core.model.frames import Frame

    rng = np.random.default_rng(3)
    with ScanWriter.create(folder / "a.dsl", small_plan()) as writer:
        for shot in writer.missing():
            pixels = rng.integers(200, 4000, (8, 12)).astype(np.uint16)
            writer.write(shot, Frame(pixels, shot.exposure_ms, 1.0 + shot.index, shot.index + 1))


def _read_scan(folder: Path) -> object:
    from dsl_core.io.describe import describe

    return describe(folder / "a.dsl", verify=True)


def _make_result(folder: Path) -> None:
    from dsl_core.io.result.inventory import CHECKSUM, INVENTORY
    from dsl_core.io.result.result_file import save_result

    path = save_result(small_result(), folder / "a.zarr") / "zarr.json"
    # Without checksums, which would refuse every change before anything else is looked at.
    content = json.loads(path.read_text())
    del content["attributes"][INVENTORY], content["attributes"][CHECKSUM]
    path.write_text(json.dumps(content))


def _read_result(folder: Path) -> object:
    from dsl_core.io.result.result_arrays import load_arrays
    from dsl_core.io.result.result_file import load_result

    load_arrays(folder / "a.zarr")
    return load_result(folder / "a.zarr", lazy=False)


def _make_records(folder: Path) -> None:
    from dsl_core.io.campaign_folder import CampaignFolder
    from dsl_core.io.plan_file import save_plan
    from dsl_core.io.result.annotations_file import Annotations, PinRecord, save_annotations
    from dsl_core.io.rig_file import save_rig
    from dsl_core.model.calibration.accepted import AcceptedCalibration

    save_plan(small_plan(), folder / "plan.json")
    save_rig(small_rig(), folder / "rig.json")
    campaign = CampaignFolder.begin(folder / "campaign", "twin", {"size": "12x8"})
    campaign.propose(AcceptedCalibration(name="geometry", title="Geometry", record={"a": [1.0, 2.0]}))
    campaign.accept("geometry")
    save_annotations(Annotations(pins=(PinRecord(name="a", pixel=(1, 2)),)), folder / "a.zarr")


def _read_campaign(folder: Path) -> object:
    from dsl_core.io.campaign_folder import CampaignFolder
    from dsl_core.io.describe import describe

    campaign = CampaignFolder.open(folder / "campaign")
    (folder / "campaign" / "geometry").mkdir(exist_ok=True)
    describe(folder / "campaign")
    if campaign.candidate("geometry") is None and (found := campaign.accepted("geometry")) is not None:
        campaign.propose(found)
        campaign.accept("geometry")
    return campaign.history("geometry")


def _read_marks(folder: Path) -> object:
    from dsl_core.io.result.annotations_file import load_annotations

    return load_annotations(folder / "a.zarr")


def _describe(name: str) -> Callable[[Path], object]:
    def read(folder: Path) -> object:
        from dsl_core.io.describe import describe

        return describe(folder / name)

    return read


def _make_stereo(folder: Path) -> None:
    from dsl_core.io.published.stereo import Stereo, save_stereo

    rig = small_rig()
    stereo = Stereo(camera=rig.camera, projector=rig.projector, pose=rig.pose)
    for name in ("a.xml", "a.yml"):
        save_stereo(stereo, folder / name)


def _read_stereo(name: str) -> Callable[[Path], object]:
    def read(folder: Path) -> object:
        from dsl_core.io.published.stereo import load_stereo

        return load_stereo(folder / name, (640, 360))

    return read


def _make_tables(folder: Path) -> None:
    for name, shape in (("CRF", (24, 3)), ("PEF", (24, 3)), ("DG", (3, 24))):
        np.save(folder / f"{name}.npy", np.full(shape, 0.5))


def _read_tables(folder: Path) -> object:
    from dsl_core.io.published.curve_tables import load_tables

    return load_tables(folder)


def _make_spectra(folder: Path) -> None:
    rows = [f"{nm}\t{0.5 + nm / 5000:.3f}" for nm in range(400, 700, 10)]
    (folder / "a.txt").write_text("\n".join(["Spectrum", "nm\treflectance", *rows]))
    rows = [f"{nm},{0.4},{0.01}" for nm in range(400, 700, 10)]
    head = "wavelength_nm,pin 1: reflectance (1),pin 1: standard deviation (1)"
    (folder / "a.csv").write_text("\n".join(["# made: by hand", head, *rows]))
    values = np.linspace(0.1, 0.9, 60).astype("<f4")
    (folder / "a.sli").write_bytes(values.tobytes())
    nm = ", ".join(str(400 + 10 * i) for i in range(30))
    fields = [
        "samples = 30",
        "lines = 2",
        "bands = 1",
        "data type = 4",
        "byte order = 0",
    ]
    fields += [
        "header offset = 0",
        "file type = ENVI Spectral Library",
        f"wavelength = {{{nm}}}",
        "wavelength units = nm",
    ]
    (folder / "a.hdr").write_text("\n".join(["ENVI", *fields, "spectra names = {one, two}"]))


def _read_spectra(name: str) -> Callable[[Path], object]:
    def read(folder: Path) -> object:
        from dsl_core.io.spectra.reference_file import read_references

        return read_references(folder / name)

    return read


def make_dataset(folder: Path) -> None:
    """A dataset in the published layout with four pictures, and its plan."""
    import cv2

    image = np.full((8, 12, 3), 9000, np.uint16)
    for name, count in (("intensity1", 1), ("black_exposure1", 1), ("ldr_exposure1", 2)):
        (folder / name).mkdir()
        for number in range(count):
            data = cv2.imencode(".png", image)[1]
            (folder / name / f"capture_{number:04d}.png").write_bytes(data.tobytes())
    (folder / "plan.json").write_text(small_plan().model_dump_json())


def _read_dataset(folder: Path) -> object:
    from dsl_core.errors import DslError
    from dsl_core.io.published.dataset import open_dataset

    scan = open_dataset(folder)
    scan.fingerprint()
    for shot in scan.plan.shots():
        try:
            scan.read(shot)
        except DslError:
            continue
    return scan


def _make_patterns(folder: Path) -> None:
    from dsl_core.planning.designed import DesignedSet, packed, save_design

    levels = np.arange(2 * 8 * 3, dtype=np.uint8).reshape(2, 8, 3)
    made = DesignedSet(
        name="a",
        rig="twin",
        command="",
        frames=2,
        width_px=8,
        lines="",
        comb_error=1,
        error=1,
        levels=packed(levels),
    )
    save_design(made, folder / "set.json")


def _read_patterns(folder: Path) -> object:
    from dsl_core.planning.designed import load_design

    return load_design(folder / "set.json").array


_OF_SCAN = ("manifest.json", "frames.jsonl", "frames/zarr.json", "frames/c.3.0.0")
_OF_RESULT = ("zarr.json", "depth_mm/zarr.json", "reflectance/zarr.json", "reflectance/c/0/0/0")
SAMPLES = (
    *(Sample(f"scan: {file}", make_scan, f"a.dsl/{file}", _read_scan) for file in _OF_SCAN),
    *(Sample(f"result: {file}", _make_result, f"a.zarr/{file}", _read_result) for file in _OF_RESULT),
    Sample("plan", _make_records, "plan.json", _describe("plan.json")),
    Sample("rig", _make_records, "rig.json", _describe("rig.json")),
    Sample("campaign", _make_records, "campaign/campaign.json", _read_campaign),
    Sample("campaign: accepted", _make_records, "campaign/geometry.json", _read_campaign),
    Sample("marks", _make_records, "a.marks.json", _read_marks),
    Sample("XML", _make_stereo, "a.xml", _read_stereo("a.xml")),
    Sample("YAML", _make_stereo, "a.yml", _read_stereo("a.yml")),
    Sample("npy", _make_tables, "CRF.npy", _read_tables),
    Sample("text spectrum", _make_spectra, "a.txt", _read_spectra("a.txt")),
    Sample("CSV", _make_spectra, "a.csv", _read_spectra("a.csv")),
    Sample("ENVI header", _make_spectra, "a.hdr", _read_spectra("a.hdr")),
    Sample("ENVI data", _make_spectra, "a.sli", _read_spectra("a.sli")),
    *(Sample(f"spectra: {name}", write_all, name, reader_of(name)) for name in SPECTRA_FILES),
    Sample("dataset: image", make_dataset, "ldr_exposure1/capture_0000.png", _read_dataset),
    Sample("dataset: plan", make_dataset, "plan.json", _read_dataset),
    Sample("pattern set", _make_patterns, "set.json", _read_patterns),
)
