"""Pictures for people: colour, depth with a colour bar, one band, and flags with a legend.

Pixels without an answer are neutral grey, in the grey picture of a band dark blue. Provenance is kept in
the PNG's text chunks (PNG specification, 3rd edition, section 11.3.4).
"""

from __future__ import annotations

from collections.abc import Callable, Container, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from dsl_core.errors import StoreError
from dsl_core.io.export.common import colours, plane, provenance, require, require_suffix, wavelengths_nm
from dsl_core.io.staging import staged
from dsl_core.model.result import FLAG_COLOURS, FLAG_NAMES, Flag, gravest_flag
from dsl_core.model.result_order import without_missing_bands
from dsl_core.optics.levels import Levels, between, three_bands
from dsl_core.optics.relighting import relight
from dsl_core.solve.many import Check, never

if TYPE_CHECKING:
    import xarray as xr

Picture = NDArray[np.uint8]

GREY = (128, 128, 128)
_MARGIN_PX = 110


def export_png(
    result: xr.Dataset,
    path: Path,
    *,
    overwrite: bool = False,
    band_nm: float | None = None,
    light: str = "D65",
    adapted: bool = True,
    bands_nm: tuple[float, float, float] | None = None,
    colour_levels: Levels | None = None,
    bands_levels: Levels = (0.0, 1.0),
    band_levels: Levels = (0.0, 1.0),
    depth_levels_mm: Levels | None = None,
    check: Check = never,
) -> list[Path]:
    """Write ``NAME_rgb``, ``NAME_depth``, ``NAME_550nm``, ``NAME_flags.png``, as far as the result has them.

    ``path`` is ``NAME.png``; ``band_nm`` picks the band (the middle one if not given). Colours under another
    ``light`` than D65, as of `relight`, are named after it: ``NAME_rgb_A``. ``bands_nm`` adds three bands as
    red, green and blue: ``NAME_650_550_450nm``. Levels are the values that become black and white: of true
    colours 0..1 after their gamma, of bands their reflectance, of depth the ends of its colours in mm (nearly
    all pixels if not given). Raises `StoreError`, also when the result has no band within half a band's
    distance of a wavelength asked for.
    """
    require_suffix(path, ".png")
    from PIL import Image
    from PIL.PngImagePlugin import PngInfo

    has_bands = "reflectance" in result
    centres = wavelengths_nm(result) if has_bands else []
    look: dict[str, Any] = {"band_nm": band_nm, "light": light, "adapted": adapted, "bands_nm": bands_nm}
    files = picture_files(path, {str(name) for name in result.variables}, centres, **look)
    if not files:
        require(result, "A picture", "rgb")

    def band(nm: float | None) -> NDArray[np.float32]:
        return np.asarray(result["reflectance"][nearest_band(centres, nm)[0]].values)

    def colour() -> Picture:
        if light == "D65" or not has_bands:
            rgb = colours(result)
            assert rgb is not None
        else:
            known = without_missing_bands(result)
            rgb = relight(plane(known, "reflectance"), np.array(wavelengths_nm(known)), light, adapted)
        return rgb_picture(rgb, colour_levels)

    def three() -> Picture:
        cube = np.stack([band(nm) for nm in bands_nm or ()])
        return rgb_picture(three_bands(cube, (0, 1, 2), bands_levels))

    drawn: dict[str, Callable[[], Picture]] = {
        "colour": colour,
        "depth": lambda: depth_picture(plane(result, "depth_mm"), depth_levels_mm),
        "band": lambda: band_picture(band(band_nm), band_levels),
        "bands": three,
        "flags": lambda: flags_picture(result["flags"].values),
    }
    texts = PngInfo()
    for key, text in provenance(result).items():
        texts.add_itxt(key.encode("latin-1", "replace")[:79], text)
    with staged(list(files.values()), overwrite=overwrite) as drafts:
        for draft, shown in zip(drafts, files, strict=True):
            check()
            Image.fromarray(drawn[shown]()).save(draft, format="PNG", pnginfo=texts)
    return list(files.values())


def picture_files(
    path: Path,
    held: Container[str],
    centres_nm: Sequence[float],
    *,
    band_nm: float | None = None,
    light: str = "D65",
    adapted: bool = True,
    bands_nm: tuple[float, float, float] | None = None,
) -> dict[str, Path]:
    """The files that `export_png` writes of a result that holds variables, by what they show.

    Raises `StoreError` as it does for a wavelength.
    """
    has_bands = "reflectance" in held
    names: dict[str, str] = {}
    if has_bands or "rgb" in held:
        under = f"_{light}" if adapted else f"_{light}_unadapted"
        names["colour"] = f"rgb{under if has_bands and light != 'D65' else ''}"
    if "depth_mm" in held:
        names["depth"] = "depth"
    if has_bands:
        names["band"] = f"{nearest_band(centres_nm, band_nm)[1]:g}nm"
        if bands_nm is not None:
            names["bands"] = "_".join(f"{nearest_band(centres_nm, nm)[1]:g}" for nm in bands_nm) + "nm"
    if "flags" in held:
        names["flags"] = "flags"
    return {shown: path.with_name(f"{path.stem}_{name}.png") for shown, name in names.items()}


def nearest_band(centres: Sequence[float], band_nm: float | None) -> tuple[int, float]:
    """Index and centre (nm) of the band closest to a wavelength, of the middle band for None.

    Raises `StoreError` for a wavelength that no band holds.
    """
    if band_nm is None:
        return len(centres) // 2, centres[len(centres) // 2]
    best = int(np.argmin(np.abs(np.array(centres) - band_nm)))
    reach = max(np.diff(centres).max() / 2, 0.5) if len(centres) > 1 else 0.5
    if not abs(centres[best] - band_nm) <= reach:
        raise StoreError(
            f"There is no band at {band_nm:g} nm; the bands run from {centres[0]:g} to {centres[-1]:g} nm."
        )
    return best, centres[best]


def rgb_picture(rgb: NDArray[np.float32], levels: Levels | None = None) -> Picture:
    """SRGB values 0..1, shape (3, rows, columns), as an 8-bit image, stretched between levels if given."""
    lit: NDArray[np.bool_] = np.asarray(np.isfinite(rgb).all(axis=0))
    rgb = rgb if levels is None else between(rgb, levels)
    picture = np.rint(np.clip(np.nan_to_num(rgb), 0, 1) * 255).astype(np.uint8)
    return _blank(np.moveaxis(picture, 0, -1), lit)


def band_picture(reflectance: NDArray[np.float32], levels: Levels = (0.0, 1.0)) -> Picture:
    """Reflectance as grey levels, straight (no gamma); no answer is marked dark blue, not grey."""
    greys = np.rint(np.nan_to_num(between(reflectance, levels)) * 255).astype(np.uint8)
    picture = np.repeat(greys[..., None], 3, axis=-1)
    picture[~np.isfinite(reflectance)] = (0, 0, 96)
    return picture


def depth_picture(depth_mm: NDArray[np.float32], levels_mm: Levels | None = None) -> Picture:
    """Depth in colours (near is red, far is blue), with a bar that says how many mm they mean.

    Without levels the bar spans all but the nearest and farthest half percent, so that single outliers
    leave colours to the rest; what is beyond has the colour of the bar's end.
    """
    lit = np.isfinite(depth_mm)
    near, far = np.percentile(depth_mm[lit], (0.5, 99.5)) if lit.any() else (0.0, 0.0)
    near, far = levels_mm or (near, far)
    shares = (far - np.where(lit, depth_mm, far)) / max(far - near, 1e-9)
    picture = _blank(_turbo(shares), lit)
    margin = np.full((picture.shape[0], _MARGIN_PX, 3), 255, np.uint8)
    margin[:, 8:24] = _turbo(np.linspace(1, 0, picture.shape[0]))[:, None]
    for share in np.linspace(0, 1, max(2, min(6, picture.shape[0] // 40))):
        row = share * (picture.shape[0] - 1)
        _write(
            margin,
            f"{near + share * (far - near):.1f} mm",
            28,
            int(np.clip(row + 4, 10, picture.shape[0] - 3)),
        )
    return np.hstack([picture, margin])


def flags_picture(flags: NDArray[Any]) -> Picture:
    """The gravest flag of every pixel as a colour, white where all is well, and a legend."""
    classes = gravest_flag(flags)
    colours = np.array([(255, 255, 255), *(tuple(bytes.fromhex(FLAG_COLOURS[flag][1:])) for flag in Flag)])
    picture: Picture = colours.astype(np.uint8)[classes]
    counts = np.bincount(classes.ravel(), minlength=len(colours))
    present = [(flag, place) for place, flag in enumerate(Flag, 1) if counts[place]]
    if not present:
        return picture
    legend = np.full((18 * len(present) + 4, max(picture.shape[1], 240), 3), 255, np.uint8)
    for line, (flag, place) in enumerate(present):
        top = 18 * line + 4
        legend[top : top + 12, 4:16] = colours[place]
        _write(legend, f"{FLAG_NAMES[flag]}  {100 * counts[place] / flags.size:.1f} %", 22, top + 11)
    padding = legend.shape[1] - picture.shape[1]
    return np.vstack([np.pad(picture, ((0, 0), (0, padding), (0, 0)), constant_values=255), legend])


def _turbo(shares: NDArray[Any]) -> Picture:
    import cv2

    levels = np.rint(np.clip(shares, 0, 1) * 255).astype(np.uint8)
    coloured = cv2.applyColorMap(levels.reshape(-1, 1), cv2.COLORMAP_TURBO)
    return np.ascontiguousarray(np.asarray(coloured, np.uint8).reshape(*levels.shape, 3)[..., ::-1])


def _blank(picture: Picture, lit: NDArray[np.bool_]) -> Picture:
    picture[~lit] = GREY
    return picture


def _write(picture: Picture, text: str, x: int, y: int) -> None:
    import cv2

    cv2.putText(picture, text, (x, y), cv2.FONT_HERSHEY_SIMPLEX, 0.38, (0, 0, 0), 1, cv2.LINE_AA)
