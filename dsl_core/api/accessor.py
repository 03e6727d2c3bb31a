"""The accessor ``.dsl`` of results: spectra with deviations, reasons, the verdict, exports and plots."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import xarray as xr

from dsl_core.api import FilePath, path_of
from dsl_core.api.places import Place, as_array, extent_of, place_mask, require_picture, require_result
from dsl_core.errors import CalibrationError, DecodeError
from dsl_core.evaluation.marks import explain_pixel, largest_difference, region_spectrum
from dsl_core.io.export import export_by_ending
from dsl_core.io.result.result_file import save_result
from dsl_core.model.attributes import (
    BAND_WIDTH,
    FIRST_BAND,
    SCALE_ATTRIBUTE,
    stated_band_width_nm,
    weights_of_wider,
)
from dsl_core.model.fit import Fit
from dsl_core.model.result import DEPTH_INVALID, VARIABLES, Flag
from dsl_core.model.result_order import BANDS, wavelengths_of, with_axes, with_bits
from dsl_core.model.spectral import SpectralCurve, at_bands, means_of
from dsl_core.solve.normal import BAND_95

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: The attribute of a result that says when its scan was captured, and what a region keeps of its scan.
CAPTURED = "captured"
OF_SCAN = (CAPTURED, SCALE_ATTRIBUTE, BAND_WIDTH, FIRST_BAND)
#: What is said of the spectrum of a pixel, band by band.
_OF_BANDS = ("reflectance", "reflectance_std", "data_share")


@xr.register_dataset_accessor("dsl")  # type: ignore[no-untyped-call]
class ResultAccessor:
    """What a result says: spectra with deviations, reasons, the verdict on the fit, exports, plots."""

    def __init__(self, result: xr.Dataset) -> None:
        self._result = result

    def spectrum(self, x: int, y: int) -> xr.Dataset:
        """Reflectance and its standard deviation over ``wavelength_nm`` at a pixel of the picture.

        ``x`` and ``y`` are pixel coordinates, from the upper left corner of the whole picture. The attribute
        ``reasons`` lists why the pixel is limited; empty is good. What the result does not state is NaN.
        Raises `DecodeError` for a pixel that is not in the result, and for a result without spectra.
        """
        self._require_spectra()
        found = _with_unstated(self._pixel(x, y))[list(_OF_BANDS)].load()
        return found.assign_attrs(name=f"x {x}, y {y}", reasons=self.reasons(x, y))

    def region(self, where: Place) -> xr.Dataset:
        """Mean reflectance of a region and its standard deviation over ``wavelength_nm``.

        ``where`` is a mask (rows, columns), or x, y, width and height in pixels of the whole picture.
        ``reflectance_std`` is the scatter of the region's pixels, ``pixel_std`` the mean deviation stated
        for a single pixel, ``mean_std`` what their mean is uncertain by: errors of neighbours hang
        together, so it is more than ``pixel_std`` over the root of their number. Where only one has a
        spectrum, all are what is stated for it. The attribute ``used`` counts the pixels with a spectrum.
        What the result does not state is NaN. Raises `DecodeError` for a region without any.
        """
        self._require_spectra()
        require_picture(self._result)
        if as_array(where).shape == (2,) and as_array(where).dtype.kind in "iuf":
            raise DecodeError(f"A region has several pixels; for the one at {where!r} call spectrum(x, y).")
        result = with_axes(self._result)
        mask = place_mask(result, where)
        stated = _with_unstated(result)
        values, std, share = (stated[name].values for name in _OF_BANDS)
        found = region_spectrum(values, std, share, mask)
        if found.used == 0:
            raise DecodeError(f"None of the {found.pixels} pixels of the region has a spectrum.")
        over = "wavelength_nm"
        return xr.Dataset(
            {
                name: (over, values, {"units": "1", "long_name": words})
                for name, values, words in (
                    ("reflectance", found.mean, "mean reflectance on the Spectralon scale"),
                    ("reflectance_std", found.spread, "standard deviation of the pixels"),
                    ("pixel_std", found.pixel_std, "mean standard deviation stated for a pixel"),
                    ("mean_std", found.mean_std, "standard deviation of the mean"),
                    ("data_share", found.data_share, "mean share decided by data"),
                )
            },
            coords={over: result[over]},
            attrs={
                "name": f"mean of {found.used} pixels",
                "used": found.used,
                "reasons": [],
                **{name: result.attrs[name] for name in OF_SCAN if name in result.attrs},
            },
        )

    def difference(self, other: xr.Dataset) -> xr.Dataset:
        """This spectrum less another one, both of `spectrum` or `region`, over the bands that both have.

        Where one has wider bands, the other is averaged over them, with deviations as if bands err together.
        ``reflectance_std`` is the deviation of the difference, errors of both taken as independent; spectra
        of two scans may differ by the scale of each as well, as far as results state it. The
        attributes ``most_nm`` and ``most_sigmas`` say in which band it is the most deviations from zero, and
        by how many; ``differ`` whether these are more than chance makes of so many bands. Raises
        `DecodeError` for what is not one spectrum, and where no band has both.
        """
        one, two = (_one_spectrum(each).sortby(BANDS) for each in (self._result, other))
        a, b = xr.align(_averaged_like(one, two), _averaged_like(two, one), join="inner")
        is_one_scan = a.attrs.get(CAPTURED) == b.attrs.get(CAPTURED)
        a_std, b_std = (
            np.hypot(
                each["reflectance_std"].values,
                each["reflectance"].values * (0.0 if is_one_scan else each.attrs.get(SCALE_ATTRIBUTE, 0.0)),
            )
            for each in (a, b)
        )
        most = largest_difference(
            a["wavelength_nm"].values,
            a["reflectance"].values,
            b["reflectance"].values,
            a_std,
            b_std,
        )
        if most is None:
            raise DecodeError("The spectra have no band in which both are known with their deviations.")
        attrs = {
            "name": f"{a.attrs.get('name', '')} less {b.attrs.get('name', '')}",
            "most_nm": most.nm,
            "most_sigmas": abs(most.value) / most.std,
            "differ": most.is_shown,
        }
        values = {
            "reflectance": a["reflectance"] - b["reflectance"],
            "reflectance_std": a["reflectance_std"].copy(data=np.hypot(a_std, b_std)),
        }
        return xr.Dataset(values, attrs=attrs)

    def at_bands(self, spectrum: xr.DataArray) -> xr.DataArray:
        """A spectrum of `read_spectra` at the bands of this result, as a mean over each, as its own are.

        ``spectrum`` has wavelengths (nm) as its only axis, in any order; what is NaN plays no part. Raises
        `CalibrationError` where it has another form, or does not cover the bands.
        """
        self._require_spectra()
        nm = np.sort(self._result[BANDS].values.astype(np.float64))
        curve = _curve(spectrum)
        found = at_bands(curve, nm, stated_band_width_nm(self._result.attrs, nm))
        return xr.DataArray(found.values, {BANDS: nm}, (BANDS,), name=spectrum.name)

    def reasons(self, x: int, y: int) -> list[str]:
        """Why a pixel is limited, a sentence each; empty where nothing is.

        Raises `DecodeError` for a pixel that is not in the result.
        """
        pixel = self._pixel(x, y)
        share = pixel["data_share"].values if "data_share" in pixel else None
        nm = self._result["wavelength_nm"].values if "wavelength_nm" in self._result else np.empty(0)
        depth_std_mm = float(pixel["depth_std_mm"]) if "depth_std_mm" in pixel else None
        return explain_pixel(int(_flags(pixel)), nm, share, depth_std_mm)

    @property
    def good(self) -> xr.DataArray:
        """Pixels without any flag, (y, x); of a result without flags, those that it has values of."""
        return _flags(self._result) == 0

    @property
    def verdict(self) -> str:
        """How well the model fits the scan, what does not, and what to do about it."""
        fit = Fit.read(self._result.attrs)
        return "" if fit is None else fit.words

    def points(self) -> xr.Dataset:
        """The pixels that have depth: all variables over the dimension ``point``, with ``x`` and ``y``.

        Raises `DecodeError` for what is not a result, such as one spectrum.
        """
        require_picture(self._result)
        result = with_axes(self._result)
        known = (_flags(result) & int(DEPTH_INVALID)) == 0
        stacked = result.stack(point=("y", "x"))
        return stacked.isel(point=np.flatnonzero(known.values.ravel())).reset_index("point")

    def export(
        self,
        path: FilePath,
        format: str | None = None,
        *,
        pixels: Sequence[tuple[int, int]] = (),
        overwrite: bool = False,
    ) -> list[Path]:
        """As `dsl_core.export`."""
        return export_by_ending(self._result, path_of(path), format, pixels=pixels, overwrite=overwrite)

    def save(self, path: FilePath, *, overwrite: bool = False) -> Path:
        """As `dsl_core.save_result`."""
        return save_result(self._result, path_of(path), overwrite=overwrite)

    def plot(self, x: int | None = None, y: int | None = None, ax: Axes | None = None) -> Axes:
        """Draw a spectrum with its 95 % band, and return the axes.

        Of a pixel of a result, or, without ``x`` and ``y``, of what `spectrum`, `region` or `difference`
        returned; of a region the band is that of its pixels. Raises `DecodeError` where no pixel is said.
        """
        import matplotlib.pyplot as plt
        from matplotlib.axes import Axes

        self._require_spectra()
        shown = self._result if x is None or y is None else self.spectrum(x, y)
        if shown["reflectance"].ndim != 1:
            raise DecodeError("Say which pixel to draw: plot(x=..., y=...), or spectrum(x, y).dsl.plot().")
        axes = plt.gca() if ax is None else ax
        if not isinstance(axes, Axes):
            raise DecodeError(
                "ax is one of the axes of matplotlib, such as plt.subplots()[1]; what was given is of type"
                f" {type(axes).__name__}."
            )
        nm, mean = shown["wavelength_nm"].values, shown["reflectance"].values
        half = BAND_95 * shown["reflectance_std"].values
        (line,) = axes.plot(nm, mean, label=str(shown.attrs.get("name", "")))
        axes.fill_between(nm, mean - half, mean + half, alpha=0.25, linewidth=0, color=line.get_color())
        axes.set(xlabel="wavelength (nm)", ylabel="reflectance")
        return axes

    def _pixel(self, x: int, y: int) -> xr.Dataset:
        require_picture(self._result)
        if not all(as_array(each).ndim == 0 and as_array(each).dtype.kind in "iuf" for each in (x, y)):
            raise DecodeError(
                f"A pixel is two numbers, x and y; given {x!r} and {y!r}. For several, use region."
            )
        try:
            # Flags of all pixels: averages may be whole numbers at this one. Nothing reads its reach.
            return with_bits(self._result.drop_vars("reach", errors="ignore")).sel(x=x, y=y)
        except KeyError as error:
            raise DecodeError(
                f"Pixel x {x}, y {y} is not in the result ({extent_of(self._result)})."
            ) from error

    def _require_spectra(self) -> None:
        if "reflectance" not in self._result:
            raise DecodeError("The result contains depth only. Reconstruct the scan with spectra=True.")
        dims = self._result["reflectance"].dims
        if BANDS not in dims and set(dims) - {"x", "y"}:
            raise DecodeError(
                f"The result has no axis {BANDS}; its reflectance is over {', '.join(map(str, dims))}."
                " Rename the one of the bands."
            )
        if BANDS not in dims:
            raise DecodeError(
                "The result has one band, without the axis of bands. Choose a list of one, such as"
                f" result.isel({BANDS}=[3]), which keeps the axis."
            )
        wavelengths_of(self._result)


def _with_unstated(result: xr.Dataset) -> xr.Dataset:
    """A result with all variables of `_OF_BANDS`; those that it does not hold are NaN."""
    unknown = {
        name: xr.full_like(result["reflectance"], np.nan).assign_attrs(units=unit, long_name=words)
        for name in _OF_BANDS
        if name not in result
        for _, unit, words in (VARIABLES[name],)
    }
    return result.assign(unknown) if unknown else result


def _flags(result: xr.Dataset) -> xr.DataArray:
    """Flags of the pixels; a result without any shows no more than which pixels it has values of."""
    if "flags" in result:
        return with_bits(result[["flags"]])["flags"]
    seen = next((name for name in ("depth_mm", "reflectance") if name in result), None)
    if seen is None:
        raise DecodeError("The result has no flags, no depth and no spectra, which would say what is good.")
    known = result[seen].notnull()
    known = known.all(BANDS) if BANDS in known.dims else known
    return known.copy(data=np.where(known.values, 0, int(Flag.NON_FINITE)))


def _curve(spectrum: xr.DataArray) -> SpectralCurve:
    """A spectrum over wavelengths in any order, as far as it is known; raises `CalibrationError`."""
    if not isinstance(spectrum, xr.DataArray) or spectrum.dims != (BANDS,) or BANDS not in spectrum.coords:
        raise CalibrationError(
            f"This is not one spectrum over {BANDS}. Give one of read_spectra(file), such as"
            " read_spectra(file)[name], or the reflectance of a spectrum or region of a result."
        )
    known = spectrum.astype(np.float64).dropna(BANDS).sortby(BANDS)
    nm = known[BANDS].values.astype(np.float64)
    if not nm.size or not np.isfinite(nm).all() or not (np.diff(nm) > 0).all():
        raise CalibrationError(f"The {BANDS} of the spectrum are not known, or not all different.")
    return SpectralCurve.of(nm, known.values)


def _one_spectrum(given: xr.Dataset) -> xr.Dataset:
    """Reflectance and its deviation (bands,) of one spectrum; raises `DecodeError` for anything else."""
    require_result(given)
    if not {"reflectance", "reflectance_std"} <= set(given) or given["reflectance"].dims != (BANDS,):
        raise DecodeError("A difference is that of two spectra, as spectrum(x, y) and region(...) return.")
    return given[["reflectance", "reflectance_std"]].reset_coords(drop=True)


def _averaged_like(spectrum: xr.Dataset, other: xr.Dataset) -> xr.Dataset:
    """One spectrum averaged over the bands of another where these are wider; else the very same."""
    weights = weights_of_wider(spectrum[BANDS].values, spectrum.attrs, other[BANDS].values, other.attrs)
    if weights is None:
        return spectrum
    known = np.isfinite(weights).all(1)
    means = {name: (BANDS, means_of(each.values, weights[known])) for name, each in spectrum.items()}
    return xr.Dataset(means, {BANDS: other[BANDS].values[known]}, spectrum.attrs)
