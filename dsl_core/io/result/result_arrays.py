"""A result in memory as plain arrays, for display: band first, float32, read one band after the other."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from dsl_core.errors import StoreError
from dsl_core.io.result.result_file import checked_attributes, damage_of, of_one_writing, own_attributes
from dsl_core.model.attributes import BAND_WIDTH, FIRST_BAND, stated_band_width_nm, weights_of_wider
from dsl_core.model.result import VARIABLES
from dsl_core.model.result_order import (
    BANDS,
    as_bits,
    known_bands,
    places_px,
    require_wavelengths,
    rising_order,
)
from dsl_core.model.spectral import BandValues, SpectralCurve, at_bands, means_of
from dsl_core.progress import NoProgress, Progress

if TYPE_CHECKING:
    from dsl_core.io.result.stored_arrays import StoredArray

#: What is read of a variable between two looks at whether the person has cancelled.
AT_ONCE_BYTES = 16e6
#: What is averaged with the bands; deviations as if bands erred together.
_AVERAGED = ("reflectance", "reflectance_std", "data_share")


@dataclass(frozen=True)
class ResultArrays:
    """The arrays of a result by the names of `VARIABLES`; what the result does not hold is not there.

    ``missing`` names what `completed` put in its place as unknown. ``columns_px`` and ``rows_px`` are where
    the pixels are in the camera's picture; None where the result does not say. ``stamp`` says when the file
    was changed last, ns, and its size, bytes, before it was read; None where nobody asked.
    """

    path: Path
    wavelengths_nm: NDArray[np.float64]
    arrays: Mapping[str, NDArray[Any]]
    attributes: Mapping[str, Any] = field(default_factory=dict)
    missing: tuple[str, ...] = ()
    columns_px: NDArray[np.int64] | None = None
    rows_px: NDArray[np.int64] | None = None
    stamp: tuple[int, int] | None = None

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns of the image."""
        height, width = self.arrays["depth_mm"].shape
        return int(height), int(width)

    @property
    def has_spectra(self) -> bool:
        """Whether reflectance is there, and not only depth."""
        return "reflectance" in self.arrays

    def __getitem__(self, name: str) -> NDArray[Any]:
        """The array of a name; raises ``KeyError``."""
        return self.arrays[name]

    def known(self, name: str) -> NDArray[Any] | None:
        """The array of a name; None where the result does not hold it itself."""
        return None if name in self.missing else self.arrays.get(name)

    def at(self, name: str, pixel: tuple[int, int]) -> NDArray[Any]:
        """Everything that a variable holds for a pixel ``(x, y)``: one value, or one per band or axis."""
        return self.arrays[name][..., pixel[1], pixel[0]]

    @property
    def band_width_nm(self) -> float | None:
        """How wide the bands are; None where the result does not say."""
        return stated_band_width_nm(self.attributes, self.wavelengths_nm)

    def at_bands(self, curve: SpectralCurve) -> BandValues:
        """A spectrum at the bands; raises `CalibrationError` where it does not cover them."""
        return at_bands(curve, self.wavelengths_nm, self.band_width_nm)

    def of_bands(self, chosen: NDArray[np.bool_]) -> ResultArrays:
        """This result with some of its bands (bands,) only; the very same where these are all."""
        if chosen.all():
            return self
        arrays = {
            name: each[chosen] if VARIABLES[name][0][0] == BANDS else each
            for name, each in self.arrays.items()
        }
        return replace(self, wavelengths_nm=self.wavelengths_nm[chosen], arrays=arrays)

    def without_missing_bands(self) -> ResultArrays:
        """This result with the bands that a pixel has a reflectance in; the very same where these are all."""
        return self.of_bands(known_bands(self["reflectance"]))

    def averaged_like(self, other: ResultArrays) -> ResultArrays:
        """This result at the bands of another, averaged as far as these are wider; else the very same.

        Both have to say how wide their bands are, and of this one none may be left out in between.
        """
        theirs = other.wavelengths_nm, other.attributes
        weights = weights_of_wider(self.wavelengths_nm, self.attributes, *theirs)
        if weights is None or not (self.has_spectra and other.has_spectra):
            return self
        known = np.isfinite(weights).all(1)
        arrays = {name: each for name, each in self.arrays.items() if VARIABLES[name][0][0] != BANDS}
        arrays |= {
            name: means_of(self.arrays[name], weights[known]) for name in _AVERAGED if name in self.arrays
        }
        stated = {**self.attributes, **{name: other.attributes[name] for name in (BAND_WIDTH, FIRST_BAND)}}
        return replace(self, wavelengths_nm=other.wavelengths_nm[known], arrays=arrays, attributes=stated)

    @property
    def places_px(self) -> tuple[NDArray[np.int64] | None, NDArray[np.int64] | None]:
        """Columns and rows of the camera's picture that the result is of; None where it does not say."""
        return self.columns_px, self.rows_px

    @property
    def origin_px(self) -> tuple[int, int]:
        """Column and row of the camera's picture where the result begins."""
        x, y = (0 if at is None else int(at[0]) for at in self.places_px)
        return x, y

    def in_picture(self, pixel: tuple[int, int]) -> tuple[int, int]:
        """Where a pixel ``(x, y)`` of the arrays is in the camera's picture."""
        if not self.holds(pixel):
            return pixel[0] + self.origin_px[0], pixel[1] + self.origin_px[1]
        x, y = (
            at if places is None else int(places[at])
            for at, places in zip(pixel, self.places_px, strict=True)
        )
        return x, y

    @property
    def picture(self) -> tuple[Path, tuple[int, int]]:
        """Path and shape: the same for a result and for what becomes of it, which is seen in the same way."""
        return self.path, self.shape

    def holds(self, pixel: tuple[int, int]) -> bool:
        """Whether a pixel ``(x, y)`` is in the image."""
        height, width = self.shape
        return 0 <= pixel[0] < width and 0 <= pixel[1] < height


def _parts(shape: tuple[int, ...]) -> list[slice]:
    """Slices of the first axis, of as many bands as `AT_ONCE_BYTES` hold: each read has a cost of its own."""
    each = max(1, int(AT_ONCE_BYTES // max(1, 4 * math.prod(shape[1:]))))
    return [slice(first, first + each) for first in range(0, shape[0], each)]


@dataclass(frozen=True)
class _Ordered:
    """An array read with its axes as `VARIABLES` has them, each in its order of ``orders``, if it has one."""

    stored: StoredArray
    axes: tuple[str, ...]
    orders: Mapping[str, NDArray[np.intp]]

    @property
    def shape(self) -> tuple[int, ...]:
        return tuple(self.stored.shape[self.stored.dims.index(axis)] for axis in self.axes)

    def read(self, part: slice) -> NDArray[Any]:
        """The values of a part of the first axis; raises `StoreError`."""
        keys: dict[str, Any] = {axis: self.orders.get(axis, slice(None)) for axis in self.axes}
        first = self.axes[0]
        keys[first] = self.orders[first][part] if first in self.orders else part
        values = self.stored.values(tuple(keys[axis] for axis in self.stored.dims))
        return values.transpose([self.stored.dims.index(axis) for axis in self.axes])


def _require_one_size(found: Mapping[str, StoredArray], labels: Mapping[str, list[str]], path: Path) -> None:
    """Raise `StoreError` where two arrays, or the names along an axis, differ in how long that axis is."""
    sizes = {axis: len(names) for axis, names in labels.items()}
    for stored in found.values():
        for axis, size in zip(stored.dims, stored.shape, strict=True):
            if sizes.setdefault(axis, size) != size:
                raise damage_of(
                    path, ValueError(f"{stored.name} has {size} values along {axis}, not {sizes[axis]}")
                )


def _ordered(found: Mapping[str, StoredArray], path: Path) -> tuple[NDArray[np.float64], dict[str, _Ordered]]:
    """Wavelengths that rise, and the arrays of a result in the order of `canonical`."""
    for name, (axes, *_) in VARIABLES.items():
        if name in found and set(found[name].dims) != set(axes):
            has = ", ".join(found[name].dims)
            raise StoreError(
                f"{path} has {name} along the axes ({has}); ({', '.join(axes)}) are needed. Rename them where"
                " the result was made."
            )
    nm = np.asarray(_coordinate(found, BANDS), np.float64)
    if "reflectance" in found:
        require_wavelengths(nm, path)
    orders = {
        axis: order
        for axis in (BANDS, "x", "y")
        if (order := rising_order(_coordinate(found, axis))) is not None
    }
    there = {
        name: _Ordered(found[name], axes, orders) for name, (axes, *_) in VARIABLES.items() if name in found
    }
    return nm[orders.get(BANDS, slice(None))], there


def _coordinate(found: Mapping[str, StoredArray], axis: str) -> NDArray[Any]:
    """The values that a result gives an axis; nothing where it gives none."""
    said = axis in found and found[axis].dims == (axis,)
    return found[axis].values((slice(None),)) if said else np.empty(0)


def _places(found: Mapping[str, StoredArray]) -> Iterator[NDArray[np.int64] | None]:
    """Columns, then rows, of the camera's picture that a result says its pixels are in."""
    for axis in ("x", "y"):
        values = _coordinate(found, axis)
        order = rising_order(values)
        yield places_px(values if order is None else values[order])


def load_arrays(path: Path, progress: Progress | None = None) -> ResultArrays:
    """Read a whole result, with its bands rising; never holds much more than it.

    Raises `StoreError`, also for a result of another program whose arrays have other axes.
    """
    return of_one_writing(path, lambda: _loaded(path, progress or NoProgress()))


def _loaded(path: Path, progress: Progress) -> ResultArrays:
    from dsl_core.io.result.stored_arrays import stored_arrays

    attributes = checked_attributes(path)
    found = stored_arrays(path, partial(damage_of, path))
    _require_one_size(found, attributes.get("labels", {}), path)
    nm, there = _ordered(found, path)
    if not {"depth_mm", "reflectance"} & set(there):
        raise StoreError(
            f"{path} contains columns of the projector and no depth. Reconstruct its scan with a calibration,"
            " or export the columns with 'dsl-scan export'."
        )
    parts = {name: _parts(each.shape) for name, each in there.items()}
    total, done, arrays = sum(map(len, parts.values())), 0, {}
    for name, each in there.items():
        kind = each.stored.dtype
        arrays[name] = np.empty(each.shape, np.float32 if kind.kind == "f" else kind)
        for part in parts[name]:
            progress.report("read the result", done, total)
            arrays[name][part] = each.read(part)
            done += 1
        arrays[name] = as_bits(name, arrays[name])
    missing: tuple[str, ...] = ()
    if "depth_mm" not in arrays:
        # Where pixels are is unknown; their spectra can be looked at all the same.
        arrays["depth_mm"] = np.full(arrays["reflectance"].shape[1:], np.nan, np.float32)
        missing = ("depth_mm",)
    columns_px, rows_px = _places(found)
    return ResultArrays(path, nm, arrays, own_attributes(attributes), missing, columns_px, rows_px)
