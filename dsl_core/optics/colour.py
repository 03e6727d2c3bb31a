"""From reflectance spectra to colours: CIE XYZ, sRGB, CIE Lab and CIEDE2000.

The bands of a scan need not cover the visible range (430 to 660 nm by default, which holds 99 % of Y,
95 % of X and 88 % of Z of a white under D65). As ASTM E308 recommends for truncated data, the weights of
the missing ends go to the first and the last band, as if the spectrum went on unchanged; so a perfect
diffuser is white on every grid. The tables are files of the resources.
"""

from __future__ import annotations

from functools import cache, lru_cache
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from dsl_core.resources import resource_path

Floats = NDArray[np.float64]
#: Colours computed from float32 cubes stay float32.
AnyFloats = NDArray[np.float32] | NDArray[np.float64]
F = TypeVar("F", np.float32, np.float64)

# CIE 1931 2 degree colour matching functions and illuminant D65 at 5 nm, 380 to 780 nm.
_TABLE: Floats = np.loadtxt(resource_path("colour/cie_1931_d65.csv"), delimiter=",", unpack=True)
#: Shape (81,), nm.
CIE_NM: Floats = _TABLE[0]
#: Shape (3, 81).
CIE_1931_XYZ: Floats = _TABLE[1:4]
#: Shape (81,).
CIE_D65: Floats = _TABLE[4]
#: XYZ (D65 white, Y = 1) to linear sRGB, IEC 61966-2-1.
_XYZ_TO_SRGB = np.array([[3.2406, -1.5372, -0.4986], [-0.9689, 1.8758, 0.0415], [0.0557, -0.2040, 1.0570]])
#: Least shares of X, Y and Z of the perfect diffuser that bands must hold for a colour. Missing ends are
#: continued as they are at the last band, which is right for short ones alone.
LEAST_SEEN = (0.7, 0.7, 0.55)
#: A band says nothing of light farther away: a line between two that are farther apart is a guess.
#: Colours of a chart in bands of 30 nm differ from those of fine ones by less than 2 (CIEDE2000), of 46 nm by
#: up to 4, be they values or means of bands.
_REACH_NM = 12.5
_LUT_STEPS = 4096
#: Pixels per block, so that intermediates stay in the processor's cache.
_BLOCK = 32768


@cache
def _illuminants() -> dict[str, Floats]:
    """Relative power of illuminants but D65 on the table's wavelengths, (81,) each."""
    return {name: power for name, (_, power) in read_columns("colour/illuminants.csv").items()}


def read_columns(resource: str) -> dict[str, tuple[Floats, Floats]]:
    """Wavelengths in nm and values of each named column of a table of the resources."""
    with resource_path(resource).open(encoding="utf-8") as lines:
        next(lines)  # where the table is from
        names = next(lines).rstrip("\n").split(",")
        nm, *columns = np.loadtxt(lines, delimiter=",", unpack=True)
    return {name: (nm, column) for name, column in zip(names[1:], columns, strict=True)}


def _illuminant(name: str) -> Floats:
    """Relative power on the table's wavelengths, shape (81,)."""
    if name == "D65":
        return CIE_D65
    known = _illuminants()
    if name not in known:
        raise ValueError(f"unknown illuminant {name!r}; known are D65, {', '.join(known)}")
    return known[name]


def observer_weights(wavelengths_nm: Floats, illuminant: str = "D65") -> Floats:
    """Weights that turn reflectance at rising wavelengths (bands,) into XYZ, shape (3, bands).

    Linear between bands, constant beyond them; the perfect diffuser has Y = 1. They are shared and read only.
    Raises ``ValueError`` for an unknown illuminant or wavelengths that do not rise.
    """
    bands = np.asarray(wavelengths_nm, np.float64)
    return _observer_weights(bands.shape, bands.tobytes(), illuminant)


@lru_cache(maxsize=64)
def _observer_weights(shape: tuple[int, ...], content: bytes, illuminant: str) -> Floats:
    """The weights of one grid, of which few occur: a comparison of colours would mostly compute them."""
    from scipy.interpolate import CubicSpline

    bands = np.frombuffer(content, np.float64).reshape(shape)
    if bands.ndim != 1 or np.any(np.diff(bands) <= 0):
        raise ValueError("wavelengths must be one rising row of band centres")
    fine = np.arange(CIE_NM[0], CIE_NM[-1] + 1.0)
    power = np.interp(fine, CIE_NM, _illuminant(illuminant))
    matching = CubicSpline(CIE_NM, CIE_1931_XYZ, axis=1)(fine) * power
    spread = np.stack([np.interp(fine, bands, row) for row in np.eye(bands.size)])
    weights = np.asarray(matching @ spread.T / matching[1].sum())
    weights.flags.writeable = False
    return weights


def seen_shares(bands_nm: Floats, nm: Floats, matching: Floats) -> Floats:
    """Shares of X, Y and Z (3,) of the perfect diffuser that bands (bands,), nm, hold.

    ``matching`` (3, wavelengths) is observer times illuminant at ``nm``. Bands reach half a step beyond ends,
    and into gaps between them no farther than 12.5 nm.
    """
    half = abs(bands_nm[-1] - bands_nm[0]) / max(len(bands_nm) - 1, 1) / 2
    inside = (nm >= bands_nm.min() - half) & (nm <= bands_nm.max() + half)
    inside &= np.abs(nm[:, None] - bands_nm).min(1) <= _REACH_NM
    return np.asarray(matching[:, inside].sum(1) / matching.sum(1))


def hold_colour(bands_nm: Floats) -> bool:
    """Whether bands (bands,), nm, hold enough of a colour under D65 for a figure of it.

    >>> hold_colour(np.arange(430.0, 661.0, 5.0)), hold_colour(np.arange(440.0, 461.0, 5.0))
    (True, False)
    >>> hold_colour(np.array([450.0, 550.0, 650.0]))
    False
    """
    return bool((seen_shares(np.asarray(bands_nm), CIE_NM, CIE_1931_XYZ * CIE_D65) >= LEAST_SEEN).all())


def reflectance_to_xyz(cube: AnyFloats, wavelengths_nm: Floats, illuminant: str = "D65") -> AnyFloats:
    """XYZ with Y = 1 for white, shape (3, ...), of a band-first cube (bands, ...); NaN stays NaN."""
    weights = observer_weights(wavelengths_nm, illuminant)
    return _apply(weights, cube)


def _apply(matrix: Floats, stack: AnyFloats) -> AnyFloats:
    """``matrix`` (n, k) times the first axis of a stack (k, ...), in the stack's precision."""
    kind = np.float32 if stack.dtype == np.float32 else np.float64
    flat = np.ascontiguousarray(stack, kind).reshape(stack.shape[0], -1)
    product: AnyFloats = np.matmul(matrix.astype(kind), flat)
    return product.reshape(matrix.shape[0], *stack.shape[1:])


def srgb_encode(linear: Floats) -> Floats:
    """The transfer curve of sRGB (IEC 61966-2-1) for linear values 0..1."""
    return np.where(
        linear <= 0.0031308, 12.92 * linear, 1.055 * np.maximum(linear, 0.0031308) ** (1 / 2.4) - 0.055
    )


def srgb_decode(values: NDArray[F]) -> NDArray[F]:
    """Linear light 0..1 of values of sRGB 0..1 (IEC 61966-2-1)."""
    steep = ((np.maximum(values, 0.04045) + 0.055) / 1.055) ** 2.4
    return np.asarray(np.where(values <= 0.04045, values / 12.92, steep), values.dtype)


@cache
def _encode_table() -> NDArray[np.float32]:
    """The transfer curve over the square root of the linear value, where it is nearly straight."""
    root = np.arange(_LUT_STEPS + 1) / _LUT_STEPS
    return srgb_encode(root**2).astype(np.float32)


def xyz_to_srgb(xyz: AnyFloats) -> NDArray[np.float32]:
    """Colour in sRGB, 0..1, of XYZ relative to D65 (white: Y = 1), shape (3, ...); clipped, NaN stays."""
    return _encode(_apply(_XYZ_TO_SRGB, xyz))


def reflectance_to_srgb(cube: AnyFloats, wavelengths_nm: Floats) -> NDArray[np.float32]:
    """Colour in sRGB, 0..1, under D65 of a band-first cube (bands, ...), as (3, ...); clipped, NaN stays."""
    return _encode(_apply(_XYZ_TO_SRGB @ observer_weights(wavelengths_nm), cube))


def _encode(linear: AnyFloats) -> NDArray[np.float32]:
    """Clip and apply the transfer curve by table; the error is below 1e-4."""
    table = _encode_table()
    flat = np.asarray(linear, np.float32).reshape(-1)
    out = np.empty_like(flat)
    for start in range(0, flat.size, _BLOCK):
        part = flat[start : start + _BLOCK]
        # NaN would have no place in the table: it goes in as 0 and is put back.
        clean = np.clip(np.nan_to_num(part, nan=0.0), 0.0, 1.0)
        out[start : start + _BLOCK] = table[(np.sqrt(clean) * _LUT_STEPS + 0.5).astype(np.int32)]
    out[np.isnan(flat)] = np.nan
    return out.reshape(linear.shape)


def xyz_to_lab(xyz: AnyFloats, white_xyz: Floats) -> Floats:
    """CIE 1976 L*a*b* of XYZ (3, ...) relative to a white (3,), shape (3, ...)."""
    white = np.asarray(white_xyz, np.float64).reshape(3, *[1] * (xyz.ndim - 1))
    ratio = np.asarray(xyz, np.float64) / white
    # CIE 15: a straight line below (6/29)^3.
    f = np.where(ratio > (6 / 29) ** 3, np.cbrt(ratio), ratio * (29 / 6) ** 2 / 3 + 4 / 29)
    return np.stack([116 * f[1] - 16, 500 * (f[0] - f[1]), 200 * (f[1] - f[2])])


def reflectance_to_lab(cube: AnyFloats, wavelengths_nm: Floats, illuminant: str = "D65") -> Floats:
    """CIE L*a*b* of a band-first cube (bands, ...), the perfect diffuser as white, shape (3, ...)."""
    weights = observer_weights(wavelengths_nm, illuminant)
    return xyz_to_lab(_apply(weights, np.asarray(cube, np.float64)), weights.sum(axis=1))


def delta_e_2000(lab: Floats, reference_lab: Floats) -> Floats:
    """CIEDE2000 colour difference of two arrays of L*a*b*, shapes (3, ...), with unit parametric factors.

    G. Sharma, W. Wu, E. N. Dalal, "The CIEDE2000 color-difference formula", Color Res. Appl. 30 (2005).
    """
    light_1, light_2 = lab[0], reference_lab[0]
    mean_chroma = (np.hypot(lab[1], lab[2]) + np.hypot(reference_lab[1], reference_lab[2])) / 2
    stretch = 1.5 - 0.5 * np.sqrt(mean_chroma**7 / (mean_chroma**7 + 25.0**7))
    chroma_1, hue_1 = _polar(lab[1] * stretch, lab[2])
    chroma_2, hue_2 = _polar(reference_lab[1] * stretch, reference_lab[2])
    turn = (hue_2 - hue_1 + np.pi) % (2 * np.pi) - np.pi
    product = chroma_1 * chroma_2
    delta_hue = 2 * np.sqrt(product) * np.sin(np.where(product == 0, 0.0, turn) / 2)
    # The mean hue of a grey and a colour is the hue of the colour, whose angle is then the sum.
    mean_hue = np.where(product == 0, hue_1 + hue_2, hue_1 + turn / 2)
    mean_light, mean_c = (light_1 + light_2) / 2, (chroma_1 + chroma_2) / 2
    scale_l = 1 + 0.015 * (mean_light - 50) ** 2 / np.sqrt(20 + (mean_light - 50) ** 2)
    scale_c = 1 + 0.045 * mean_c
    scale_h = 1 + 0.015 * mean_c * _hue_weight(mean_hue)
    lightness = (light_2 - light_1) / scale_l
    chroma = (chroma_2 - chroma_1) / scale_c
    hue = delta_hue / scale_h
    turn_term = _rotation(mean_hue, mean_c) * chroma * hue
    return np.asarray(np.sqrt(lightness**2 + chroma**2 + hue**2 + turn_term))


def _polar(a: Floats, b: Floats) -> tuple[Floats, Floats]:
    """Chroma and hue angle in 0..2 pi."""
    return np.hypot(a, b), np.arctan2(b, a) % (2 * np.pi)


def _hue_weight(hue: Floats) -> Floats:
    """The factor T of CIEDE2000."""
    return np.asarray(
        1
        - 0.17 * np.cos(hue - np.pi / 6)
        + 0.24 * np.cos(2 * hue)
        + 0.32 * np.cos(3 * hue + np.pi / 30)
        - 0.20 * np.cos(4 * hue - np.radians(63))
    )


def _rotation(hue: Floats, chroma: Floats) -> Floats:
    """The term R_T of CIEDE2000, which turns the ellipses of the blues."""
    degrees = np.degrees(hue) % 360
    angle = np.radians(60) * np.exp(-(((degrees - 275) / 25) ** 2))
    return np.asarray(-2 * np.sqrt(chroma**7 / (chroma**7 + 25.0**7)) * np.sin(angle))
