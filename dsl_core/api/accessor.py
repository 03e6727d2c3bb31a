"""The accessor ``.dsl`` of results: spectra with deviations, reasons, the verdict, exports and plots."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from dsl_core.api import FilePath
from dsl_core.errors import DecodeError
from dsl_core.evaluation.marks import explain_pixel, region_spectrum
from dsl_core.io.export import export_by_ending
from dsl_core.io.result.result_file import save_result
from dsl_core.model.fit import Fit
from dsl_core.model.result import DEPTH_INVALID

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: Standard deviations on either side of a value that hold 95 % of a normal distribution.
BAND_95 = 1.96


@xr.register_dataset_accessor("dsl")  # type: ignore[no-untyped-call]
class ResultAccessor:
    """What a result says: spectra with deviations, reasons, the verdict on the fit, exports, plots."""

    def __init__(self, result: xr.Dataset) -> None:
        self._result = result

    def spectrum(self, x: int, y: int) -> xr.Dataset:
        """Reflectance and its standard deviation over ``wavelength_nm`` at a pixel of the picture.

        ``x`` and ``y`` are pixel coordinates, from the upper left corner of the whole picture. The attribute
        ``reasons`` lists why the pixel is limited; empty is good. Raises `DecodeError` for a pixel that is
        not in the result, and for a result without spectra.
        """
        self._require_spectra()
        found = self._pixel(x, y)[["reflectance", "reflectance_std", "data_share"]].load()
        return found.assign_attrs(name=f"x {x}, y {y}", reasons=self.reasons(x, y))

    def region(self, where: NDArray[np.bool_] | Sequence[int]) -> xr.Dataset:
        """Mean reflectance of a region and its standard deviation over ``wavelength_nm``.

        ``where`` is a mask (rows, columns) or x, y, width, height in pixel coordinates. ``reflectance_std``
        is the scatter of the region's pixels (that of their mean is smaller by the root of their number, as
        far as errors are independent), ``pixel_std`` the mean deviation stated for a single pixel. The
        attribute ``used`` counts the pixels with a spectrum. Raises `DecodeError` for a region without any.
        """
        self._require_spectra()
        mask = self._mask(where)
        values, std, share = (
            self._result[name].values for name in ("reflectance", "reflectance_std", "data_share")
        )
        found = region_spectrum(values, std, share, mask)
        if found.used == 0:
            raise DecodeError(f"None of the {found.pixels} pixels of the region has a spectrum.")
        over = "wavelength_nm"
        return xr.Dataset(
            {
                "reflectance": (over, found.mean),
                "reflectance_std": (over, found.deviation),
                "pixel_std": (over, found.pixel_std),
                "data_share": (over, found.data_share),
            },
            coords={over: self._result[over]},
            attrs={"name": f"mean of {found.used} pixels", "used": found.used, "reasons": []},
        )

    def reasons(self, x: int, y: int) -> list[str]:
        """Why a pixel is limited, a sentence each; empty where nothing is.

        Raises `DecodeError` for a pixel that is not in the result.
        """
        pixel = self._pixel(x, y)
        share = pixel["data_share"].values if "data_share" in pixel else None
        nm = self._result["wavelength_nm"].values if "wavelength_nm" in self._result else np.empty(0)
        return explain_pixel(int(pixel["flags"]), nm, share, float(pixel["depth_std_mm"]))

    @property
    def good(self) -> xr.DataArray:
        """Pixels without any flag, (y, x)."""
        return self._result["flags"] == 0

    @property
    def verdict(self) -> str:
        """How well the model fits the scan, what does not, and what to do about it."""
        fit = Fit.read(self._result.attrs)
        return "" if fit is None else fit.words

    def points(self) -> xr.Dataset:
        """The pixels that have depth: all variables over the dimension ``point``, with ``x`` and ``y``."""
        known = (self._result["flags"] & int(DEPTH_INVALID)) == 0
        stacked = self._result.stack(point=("y", "x"))
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
        return export_by_ending(self._result, Path(path), format, pixels=pixels, overwrite=overwrite)

    def save(self, path: FilePath, *, overwrite: bool = False) -> Path:
        """As `dsl_core.save_result`."""
        return save_result(self._result, Path(path), overwrite=overwrite)

    def plot(self, x: int | None = None, y: int | None = None, ax: Axes | None = None) -> Axes:
        """Draw a spectrum with its 95 % band, and return the axes.

        Of a pixel of a result, or, without ``x`` and ``y``, of what `spectrum` or `region` returned.
        """
        import matplotlib.pyplot as plt

        shown = self._result if x is None or y is None else self.spectrum(x, y)
        if shown["reflectance"].ndim != 1:
            raise DecodeError("Say which pixel to draw: plot(x=..., y=...), or spectrum(x, y).dsl.plot().")
        axes = plt.gca() if ax is None else ax
        nm, mean = shown["wavelength_nm"].values, shown["reflectance"].values
        half = BAND_95 * shown["reflectance_std"].values
        (line,) = axes.plot(nm, mean, label=str(shown.attrs.get("name", "")))
        axes.fill_between(nm, mean - half, mean + half, alpha=0.25, linewidth=0, color=line.get_color())
        axes.set(xlabel="wavelength (nm)", ylabel="reflectance")
        return axes

    def _pixel(self, x: int, y: int) -> xr.Dataset:
        if "x" not in self._result.dims:
            raise DecodeError("This is one spectrum, not a result: it has no pixels to choose from.")
        try:
            return self._result.sel(x=x, y=y)
        except KeyError as error:
            raise DecodeError(f"Pixel x {x}, y {y} is not in the result ({self._extent()}).") from error

    def _mask(self, where: Any) -> NDArray[np.bool_]:
        rows, columns = self._result["y"].values, self._result["x"].values
        given = np.asarray(where)
        if given.dtype == bool:
            if given.shape != (len(rows), len(columns)):
                raise DecodeError(
                    f"The mask has shape {given.shape}; the result has {len(rows)} rows and {len(columns)}"
                    " columns."
                )
            return given
        if given.shape != (4,):
            raise DecodeError(f"A region is a mask, or x, y, width and height; given {where!r}.")
        x, y, width, height = (int(value) for value in given)
        inside_y, inside_x = (rows >= y) & (rows < y + height), (columns >= x) & (columns < x + width)
        if not (inside_y.any() and inside_x.any()):
            raise DecodeError(
                f"The region {tuple(int(v) for v in given)} (x, y, width, height) is outside the result"
                f" ({self._extent()})."
            )
        return np.asarray(inside_y[:, None] & inside_x)

    def _require_spectra(self) -> None:
        if "reflectance" not in self._result:
            raise DecodeError("The result contains depth only. Reconstruct the scan with spectra=True.")

    def _extent(self) -> str:
        rows, columns = self._result["y"].values, self._result["x"].values
        return f"x {columns[0]} to {columns[-1]}, y {rows[0]} to {rows[-1]}"
