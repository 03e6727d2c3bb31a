"""Figures that are kept in a file beside a test, so that whatever changes them is seen.

Those who meant to change them write the file again; what differs in it is what did change.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from pathlib import Path

Figures = Mapping[str, float]

#: Rounding of another processor or of a newer library changes less; hardly any change of a formula does.
SHARE, SLACK = 5e-4, 1e-5


def read_kept(path: Path) -> dict[str, float]:
    """What was kept."""
    content: dict[str, float] = json.loads(path.read_text(encoding="utf-8"))
    return content


def keep(path: Path, figures: Figures) -> None:
    """Write figures to a file, one a line."""
    rounded = {name: float(f"{value:.6g}") for name, value in figures.items()}
    path.write_text(json.dumps(rounded, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")


def changes(
    before: Figures, now: Figures, slack: Callable[[str], float] = lambda name: SLACK
) -> dict[str, str]:
    """Figures that changed by more than ``slack`` of their name and more than a share of them.

    In words: before and now.
    """
    names = [*before, *(name for name in now if name not in before)]
    told = {}
    for name in names:
        old, new = before.get(name), now.get(name)
        if old is None or new is None or not abs(new - old) <= max(SHARE * abs(old), slack(name)):
            told[name] = f"{_said(old)} -> {_said(new)}"
    return told


def _said(value: float | None) -> str:
    return "none" if value is None else f"{value:.6g}"
