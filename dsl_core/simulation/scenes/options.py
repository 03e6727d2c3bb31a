"""What scenes share: where the image centre lies, and how options are checked."""

from __future__ import annotations

import math

from dsl_core.errors import PlanError

#: The optical centre of the published camera lies beside the middle of its image; at 700 mm by this much.
IMAGE_CENTRE_MM = (6.0, -2.0)
#: Half sizes of a surface without end.
ENDLESS = (math.inf, math.inf)


def check_range(name: str, value: float, low: float, high: float, unit: str = "") -> None:
    """Raise `PlanError` unless ``low <= value <= high``."""
    if not low <= value <= high:
        wanted = f"{low:g} and {high:g} {unit}".rstrip()
        raise PlanError(f"Option {name} must lie between {wanted}, not {value:g}.")
