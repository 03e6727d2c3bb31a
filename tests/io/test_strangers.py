"""What a stranger may send is refused in one sentence: no crash, no wait, no file outside a folder."""

from __future__ import annotations

import contextlib
import json
import os
import re
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, Phase, given, settings

from dsl_core.errors import CalibrationError, DslError, PlanError, StoreError
from dsl_core.io.campaign_folder import CampaignFolder
from dsl_core.io.plan_file import load_plan
from dsl_core.io.published.layout import probe_png
from dsl_core.io.published.stereo import load_stereo
from dsl_core.io.reading import read_array
from dsl_core.io.records import replace_record
from dsl_core.io.spectra.reference_file import read_references
from dsl_core.model.calibration.accepted import AcceptedCalibration
from dsl_core.model.plan import CapturePlan
from dsl_core.planning.designed import DesignedSet, load_design, packed, save_design
from tests.cases.stranger_readers import MORE
from tests.cases.strangers import SAMPLES, Change, Sample, changed, changes

#: Those that take long to read have few examples here; the benchmark has as many as there are seconds.
SLOW = ("scan", "result", "dataset")


@pytest.mark.slow
@pytest.mark.parametrize("sample", [*SAMPLES, *MORE], ids=lambda sample: sample.name)
def test_a_changed_file_is_read_or_refused(sample: Sample, tmp_path: Path) -> None:
    sample.make(tmp_path)
    path = tmp_path / sample.file
    sound = path.read_bytes()
    sample.read(tmp_path)

    @settings(
        max_examples=2 if sample.name.startswith(SLOW) else 8,
        derandomize=True,
        deadline=None,
        database=None,
        phases=[Phase.generate],
        suppress_health_check=list(HealthCheck),
    )
    @given(changes)
    def read_or_refused(what: list[Change]) -> None:
        path.write_bytes(changed(sound, what))
        try:
            sample.read(tmp_path)
        except DslError as error:
            told = str(error)
        else:
            told = ""
        assert "\n" not in told.strip()

    read_or_refused()


@pytest.mark.parametrize(
    ("sample", "part", "instead"),
    [
        ("scan: frames/zarr.json", rb"(?s).*", b"5"),
        ("result: reflectance/zarr.json", rb'"chunk_shape":\s*\[\s*1,', b'"chunk_shape": [0,'),
        ("result: depth_mm/zarr.json", rb'"attributes":\s*\{[^}]*\}', b'"attributes": 48.5'),
        ("result: depth_mm/zarr.json", rb'"attributes":\s*\{[^}]*\}', b'"attributes": [1]'),
        ("campaign: accepted", rb"(?s).*", b'{"name": "' + b"x" * 300 + b'", "title": "T", "record": {}}'),
        ("YAML", rb"\n(?=[A-Za-z])", b"\n\x8a"),
        ("campaign: accepted", rb"(?s).*", b'{"name": "\\u0000", "title": "T", "record": {}}'),
        ("step: manifest", rb"(?s).*", b"5"),
        ("step: manifest", rb'"plan"', b'"plans"'),
        ("step: manifest", rb'"level": *[0-9.]+', b'"level": "high"'),
        ("step: manifest", rb'"gain_db": *[0-9.]+', b'"gain_db": Infinity'),
        ("list", rb"(?s).*", b"a" * 6000),
        ("list: manifest", rb'"imported_sensor": "{', b'"imported_sensor": "['),
    ],
)
def test_what_was_found_by_chance_is_refused(
    sample: str, part: bytes, instead: bytes, tmp_path: Path
) -> None:
    found = next(each for each in (*SAMPLES, *MORE) if each.name == sample)
    found.make(tmp_path)
    path = tmp_path / found.file
    path.write_bytes(re.sub(part, lambda _: instead, path.read_bytes(), count=1))
    with pytest.raises(DslError, match=r"\. |again|Restore|Correct"):
        found.read(tmp_path)


@pytest.mark.skipif(sys.platform == "win32", reason="pipes have no place in folders there")
@pytest.mark.parametrize("sample", [*SAMPLES, *MORE], ids=lambda sample: sample.name)
def test_a_pipe_is_never_waited_for(sample: Sample, tmp_path: Path) -> None:
    sample.make(tmp_path)
    (tmp_path / sample.file).unlink()
    os.mkfifo(tmp_path / sample.file)
    with contextlib.suppress(DslError):  # some tell it in a table; none waits for somebody to write
        sample.read(tmp_path)
    if "image" in sample.name:
        assert probe_png(tmp_path / sample.file) == "cannot be read (it is a pipe or a device, not a file)"


@pytest.mark.parametrize("time", ["/tmp/outside", "../../up", "C:\\up", "a\0b", "", "x" * 5000])
def test_a_time_that_is_a_path_stays_in_the_campaign(tmp_path: Path, time: str) -> None:
    campaign = CampaignFolder.begin(tmp_path / "campaign", "twin", {})
    fitted = AcceptedCalibration(name="geometry", title="Geometry", record={})
    replace_record(campaign.path / "geometry.json", fitted.model_copy(update={"accepted": time}))
    campaign.propose(fitted)
    campaign.accept("geometry")
    (kept,) = (campaign.path / "history" / "geometry").iterdir()
    assert len(kept.name) < 100
    assert [each.name for each in tmp_path.iterdir()] == ["campaign"]


@pytest.mark.parametrize(
    "change",
    [
        {"projector_size_px": (60_000, 60_000), "spectral": {"kind": "lines", "width_px": 1, "step_px": 1},
         "settings": [{"exposure_ms": 1, "level": 1}] * 400},
        {"camera_size_px": (10**9, 10**9)},
        {"projector_size_px": (10**12, 360)},
        {"camera_size_px": (0, -1)},
    ],
)  # fmt: skip
def test_a_plan_that_nobody_can_take_is_refused(tmp_path: Path, change: dict[str, object]) -> None:
    path = tmp_path / "plan.json"
    path.write_text(json.dumps(CapturePlan().model_dump(mode="json") | change))
    with pytest.raises(PlanError, match=r"at most 200000 are possible|1 to 65535 pixels a side"):
        load_plan(path)


def test_few_bytes_that_unpack_to_many_are_not_unpacked(tmp_path: Path) -> None:
    made = DesignedSet(
        name="a",
        rig="twin",
        command="",
        frames=2,
        width_px=8,
        lines="",
        comb_error=1,
        error=1,
        levels=packed(np.zeros((40, 1000, 100), np.uint8)),
    )
    save_design(made, tmp_path / "bomb.json")
    with pytest.raises(StoreError, match="cannot be read"):
        load_design(tmp_path / "bomb.json")


def test_an_array_that_declares_more_than_it_has_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.npy"
    np.save(path, np.zeros(3))
    sound = path.read_bytes()
    path.write_bytes(sound.replace(b"(3,), }        ", b"(99999999999,)}"))
    with pytest.raises(ValueError, match=r"declares 799999999992 bytes"):
        read_array(path)
    path.write_bytes(sound.replace(b"(3,)", b"(3,("))
    with pytest.raises(ValueError, match=r"header"):
        read_array(path)


@pytest.mark.parametrize(
    "content",
    [
        b"<?xml version='1.0'?>\n<opencv_storage>" + b"<a>" * 9000 + b"</a>" * 9000 + b"</opencv_storage>",
        b"<?xml version='1.0'?>\n<opencv_storage><m type_id='opencv-matrix'><rows>90000</rows>"
        b"<cols>90000</cols><dt>d</dt><data>0</data></m></opencv_storage>",
        b"%YAML:1.0\n---\na: " + b"[" * 9000 + b"]" * 9000 + b"\n",
        b'{"a": ' + b"[" * 9000 + b"]" * 9000 + b"}",
    ],
)
def test_nested_or_enormous_files_are_refused_without_opencv(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "a.xml").write_bytes(content)
    with pytest.raises(CalibrationError, match=r"nested too deeply|is not a complete calibration"):
        load_stereo(tmp_path / "a.xml", (640, 360))


@pytest.mark.parametrize("line", [b" " * 200_000, b"a" + b" " * 200_000, b"a = {\n" * 60_000])
def test_a_header_takes_time_in_proportion_to_its_length(tmp_path: Path, line: bytes) -> None:
    (tmp_path / "a.sli").write_bytes(b"")
    (tmp_path / "a.hdr").write_bytes(b"ENVI\n" + line)
    begun = time.process_time()
    with pytest.raises(CalibrationError):
        read_references(tmp_path / "a.hdr")
    assert time.process_time() - begun < 20  # the old expressions took hours
