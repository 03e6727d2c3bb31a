"""Whether the last sentinels of a scan show pictures that were altered on their way since it began."""

from __future__ import annotations

from collections.abc import Iterable

from dsl_core.capture.altered import alteration
from dsl_core.model.frames import FrameSource
from dsl_core.model.plan import CapturePlan, Role, Shot
from dsl_core.model.rig import Sensor


def alteration_of(source: FrameSource, sensor: Sensor | None = None, missing: Iterable[int] = ()) -> str:
    """What was done to pictures by the end of a scan, with what to do; empty if nothing shows.

    Reads white, black and a frame of the code, and the last sentinels that repeat all three, unless one of
    them is ``missing``. Without a ``sensor``, a usual one is assumed. Raises `StoreError`.
    """
    first, last = source.plan.references(), _last_round(source.plan)
    if last is None or {shot.index for shot in (*first.values(), *last.values())} & set(missing):
        return ""
    white, black, code = (source.read(first[role]) for role in _ROLES)
    before, now = (white, black, code), tuple(source.read(last[role]) for role in _ROLES)
    found = alteration(before, (now[0], now[1], now[2]), sensor or Sensor())
    if not found:
        return ""
    return f"By frame {last['white'].number}: {found} Then scan again."


_ROLES: tuple[Role, ...] = ("white", "black", "code")


def _last_round(plan: CapturePlan) -> dict[Role, Shot] | None:
    """The last sentinels that repeat the references, by the role of these; None if not all are repeated."""
    role_of = {shot.index: role for role, shot in plan.references().items()}
    found = {role_of[s.pattern]: s for s in plan.shots() if s.role == "sentinel" and s.pattern in role_of}
    return found if len(found) == len(_ROLES) else None
