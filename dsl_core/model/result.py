"""The result of a scan: names, units and flags of an `xarray.Dataset`."""

from __future__ import annotations

from enum import IntFlag
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from dsl_core.model.attributes import band_attributes

if TYPE_CHECKING:
    import xarray as xr

SCHEMA_VERSION = 1
#: Name of the attribute with the mean light of black frames in R, G and B, DN per ms, as a JSON list.
BLACK_ATTRIBUTE = "black_dn_per_ms"


class Flag(IntFlag):
    """Why a pixel is limited; 0 means nothing is wrong."""

    NO_LIGHT = 1
    SATURATED = 2
    CODE_UNSURE = 4
    OUT_OF_RANGE = 8
    NOT_REFINED = 16
    DEPTH_EDGE = 32
    BANDS_UNREACHED = 64
    AT_BOUND = 128
    POOR_FIT = 256
    NON_FINITE = 512
    CODES_DISAGREE = 1024
    UNUSUAL_PEAK = 2048


REASONS: dict[Flag, str] = {
    Flag.NO_LIGHT: "too little projector light reaches this pixel (shadow, black or out of the beam)",
    Flag.SATURATED: "a frame that is needed here is saturated in every setting",
    Flag.CODE_UNSURE: "a bit of the binary code is too close to its inverse to be decided",
    Flag.OUT_OF_RANGE: "the triangulated depth is outside the calibrated range",
    Flag.NOT_REFINED: "the column could not be refined below one pixel; depth is coarse",
    Flag.DEPTH_EDGE: (
        "depth jumps next to this pixel: normal and shading are unreliable; with too few neighbours that have"
        " a depth, they are not given, and neither is the spectrum"
    ),
    Flag.BANDS_UNREACHED: (
        "the first orders bring too little light to some bands, or none; prior and zero-order colour decide"
        " there"
    ),
    Flag.AT_BOUND: "the spectrum touches a bound of the solver in some bands",
    Flag.POOR_FIT: (
        "the measured intensities do not fit any spectrum (mixed materials, interreflection, motion)"
    ),
    Flag.NON_FINITE: "the input or an intermediate value was not a finite number",
    Flag.CODES_DISAGREE: "codes disagree: light arrives by another path (reflections between surfaces)",
    Flag.UNUSUAL_PEAK: (
        "lines have another shape here than elsewhere (out of focus, an edge, a translucent surface, glare)"
    ),
}

#: Flags after which depth, respectively the spectrum, is not given at all (NaN).
DEPTH_INVALID = Flag.NO_LIGHT | Flag.CODE_UNSURE | Flag.OUT_OF_RANGE | Flag.NON_FINITE | Flag.CODES_DISAGREE
SPECTRUM_INVALID = DEPTH_INVALID


class Reach(IntFlag):
    """Which light measured a band of a pixel."""

    PLUS_ONE = 1
    MINUS_ONE = 2
    ZERO_ONLY = 4


def reasons(flags: int) -> list[str]:
    """Sentences for every bit of a pixel's flags.

    >>> reasons(0)
    []
    >>> reasons(Flag.NO_LIGHT)[0].startswith("too little")
    True
    """
    return [text for flag, text in REASONS.items() if flags & flag]


#: name -> (dimensions, unit, long name); every variable a complete result holds.
VARIABLES: dict[str, tuple[tuple[str, ...], str, str]] = {
    "depth_mm": (("y", "x"), "mm", "depth along the camera axis"),
    "depth_std_mm": (("y", "x"), "mm", "standard deviation of depth"),
    "column_px": (("y", "x"), "px", "projector column through the zero order"),
    "column_std_px": (("y", "x"), "px", "standard deviation of the column"),
    "row_px": (("y", "x"), "px", "projector row, where rows are coded and there is no depth"),
    "points_mm": (("axis", "y", "x"), "mm", "point in camera coordinates"),
    "normals": (("axis", "y", "x"), "1", "unit normal in camera coordinates, towards the camera"),
    "shading": (("y", "x"), "1", "cosine and distance factor of the illumination"),
    "reflectance": (("wavelength_nm", "y", "x"), "1", "reflectance; 1 is a perfect white"),
    "reflectance_std": (("wavelength_nm", "y", "x"), "1", "posterior standard deviation of reflectance"),
    "data_share": (("wavelength_nm", "y", "x"), "1", "share of the answer decided by data, not by the prior"),
    "reach": (
        ("wavelength_nm", "y", "x"),
        "bitmask",
        "orders that reach the band (1: +1, 2: -1, 4: zero only)",
    ),
    "rgb": (("channel", "y", "x"), "1", "sRGB under D65, 0..1"),
    "flags": (("y", "x"), "bitmask", "reasons why the pixel is limited; 0 is good"),
}


def build_result(
    arrays: dict[str, NDArray[np.generic]],
    wavelengths_nm: NDArray[np.float64],
    attributes: dict[str, str | int | float],
    origin: tuple[int, int] = (0, 0),
) -> xr.Dataset:
    """Assemble the dataset of a scan from arrays named as in `VARIABLES`.

    ``origin`` is the row and column of the camera's picture where the arrays begin.

    Unknown names raise ``KeyError``; missing ones are left out, so that a depth-only result is possible.
    """
    import xarray as xr

    data = {}
    for name, values in arrays.items():
        dims, unit, long_name = VARIABLES[name]
        data[name] = (dims, values, {"units": unit, "long_name": long_name})
    if "flags" in data:
        masks = [int(f) for f in Flag]
        names = " ".join(str(f.name).lower() for f in Flag)
        data["flags"][2].update({"flag_masks": masks, "flag_meanings": names})  # type: ignore[dict-item]
    rows, columns = next((values.shape[-2:] for values in arrays.values()), (0, 0))
    y, x = origin[0] + np.arange(rows), origin[1] + np.arange(columns)
    coords = {
        "y": ("y", y, {"units": "px", "long_name": "row of the camera's picture"}),
        "x": ("x", x, {"units": "px", "long_name": "column of the camera's picture"}),
        "wavelength_nm": ("wavelength_nm", wavelengths_nm, {"units": "nm", "long_name": "band centre"}),
        "axis": ("axis", ["x", "y", "z"]),
        "channel": ("channel", ["R", "G", "B"]),
    }
    used = {d for name in arrays for d in VARIABLES[name][0]}
    coords = {k: v for k, v in coords.items() if k in used}
    stated = {"schema_version": SCHEMA_VERSION, **band_attributes(wavelengths_nm), **attributes}
    return xr.Dataset(data, coords=coords, attrs=stated)


#: What each flag is called below a picture.
FLAG_NAMES: dict[Flag, str] = {flag: str(flag.name).lower().replace("_", " ") for flag in Flag}
#: One colour per flag, in the order of `Flag`; told apart by the common kinds of colour blindness
#: (after P. Tol, "Colour schemes", 2021, bright and muted).
FLAG_COLOURS: dict[Flag, str] = dict(
    zip(
        Flag,
        (
            "#332288", "#cc3311", "#aa4499", "#882255", "#ddcc77",
            "#999933", "#88ccee", "#44aa99", "#ee7733", "#555555",
            "#117733", "#bbbbbb",
        ),
        strict=True,
    )
)  # fmt: skip
#: From the gravest to the mildest: as declared, except for those that leave no depth and came later.
_GRAVEST = (Flag.NON_FINITE, Flag.CODES_DISAGREE)
GRAVITY = (*_GRAVEST, *(flag for flag in Flag if flag not in _GRAVEST))


def gravest_flag(flags: NDArray[np.integer]) -> NDArray[np.uint8]:
    """1 + index in `Flag` of each pixel's gravest flag, 0 where nothing is wrong."""
    order = list(Flag)
    classes = np.zeros(flags.shape, np.uint8)
    for flag in reversed(GRAVITY):
        classes[(flags & int(flag)) != 0] = 1 + order.index(flag)
    return classes
