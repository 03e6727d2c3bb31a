"""A small finished scan on the twin, its result, and a way to give commands and see how they end."""

from __future__ import annotations

import json
import re
import shutil
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from dsl_core.cli import main

#: A rig and plan that scan and reconstruct in a few seconds.
SMALL_RIG = ["-O", "size=112x72"]
SMALL_PLAN = ["--code", "columns", "--lines", "5x5", "--setting", "333.3@0.8"]


@dataclass(frozen=True)
class Ending:
    """How a command ended."""

    code: int
    out: str
    err: str

    @property
    def json(self) -> Any:
        """The one object on standard output."""
        return json.loads(self.out)

    @property
    def sentence(self) -> str:
        """What was said to the user; fails when it was not said in one line or with a traceback."""
        lines = without_progress(self.err).strip().splitlines()
        assert len(lines) == 1, self.err
        return lines[0]


def without_progress(text: str) -> str:
    """Error output without the lines that work prints now and then when it takes long."""
    return re.sub(r"(?m)^.*: \d+ of \d+ \(\d+%\)\n", "", text)


Give = Callable[..., Ending]


@pytest.fixture
def give(capsys: pytest.CaptureFixture[str]) -> Give:
    """Give a command in this process."""

    def run(*arguments: object) -> Ending:
        capsys.readouterr()
        code = main([str(argument) for argument in arguments])
        said = capsys.readouterr()
        return Ending(code, said.out, said.err)

    return run


@pytest.fixture(scope="session")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with ``scan.dsl`` and ``scan.zarr``; to be read only."""
    folder = tmp_path_factory.mktemp("finished")
    assert main(["scan", str(folder / "scan.dsl"), *SMALL_RIG, *SMALL_PLAN]) == 0
    assert main(["reconstruct", str(folder / "scan.dsl"), "--bands", "430:660:10"]) == 0
    return folder


@pytest.fixture
def scan_copy(finished: Path, tmp_path: Path) -> Path:
    """A copy of the finished scan, to be damaged."""
    return Path(shutil.copytree(finished / "scan.dsl", tmp_path / "scan.dsl"))
