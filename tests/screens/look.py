"""In which sizes and themes pictures are made."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

SIZES = ((1280, 800), (1920, 1080))
Theme = Literal["light", "dark"]
THEMES: tuple[Theme, ...] = ("light", "dark")


@dataclass(frozen=True)
class Look:
    """A size of the screen in pixels, and a theme."""

    width: int
    height: int
    theme: Theme

    @property
    def name(self) -> str:
        """The folder of its pictures."""
        return f"{self.width}x{self.height}-{self.theme}"

    @classmethod
    def of(cls, name: str) -> Look:
        """The look of a name."""
        size, _, theme = name.partition("-")
        width, height = parse_size(size)
        return cls(width, height, "dark" if theme == "dark" else "light")


def parse_size(text: str) -> tuple[int, int]:
    """Width and height of ``1280x800``; raises `ValueError`."""
    width, _, height = text.partition("x")
    return int(width), int(height)


def pictures(folder: Path) -> dict[str, tuple[Path, ...]]:
    """The pictures of every look that a folder holds, by the look's name."""
    found = {}
    for each in sorted(folder.iterdir()):
        if each.is_dir():
            found[each.name] = tuple(sorted(each.glob("*.png")))
    return found
