"""Words for records, so that every message names things alike."""

from __future__ import annotations

from dsl_core.model.plan import Shot


def describe_shot(shot: Shot) -> str:
    """Name a shot the way a person counts it.

    >>> describe_shot(Shot(44, "spectral", 3, 1, 10.0, 0.8))
    'frame 44 (spectral pattern 3, setting 1)'
    """
    return f"frame {shot.index} ({shot.role} pattern {shot.pattern}, setting {shot.setting})"
