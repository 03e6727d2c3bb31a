"""Every kind of mistake in every command: exit code 2, one sentence, at once, and nothing is changed."""

from __future__ import annotations

import io
import re
import shutil
from pathlib import Path

import pytest

import dsl_core as dsl
from dsl_core.cli import main
from dsl_core.io.calibration_library import CalibrationLibrary
from dsl_core.io.plan_file import save_plan
from tests.cases.wrong_lines import COMMANDS, wrong_lines

from .conftest import Ending, Give, without_progress

#: Words of libraries, and of programs that broke.
FOREIGN = re.compile(
    r"Traceback|This is a bug|Input should|Value error|Field required|Errno|pydantic|None\b|<class"
)
#: Of all lines the test gives every eleventh; `tests.benchmarks.bench_wrong_lines` gives all.
STEP = 11


def make_desk(home: Path) -> None:
    """Files of each kind beside a scan and its result in the present folder, for commands to mistake.

    The user's library gets a calibration, ``lab``.
    """
    save_plan(dsl.load_scan("scan.dsl").plan, home / "plan.json")
    (home / "folder").mkdir()
    (home / "text.txt").write_text("text\n")
    (home / "braces.json").write_text("{}")
    calibration = dsl.load_scan("scan.dsl").calibration
    assert calibration is not None
    (home / "rig.json").write_text(calibration.model_dump_json())
    CalibrationLibrary().store("lab", calibration)


def contents(home: Path) -> list[tuple[str, int]]:
    """Every file below a folder, with its size."""
    return sorted((str(path.relative_to(home)), path.stat().st_size) for path in home.rglob("*"))


def faults_of(ending: Ending) -> str:
    """What is wrong with the answer to a wrong command line; empty where nothing is."""
    lines = without_progress(ending.err).strip().splitlines()
    faults = [
        f"code {ending.code}" if ending.code != 2 else "",
        f"{len(lines)} lines" if len(lines) != 1 else "",
        "words of a library" if FOREIGN.search(ending.err) else "",
    ]
    return ", ".join(fault for fault in faults if fault)


def test_there_are_enough_of_them() -> None:
    lines = wrong_lines()
    assert len(lines) > 250
    for command in COMMANDS:
        assert len(list(command.mistakes())) >= 8, command.name
    assert len({tuple(line) for _, line in lines}) > 250


@pytest.mark.parametrize(
    ("line", "told"),
    [
        ("gui --theme magic", "one of 'system', 'light', 'dark', not 'magic'. See 'dsl-scan gui --help'."),
        ("calibrat", "Did you mean 'calibrate', 'calibrations'? See 'dsl-scan --help'."),
        ("info one two", "Too many arguments: two. See 'dsl-scan info --help'."),
        ("calibrate geometry --board", "--board needs a value. See 'dsl-scan calibrate geometry --help'."),
        (
            "compare a.zarr",
            "SECOND.zarr is missing: The result to compare it with, of the same camera."
            " See 'dsl-scan compare --help'.",
        ),
        ("calibrate", "A command of it is missing. See 'dsl-scan calibrate --help'."),
        (
            "calibrate geometry . --pictures --board 9 --square-mm 20",
            "COLUMNSxROWS in whole numbers of at least 1, not '9'.",
        ),
        ("batch . --jobs 0", "--jobs must be at least 1. See 'dsl-scan batch --help'."),
        ("batch . -j few", "--jobs must be a whole number. See 'dsl-scan batch --help'."),
        ("classify scan.zarr --library-error nan --at a=1,1", "Name it with --library."),
    ],
)
def test_the_sentence_names_the_command_and_the_choice(line: str, told: str, give: Give) -> None:
    assert give(*line.split()).sentence.endswith(told)


@pytest.mark.slow
def test_each_is_answered_in_one_sentence_before_any_work(
    finished: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    for name in ("DISPLAY", "WAYLAND_DISPLAY", "QT_QPA_PLATFORM"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path / "data"))
    monkeypatch.chdir(tmp_path)
    for name in ("scan.dsl", "scan.zarr"):
        shutil.copytree(finished / name, tmp_path / name)
    make_desk(tmp_path)
    before, wrong = contents(tmp_path), []
    for name, line in wrong_lines()[::STEP]:
        monkeypatch.setattr("sys.stdin", io.StringIO())
        capsys.readouterr()
        code = main(line)
        said = capsys.readouterr()
        faults = faults_of(Ending(code, said.out, said.err))
        if contents(tmp_path) != before:
            faults += ", changed files"
            before = contents(tmp_path)
        if faults:
            wrong.append(f"{name}: {faults}: {said.err[-300:]}")
    assert wrong == []
