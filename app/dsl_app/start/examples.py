"""The finished scans that come with the program."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Example:
    """A result in ``resources/examples/KEY.zarr``."""

    key: str
    title: str
    about: str


EXAMPLES = (
    Example("color-checker", "Color Checker", "24 patches of known reflectance, flat, at 700 mm"),
    Example("face", "Face", "A curved surface: skin with the double dip of haemoglobin, lips, hair"),
)
