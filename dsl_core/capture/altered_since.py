"""Whether the last sentinels of a scan show pictures that were altered on their way since it began."""

from __future__ import annotations

from collections.abc import Iterable

from dsl_core.capture.altered import alteration
from dsl_core.capture.sentinels import SensorWatch
from dsl_core.model.frames import FrameSource
from dsl_core.model.plan import CapturePlan, Role, Shot
from dsl_core.model.rig import Sensor


def alteration_of(
    source: FrameSource,
    sensor: Sensor | None = None,
    missing: Iterable[int] = (),
    bit_depth: int = 12,
    bayer: str = "RGGB",
) -> str:
    """What was done to pictures by the end of a scan, with what to do; empty if nothing shows.

    Reads white, black and a frame of the code, and the last sentinels that repeat all three, unless one of
    them is ``missing``. Without a ``sensor``, that which frames of ``bit_depth`` and ``bayer`` show is
    assumed. Raises `StoreError`.
    """
    first, last, gone = source.plan.references(), _last_round(source.plan), set(missing)
    if last is None or {shot.index for shot in (*first.values(), *last.values())} & gone:
        return ""
    white, black, code = (source.read(first[role]) for role in _ROLES)
    before, now = (white, black, code), tuple(source.read(last[role]) for role in _ROLES)
    watch = SensorWatch(source.plan, sensor, bit_depth, bayer)
    for shot in source.plan.shots():
        if shot.index in watch.wanted - gone:
            watch.add(shot, source.read(shot))
    found = alteration(before, (now[0], now[1], now[2]), watch.given(black))
    if not found:
        return ""
    return f"By frame {last['white'].number}: {found} Then scan again."


_ROLES: tuple[Role, ...] = ("white", "black", "code")


def _last_round(plan: CapturePlan) -> dict[Role, Shot] | None:
    """The last sentinels that repeat the references, by the role of these; None if not all are repeated."""
    role_of = {shot.index: role for role, shot in plan.references().items()}
    found = {role_of[s.pattern]: s for s in plan.shots() if s.role == "sentinel" and s.pattern in role_of}
    return found if len(found) == len(_ROLES) else None
