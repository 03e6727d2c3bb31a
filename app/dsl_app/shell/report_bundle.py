"""Everything a bug report needs in one file: log, settings, versions, system. No Qt here."""

from __future__ import annotations

import json
import platform
import sys
import zipfile
from collections.abc import Iterable
from importlib.metadata import distributions
from pathlib import Path

from dsl_app.shared.settings import Settings
from dsl_core import __version__
from dsl_core.io.staging import staged


def write_report_bundle(path: Path, lines: Iterable[str], settings: Settings) -> Path:
    """Write a zip file, over one that exists: who chose its name was asked. Raises `StoreError`."""
    versions = sorted(f"{d.metadata['Name']}=={d.version}" for d in distributions())
    facts = {
        "dsl-scan": __version__,
        "python": sys.version,
        "system": platform.platform(),
        "packages": versions,
    }
    with (
        staged([path], overwrite=True) as (draft,),
        zipfile.ZipFile(draft, "w", zipfile.ZIP_DEFLATED) as bundle,
    ):
        bundle.writestr("log.txt", "\n".join(lines))
        bundle.writestr("settings.json", settings.model_dump_json(indent=1))
        bundle.writestr("versions.json", json.dumps(facts, indent=1))
    return path
