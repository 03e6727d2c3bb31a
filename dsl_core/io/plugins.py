"""What other packages add to this program by entry points, such as formats; `devices.registry` finds rigs."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.metadata import entry_points
from typing import TypeVar

from dsl_core.errors import DslError

T = TypeVar("T")
_log = logging.getLogger(__name__)


@contextmanager
def told_as(what: str, kind: type[DslError]) -> Iterator[None]:
    """Around code of another package: its mistakes become a ``kind`` of error that says whose they are."""
    try:
        yield
    except DslError:
        raise
    except Exception as error:
        raise kind(
            f"{what}, which another package added, failed ({type(error).__name__}: {error}). Update that"
            " package, or remove it."
        ) from error


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
