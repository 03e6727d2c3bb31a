"""What other packages add to this program by entry points, such as formats; `devices.registry` finds rigs."""

from __future__ import annotations

import logging
from importlib.metadata import entry_points
from typing import TypeVar

T = TypeVar("T")
_log = logging.getLogger(__name__)


def load_plugins(group: str, kind: type[T]) -> list[T]:
    """The objects of a ``kind`` that installed packages offer in a ``group``, in the order of their names.

    What cannot be loaded, or is something else, is left out and named in a warning: a format that somebody
    added keeps nobody from using the others.
    """
    found: list[T] = []
    for point in sorted(entry_points(group=group), key=lambda each: (each.name, each.value)):
        package = "a package" if point.dist is None else f"{point.dist.name} {point.dist.version}"
        try:
            offered = point.load()
        except Exception as error:
            _log.warning("%s offers %s, which cannot be loaded (%r). Update it.", package, point.name, error)
            continue
        if isinstance(offered, kind):
            found.append(offered)
        else:
            kinds = type(offered).__name__, kind.__name__
            _log.warning("%s offers %s, a %s instead of a %s. Update it.", package, point.name, *kinds)
    return found
