"""What was found of a scan's pictures, kept with it, so that it is not computed again for every result.

It holds for the very frames, plan and calibration that it names. Any other, a file that is damaged, or one of
another version counts as none.
"""

from __future__ import annotations

import hashlib
import json

from pydantic import Field

from dsl_core.errors import StoreError
from dsl_core.io.records import read_record, replace_record
from dsl_core.io.scan.folder import ScanReader
from dsl_core.model.base import Record
from dsl_core.model.rig import Rig
from dsl_core.model.scan_proof import ScanProof
from dsl_core.version import __version__

PROOF_NAME = "proof.json"


class _ProofFile(Record):
    of: str = Field(pattern="^[0-9a-f]{64}$")
    found: ScanProof


def save_proof(reader: ScanReader, rig: Rig, found: ScanProof) -> None:
    """Keep what was found of a scan with this calibration; raises `StoreError` when the disk fails."""
    replace_record(reader.folder / PROOF_NAME, _ProofFile(of=_name_of(reader, rig), found=found))


def read_proof(reader: ScanReader, rig: Rig) -> ScanProof | None:
    """What was found of just these frames with this calibration; None if that is not known."""
    path = reader.folder / PROOF_NAME
    if not path.is_file():
        return None
    try:
        kept = read_record(path, _ProofFile)
    except StoreError:
        return None
    return kept.found if kept.of == _name_of(reader, rig) else None


def _name_of(reader: ScanReader, rig: Rig) -> str:
    """A name that no other frames, plan, calibration or version of the program share."""
    frames = [(shot, entry.crc32) for shot, entry in sorted(reader.entries.items())]
    facts = [__version__, reader.plan.model_dump_json(), rig.model_dump_json(), frames]
    return hashlib.sha256(json.dumps(facts).encode()).hexdigest()
