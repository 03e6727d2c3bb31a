"""One small calibrated campaign for all tests: killed in the middle, then resumed."""

from __future__ import annotations

import pickle
import shutil
from dataclasses import dataclass, replace
from pathlib import Path

import pytest
from filelock import FileLock

from tests.cases.tiny_campaign import Ending, contents, give, kill_at

#: The file whose birth ends the first process, and the step that it belongs to.
BEGUN, INTERRUPTED = "bandpass/plane/scan.dsl/manifest.json", "bandpass/plane"


@dataclass(frozen=True)
class Calibrated:
    """A calibrated campaign's folder, to be read only, its files when it was killed, and how it ended."""

    folder: Path
    killed: dict[str, bytes]
    ending: Ending


@pytest.fixture(scope="module")
def module_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder for the tests of a module."""
    return tmp_path_factory.mktemp("module")


@pytest.fixture(scope="session")
def calibrated(tmp_path_factory: pytest.TempPathFactory, worker_id: str) -> Calibrated:
    """The campaign; of processes that share the tests the first makes it, the others copy it."""
    home = tmp_path_factory.mktemp("campaigns")
    if worker_id == "master":
        return _make(home)
    shared = tmp_path_factory.getbasetemp().parent / "calibrated"
    made = shared / "made.pickle"
    with FileLock(f"{shared}.lock"):
        if not made.exists():
            shutil.rmtree(shared, ignore_errors=True)  # half of one that failed
            own = _make(home)
            shutil.copytree(own.folder, shared / own.folder.name)
            made.write_bytes(pickle.dumps(own))
            return own
    found = pickle.loads(made.read_bytes())
    assert isinstance(found, Calibrated)
    own = replace(found, folder=home / found.folder.name)
    shutil.copytree(shared / own.folder.name, own.folder)
    return own


@pytest.fixture(scope="session")
def untouched(calibrated: Calibrated) -> dict[str, bytes]:
    """All files of the campaign before any test has used it."""
    return contents(calibrated.folder)


def _make(home: Path) -> Calibrated:
    """``calibrate all``, killed while the filters' first scan runs, and the same command without options."""
    folder = home / "campaign"
    kill_at(folder, BEGUN)
    killed = contents(folder)
    return Calibrated(
        folder, killed, give("calibrate", "all", str(folder), "--yes", "--no-library", "--json")
    )
