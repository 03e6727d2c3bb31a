"""One small campaign for all that looks at a calibrated one: killed in the middle, and gone on with."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import pytest

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
def calibrated(tmp_path_factory: pytest.TempPathFactory) -> Calibrated:
    """``calibrate all``, killed while the filters' first scan runs, and the same command without options."""
    folder = tmp_path_factory.mktemp("calibrated") / "campaign"
    kill_at(folder, BEGUN)
    killed = contents(folder)
    return Calibrated(
        folder, killed, give("calibrate", "all", str(folder), "--yes", "--no-library", "--json")
    )
