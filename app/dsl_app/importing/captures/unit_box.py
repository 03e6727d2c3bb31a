"""The box for the unit that lengths of another program's calibration are in."""

from __future__ import annotations

from dsl_app.shared.widgets.forms import NumberBox


def unit_box() -> NumberBox:
    """A box for the unit of lengths, mm."""
    tip = "Length of one unit of the file: 1 for millimetres, 1000 for metres"
    return NumberBox("Unit of lengths", 1e-6, 1e6, 1.0, "mm", 3, tip)
