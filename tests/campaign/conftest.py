"""One small campaign for all that looks at a calibrated one: killed in the middle, and gone on with."""

from __future__ import annotations

import pickle
import shutil
from dataclasses import dataclass
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


@pytest.fixture(scope="session")
def calibrated(tmp_path_factory: pytest.TempPathFactory, worker_id: str) -> Calibrated:
    """The campaign; of processes that share the tests the first makes it, the others take it."""
    if worker_id == "master":
        return _make(tmp_path_factory.mktemp("calibrated"))
    shared = tmp_path_factory.getbasetemp().parent / "calibrated"
    made = shared / "made.pickle"
    with FileLock(f"{shared}.lock"):
        if not made.exists():
            shutil.rmtree(shared, ignore_errors=True)  # half of one that failed
            shared.mkdir()
            made.write_bytes(pickle.dumps(_make(shared)))
    found = pickle.loads(made.read_bytes())
    assert isinstance(found, Calibrated)
    return found


def _make(home: Path) -> Calibrated:
    """``calibrate all``, killed while the filters' first scan runs, and the same command without options."""
    folder = home / "campaign"
    kill_at(folder, BEGUN)
    killed = contents(folder)
    return Calibrated(
        folder, killed, give("calibrate", "all", str(folder), "--yes", "--no-library", "--json")
    )
