"""Predictions that are known: a file for each rig and scene, and the twin's that come with the program."""

from __future__ import annotations

import hashlib
import json
import logging
from functools import lru_cache
from pathlib import Path
from typing import Any

from dsl_core.errors import StoreError
from dsl_core.io.atomic import make_folder, write_atomic
from dsl_core.io.reading import read_json
from dsl_core.model.plan import CapturePlan
from dsl_core.model.rig import Rig
from dsl_core.planning.expected import Prediction
from dsl_core.resources import own_folder, resource_path
from dsl_core.version import __version__

_log = logging.getLogger(__name__)
#: Beyond this number, the files of the least recently used rigs are deleted.
MOST_RIGS = 20
#: What keys of predictions without the width of peaks end with.
WITHOUT_PEAKS = " without peaks"


#: The predictions that come with the program, by `rig_stamp`.
SHIPPED = "predictions/twin.json"


def store_folder() -> Path:
    """Where predictions are kept on this system, for the window and the command line."""
    return own_folder() / "forecasts"


class PredictionStore:
    """Predictions of plans for one rig, latency and scene; an unreadable file is replaced.

    ``scene`` identifies the scene; empty for the usual one. ``peaks`` tells predictions with the width of
    narrow peaks from those without, which take less time and serve where any does.
    """

    def __init__(self, folder: Path, rig: Rig, latency_ms: float, scene: str = "") -> None:
        self._path = folder / f"{_stamp(rig, latency_ms, scene)}.json"
        self._known: dict[str, dict[str, object]] = {}
        self._is_changed = False
        self._shipped = _shipped().get(rig_stamp(rig, latency_ms), {}) if not scene else {}
        try:
            content = read_json(self._path)
            self._known = {str(key): dict(value) for key, value in content.items()}
        except FileNotFoundError:
            pass
        except (OSError, ValueError, TypeError, AttributeError) as error:
            _log.warning("The predictions %s cannot be read (%s) and are computed again.", self._path, error)

    def find(self, plan: CapturePlan, peaks: bool = True) -> Prediction | None:
        """The prediction of a plan, or None."""
        from pydantic import ValidationError

        key = plan_key(plan)
        known = self._known.get(key) or self._shipped.get(key)
        if known is None and not peaks:
            known = self._known.get(key + WITHOUT_PEAKS)
        try:
            return None if known is None else Prediction.model_validate(known)
        except ValidationError:
            return None

    def keep(self, plan: CapturePlan, found: Prediction, peaks: bool = True) -> None:
        """Remember a prediction until `save`."""
        self._known[plan_key(plan) + ("" if peaks else WITHOUT_PEAKS)] = found.model_dump()
        self._is_changed = True

    def save(self) -> None:
        """Write new predictions; failing only costs the time to predict again."""
        if not self._is_changed:
            return
        try:
            make_folder(self._path.parent)
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


def rig_stamp(rig: Rig, latency_ms: float) -> str:
    """A name for a rig as far as predictions depend on it, the same on machines that round otherwise."""
    # Without what nobody measured, so that a rig that could know more is still the same.
    known = rig.model_dump(mode="json", exclude={"name", "provenance", "calibrations"}, exclude_none=True)
    return _digest(json.dumps([latency_ms, _rounded(known)]))


def _rounded(value: Any) -> Any:
    if isinstance(value, float):
        return float(f"{value:.9g}")
    if isinstance(value, dict):
        return {key: _rounded(each) for key, each in value.items()}
    return [_rounded(each) for each in value] if isinstance(value, list) else value


@lru_cache(maxsize=1)
def _shipped() -> dict[str, dict[str, dict[str, Any]]]:
    """Predictions that come with the program, by rig and plan."""
    return dict(json.loads(resource_path(SHIPPED).read_text(encoding="utf-8")))


def plan_key(plan: CapturePlan) -> str:
    """A name for a plan as far as predictions depend on it."""
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
