"""Figures of the rig that the smallest campaign ends with.

``python -m tests.campaign.kept_figures`` keeps them as they are now.
"""

from __future__ import annotations

import json
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from tests.cases.kept_figures import SLACK, Figures, keep
from tests.cases.tiny_campaign import command_all, give

KEPT = Path(__file__).with_name("kept_rig.json")
#: Parts of a rig that nobody measured, and those of the film, which figures tell with their deviations.
LEFT_OUT = ("schema_version", "provenance", "conditions", "calibrations", "film", "residual")
#: By how much rounding may change what is known badly, in deviations, and these themselves.
OF_DEVIATION, DEVIATION = 0.02, 0.005


def figures(rig_file: Path) -> dict[str, float]:
    """Parameters of a rig, long ones by their mean and their scatter, and what its calibrations judged by."""
    rig = json.loads(rig_file.read_text(encoding="utf-8"))
    found = dict(_numbers({name: value for name, value in rig.items() if name not in LEFT_OUT}))
    for calibration in rig["calibrations"]:
        for figure in calibration["figures"]:
            name = f"{calibration['title']}: {figure['name']}"
            found |= {name: figure["value"], f"{name}, deviation": figure["std"] or 0.0}
    return found


def slack(name: str, before: Figures) -> float:
    """By how much a figure may change, however small it is."""
    if name.endswith(", deviation"):
        return DEVIATION * before.get(name, 0.0)
    return max(OF_DEVIATION * before.get(f"{name}, deviation", 0.0), SLACK)


def _numbers(value: Any, name: str = "") -> Iterator[tuple[str, float]]:
    """All numbers of a record by the names that lead to them."""
    match value:
        case dict():
            for key, inner in value.items():
                yield from _numbers(inner, f"{name} {key}".strip())
        case [int() | float(), *_]:
            values = np.array(value, np.float64)
            yield f"{name}, mean", float(values.mean())
            yield f"{name}, scatter", float(values.std())
        case list():
            for number, inner in enumerate(value):
                yield from _numbers(inner, f"{name} {number}")
        case bool():
            pass
        case int() | float():
            yield name, float(value)


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as folder:
        ending = give(*command_all(Path(folder) / "campaign"))
        assert ending.code == 0, ending.err
        keep(KEPT, figures(Path(folder) / "campaign" / "rig.json"))
