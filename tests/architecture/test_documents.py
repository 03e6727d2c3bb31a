"""What the documents say works: their examples run, their links and files exist."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from dsl_core.workflows.new_rig import page_files, write_new_rig

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The package that the help page shows, written by the command and installed by pip into a folder."""
    pytest.importorskip("setuptools")
    pytest.importorskip("pip")
    folder = tmp_path_factory.mktemp("lab")
    write_new_rig("room-12", folder / "room-12", [])
    command = [
        sys.executable,
        "-m",
        "pip",
        "install",
        "-q",
        "--no-deps",
        "--no-build-isolation",
        "--no-index",
    ]
    command += ["--disable-pip-version-check", "--target", str(folder / "site"), str(folder / "room-12")]
    answer = subprocess.run(command, capture_output=True, text=True, check=False)
    assert answer.returncode == 0, answer.stderr
    return folder


def _run(folder: Path, *command: str) -> str:
    path = os.pathsep.join([str(folder / "site"), str(ROOT)])  # the tests run without an installation too
    answer = subprocess.run(
        [sys.executable, "-m", *command],
        cwd=folder / "room-12",
        env={**os.environ, "PYTHONPATH": path},
        capture_output=True,
        text=True,
        check=False,
    )
    assert answer.returncode == 0, answer.stdout + answer.stderr
    return answer.stdout


def test_the_rig_of_the_help_page_keeps_every_promise(installed: Path) -> None:
    assert set(page_files()) == {"pyproject.toml", "my_lab.py", "test_my_lab.py"}
    told = _run(installed, "pytest", "-q", "-W", "error", "-p", "no:cacheprovider", "test_room_12.py")
    assert re.search(r"^\d\d passed", told, re.MULTILINE), told


def test_the_rig_of_the_help_page_is_found_and_scans(installed: Path) -> None:
    told = _run(installed, "dsl_core", "scan", "first.dsl", "--rig", "room-12", "--lines", "8x8", "--json")
    found = json.loads(told)
    assert found["frames"] > 10


@pytest.mark.parametrize("name", ["README.md", "ARCHITECTURE.md", "CHANGELOG.md"])
def test_files_that_a_document_names_exist(name: str) -> None:
    text = (ROOT / name).read_text(encoding="utf-8")
    named = re.findall(r"\]\(([\w./-]+)\)", text) + re.findall(r"`((?:\w[\w-]*/)+[\w-]+\.\w+)`", text)
    missing = [
        path
        for path in named
        if not any((base / path).exists() for base in (ROOT, ROOT / "dsl_core", ROOT / "app" / "dsl_app"))
    ]
    assert missing == []
