"""What of a computer this process may use: a container or a batch system may grant less than there is.

Files of a control group, version 2: https://docs.kernel.org/admin-guide/cgroup-v2.html; version 1 has others.
"""

from __future__ import annotations

import math
import os
from collections.abc import Iterator
from pathlib import Path

_GROUPS, _OWN = Path("/sys/fs/cgroup"), Path("/proc/self/cgroup")


def usable_cores() -> int:
    """How many cores this process may use, at least one."""
    bound = os.sched_getaffinity(0) if hasattr(os, "sched_getaffinity") else range(os.cpu_count() or 1)
    most = float(len(bound))
    for group in _groups("cpu"):
        share, period = (*_numbers(group / "cpu.max"), math.inf, 1.0)[:2]
        (old,) = _numbers(group / "cpu.cfs_quota_us") or (-1.0,)
        if old > 0:
            share, period = old, (*_numbers(group / "cpu.cfs_period_us"), 100_000.0)[0]
        most = min(most, share / period)
    return max(int(most), 1)


def free_memory_bytes() -> float:
    """Memory that this process may still take, caches that make room included."""
    import psutil

    free = float(psutil.virtual_memory().available)
    for group in _groups("memory"):
        for limit, used, cache in (
            ("memory.max", "memory.current", "inactive_file"),
            ("memory.limit_in_bytes", "memory.usage_in_bytes", "total_inactive_file"),
        ):
            for most, now in zip(_numbers(group / limit), _numbers(group / used), strict=False):
                free = min(free, max(most - now + _of_table(group / "memory.stat", cache), 0.0))
    return free


def _groups(kind: str) -> Iterator[Path]:
    """The folders of the group of this process and of those above it, each of which may limit it."""
    for line in _text(_OWN).splitlines():
        _, kinds, name = line.split(":", 2)
        if not kinds or kind in kinds.split(","):
            # In a container, the names may be of its host, and its own group is the root.
            root = _GROUPS / kinds
            own = root / name.lstrip("/")
            yield from (each for each in (own, *own.parents) if each.is_relative_to(root))


def _numbers(path: Path) -> tuple[float, ...]:
    """The numbers of a file; none where it is not there, infinite where it says that there is no limit."""
    return tuple(math.inf if each == "max" else float(each) for each in _text(path).split())


def _of_table(path: Path, name: str) -> float:
    return sum(float(line.split()[1]) for line in _text(path).splitlines() if line.split()[0] == name)


def _text(path: Path) -> str:
    try:
        return path.read_text()
    except OSError:
        return ""
