"""Entry points of packages that are not installed."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Offer:
    """An entry point whose package offers an object."""

    group: str
    offered: object
    name: str = "mine"
    value: str = "mine:FORMAT"
    dist: None = None

    def load(self) -> object:
        """The object; an exception is raised instead."""
        if isinstance(self.offered, Exception):
            raise self.offered
        return self.offered


def added_by_a_package(group: str, offered: object) -> Offer:
    """An entry point of a group that loads as this object, or raises it."""
    return Offer(group, offered)
