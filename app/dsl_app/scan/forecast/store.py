"""A cache of predictions, in one file per rig. No Qt."""

from __future__ import annotations

import hashlib
import json
import logging
from pathlib import Path
from typing import TYPE_CHECKING

from dsl_core import __version__
from dsl_core.errors import StoreError
from dsl_core.io.atomic import write_atomic
from dsl_core.io.reading import read_json
from dsl_core.model.plan import CapturePlan
from dsl_core.model.rig import Rig

if TYPE_CHECKING:
    from dsl_core.planning.prediction import Prediction

_log = logging.getLogger(__name__)
#: Beyond this number, the files of the least recently used rigs are deleted.
MOST_RIGS = 20


class ForecastStore:
    """Predictions of plans for one rig, latency and scene; an unreadable file is replaced.

    ``scene`` identifies the scene.
    """

    def __init__(self, folder: Path, rig: Rig, latency_ms: float, scene: str = "") -> None:
        self._path = folder / f"{_stamp(rig, latency_ms, scene)}.json"
        self._known: dict[str, dict[str, object]] = {}
        self._is_changed = False
        try:
            content = read_json(self._path)
            self._known = {str(key): dict(value) for key, value in content.items()}
        except FileNotFoundError:
            pass
        except (OSError, ValueError, TypeError, AttributeError) as error:
            _log.warning("The predictions %s cannot be read (%s) and are computed again.", self._path, error)

    def find(self, plan: CapturePlan) -> Prediction | None:
        """The prediction of a plan, or None."""
        from pydantic import ValidationError

        from dsl_core.planning.prediction import Prediction

        try:
            return Prediction.model_validate(self._known[_key(plan)])
        except (KeyError, ValidationError):
            return None

    def keep(self, plan: CapturePlan, found: Prediction) -> None:
        """Remember a prediction until `save`."""
        self._known[_key(plan)] = found.model_dump()
        self._is_changed = True

    def save(self) -> None:
        """Write new predictions; failing only costs the time to predict again."""
        if not self._is_changed:
            return
        try:
            self._path.parent.mkdir(parents=True, exist_ok=True)
            write_atomic(self._path, json.dumps(self._known).encode())
            old = sorted(self._path.parent.glob("*.json"), key=lambda path: path.stat().st_mtime)
            for path in old[:-MOST_RIGS]:
                path.unlink(missing_ok=True)
        except (OSError, StoreError) as error:
            _log.warning("The predictions could not be saved (%s).", error)
        self._is_changed = False


def _stamp(rig: Rig, latency_ms: float, scene: str) -> str:
    """A name for everything that predictions depend on, including the program."""
    known = rig.model_dump_json(exclude={"name", "provenance", "calibrations"})
    return _digest(f"{_method()} {latency_ms!r} {scene!r} {known}")


def _key(plan: CapturePlan) -> str:
    return _digest(plan.model_dump_json(exclude={"name", "schema_version"}))


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()[:32]


def _method() -> str:
    """A hash of the program's version and, where readable, the sources that predict."""
    import dsl_core.planning

    hashed = hashlib.sha256(__version__.encode())
    for folder in dsl_core.planning.__path__:
        for path in sorted(Path(folder).glob("*.py")):
            hashed.update(path.read_bytes())
    return hashed.hexdigest()
