"""What the documents say works: their examples run, their links and files exist."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from dsl_core.resources import resource_path

ROOT = Path(__file__).resolve().parents[2]


def test_the_rig_of_the_help_page_keeps_every_promise(tmp_path: Path) -> None:
    page = resource_path("help/adding-a-rig.md").read_text(encoding="utf-8")
    settings, module, tests = re.findall(r"```(?:toml|python)\n(.*?)```", page, re.DOTALL)
    (tmp_path / "my_lab.py").write_text(module, encoding="utf-8")
    (tmp_path / "test_my_lab.py").write_text(tests, encoding="utf-8")
    points = tomllib.loads(settings)["project"]["entry-points"]["dsl_scan.rigs"]
    assert points == {"my-lab": "my_lab:open_lab"}
    command = [
        sys.executable,
        "-m",
        "pytest",
        "-q",
        "-W",
        "error",
        "-p",
        "no:cacheprovider",
        "test_my_lab.py",
    ]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}  # the tests run without an installation too
    answer = subprocess.run(
        command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False
    )
    assert re.search(r"^\d\d passed", answer.stdout, re.MULTILINE), answer.stdout


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
