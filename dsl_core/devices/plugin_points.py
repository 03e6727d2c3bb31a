"""What installed packages add to this program, by entry points."""

from __future__ import annotations

from collections.abc import Sequence
from importlib.metadata import EntryPoint, entry_points


def points_of(group: str, built_in: Sequence[EntryPoint]) -> list[EntryPoint]:
    """Entry points of a group with those ``built_in``, by name; none is loaded.

    One that is built in is listed once, though this program's own metadata may name it as well; two packages
    that use one name are both listed.
    """
    unique = {(point.name, point.value): point for point in (*built_in, *entry_points(group=group))}
    return [unique[key] for key in sorted(unique)]
