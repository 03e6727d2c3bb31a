"""What each view of a result paints: values, levels, colours and the label of its colour bar."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsl_app.results.state import (
    BANDS_KEY,
    COLOUR_KEY,
    Limits,
    QualityMap,
    ResultsState,
    ResultView,
    depth_key,
    within,
)
from dsl_app.shared.widgets.pictures import DEPTH, GREY, SHARE, colour_map
from dsl_core.analysis.classify import ClassMap
from dsl_core.analysis.mark_colours import Ground
from dsl_core.io.result.result_arrays import ResultArrays
from dsl_core.model.result import FLAG_COLOURS, FLAG_NAMES, gravest_flag
from dsl_core.optics.levels import Bands, Levels, between, rgba_of_colours, spread_of, three_bands, top_of

#: Which light measured a band: orders +1, -1, both, or only the zero order (with the prior).
ORDER_TEXTS = {1: "order +1", 2: "order −1", 3: "both first orders", 4: "zero order only"}
ORDER_COLOURS = {1: "#4477aa", 2: "#ee6677", 3: "#228833", 4: "#ccbb44"}
NOTHING = "#8a8f98"
#: That of pixels which a picture leaves out, in its legend.
NO_COLOUR = "rgba(0,0,0,0)"
#: The variable of a result that each map of the quality shows; those of bands.
_SHOWN_OF = {
    QualityMap.FLAGS: "flags",
    QualityMap.ORDERS: "reach",
    QualityMap.SHARE: "data_share",
    QualityMap.SPREAD: "reflectance_std",
    QualityMap.DEPTH_SPREAD: "depth_std_mm",
}
_OF_BANDS = (QualityMap.ORDERS, QualityMap.SHARE, QualityMap.SPREAD)


@dataclass(frozen=True)
class Contrast:
    """The values of a picture before its levels, and both the levels of its own and those on it.

    ``values`` are one map (rows, columns), or three for red, green and blue. Pictures with the same ``key``
    have the same levels; ``is_bounded`` where nothing can be beyond the levels of its own.
    """

    key: str
    label: str
    values: tuple[NDArray[Any], ...]
    automatic: Levels
    levels: Levels
    is_chosen: bool
    unit: str = ""
    is_bounded: bool = False


@dataclass(frozen=True)
class Layer:
    """An image with levels and a lookup table; ``label`` names the colour bar, ``keys`` are a legend.

    Without ``contrast`` the picture has no levels that could be set.
    """

    image: NDArray[Any]
    levels: tuple[float, float] | None = None
    colours: str = ""
    table: NDArray[np.uint8] | None = None
    label: str = ""
    keys: tuple[tuple[str, str, float], ...] = ()
    contrast: Contrast | None = None


class Layers:
    """Makes the layers of one result; what is slow to compute is kept."""

    def __init__(self, result: ResultArrays) -> None:
        self.result = result
        self._known: dict[str, Any] = {}
        self._chosen: Mapping[str, Levels] = {}

    def layer(self, state: ResultsState) -> Layer | None:
        """The layer of the current view; None where the result has nothing to show."""
        in_space = state.view.value is ResultView.CLOUD
        view = state.cloud_by.value if in_space else state.view.value
        self._chosen = state.levels.value
        layer = self._painted(view, state)
        if layer is None or layer.keys:
            return layer
        return replace(layer, keys=self._missing(layer, view, in_space, state.depth_limits.value))

    def _missing(
        self, layer: Layer, view: ResultView, in_space: bool, limits: Limits | None
    ) -> tuple[tuple[str, str, float], ...]:
        """The legend of pixels without a value, which pictures leave out, and of points, which are grey."""
        known, is_grey = _known(layer), in_space and view is not ResultView.DEPTH
        if is_grey:
            # What has no depth is no point.
            known = known[within(self.result["depth_mm"], limits)]
        share = 1 - float(known.mean()) if known.size else 0.0
        if share == 0:
            return ()
        no_depth = "no depth" if limits is None else "no depth between the limits"
        what = {ResultView.DEPTH: no_depth, ResultView.QUALITY: "no value"}.get(view, "no spectrum")
        return ((NOTHING if is_grey else NO_COLOUR, what, share),)

    def _painted(self, view: ResultView, state: ResultsState) -> Layer | None:
        if view is ResultView.BAND and self.result.has_spectra:
            return self._of_band("reflectance", state.band.value, GREY, "Reflectance")
        if view is ResultView.QUALITY:
            return self._quality(state.quality.value, state.band.value)
        picture, bands = state.picture.value, state.bands.value
        if picture is not None and picture.shape[:2] != self.result.shape:
            # It is that of another result, which is being opened.
            picture = None
        if view is ResultView.DEPTH or picture is None:
            return self._depth(state.depth_limits.value)
        if bands is not None and self.result.has_spectra:
            return self._three_bands(bands)
        return self._true_colours(picture)

    def _once(self, name: str, make: Any) -> Any:
        if name not in self._known:
            self._known[name] = make()
        return self._known[name]

    def _of_band(self, name: str, band: int, colours: str, label: str) -> Layer:
        """A band, with one scale for all bands."""
        return self._scaled(name, self.result[name][band], (0.0, self._top(name)), colours, label)

    def _top(self, name: str) -> float:
        top: float = self._once(name, lambda: top_of(self.result[name]))
        return top

    def _scaled(
        self, key: str, values: NDArray[Any], own: Levels, colours: str, label: str, unit: str = ""
    ) -> Layer:
        """Values on a scale of colours, between levels of their own or those that a person set."""
        levels = self._chosen.get(key, own)
        contrast = Contrast(key, label, (values,), own, levels, key in self._chosen, unit)
        return Layer(values, levels, colours, label=label, contrast=contrast)

    def _map(self, name: str, colours: str, label: str, unit: str = "") -> Layer:
        values = self.result[name]
        return self._scaled(name, values, self._once(name, lambda: spread_of(values)), colours, label, unit)

    def _depth(self, limits: Limits | None) -> Layer:
        if limits is None:
            return self._map("depth_mm", DEPTH, "Depth (mm)", "mm")
        depth = self.result["depth_mm"]
        shown = np.where(within(depth, limits), depth, np.float32(np.nan))
        return self._scaled(depth_key(limits), shown, limits, DEPTH, "Depth (mm)", "mm")

    def _three_bands(self, bands: Bands) -> Layer:
        cube, own = self.result["reflectance"], (0.0, self._top("reflectance"))
        levels = self._chosen.get(BANDS_KEY, own)
        picture = rgba_of_colours(three_bands(cube, bands, levels))
        values = tuple(cube[band] for band in bands)
        is_chosen = BANDS_KEY in self._chosen
        return Layer(picture, contrast=Contrast(BANDS_KEY, "Reflectance", values, own, levels, is_chosen))

    def _true_colours(self, picture: NDArray[np.uint8]) -> Layer:
        own = (0.0, 1.0)
        levels = self._chosen.get(COLOUR_KEY, own)
        values = tuple(picture[..., channel] / np.float32(255) for channel in range(3))
        is_chosen = COLOUR_KEY in self._chosen
        contrast = Contrast(COLOUR_KEY, "sRGB value", values, own, levels, is_chosen, is_bounded=True)
        if not is_chosen:
            return Layer(picture, contrast=contrast)
        table = (between(np.arange(256) / 255, levels) * 255 + 0.5).astype(np.uint8)
        return Layer(np.dstack([table[picture[..., :3]], picture[..., 3:]]), contrast=contrast)

    def _quality(self, what: QualityMap, band: int) -> Layer | None:
        if self.lacks(what):
            return None
        if what is QualityMap.DEPTH_SPREAD:
            return self._map("depth_std_mm", DEPTH, "Deviation (mm)", "mm")
        if what is QualityMap.FLAGS or not self.result.has_spectra:
            layer: Layer = self._once("flags", self._flags)
            return layer
        if what is QualityMap.ORDERS:
            return self._orders(band)
        if what is QualityMap.SHARE:
            return self._share(band)
        return self._of_band("reflectance_std", band, SHARE, "Deviation")

    def lacks(self, what: QualityMap) -> str:
        """Why there is nothing to show of the quality; empty where there is."""
        name = _SHOWN_OF[what] if self.result.has_spectra or what not in _OF_BANDS else "flags"
        return f"This result has no {what.value}." if name in self.result.missing else ""

    def _share(self, band: int) -> Layer:
        return self._scaled("data_share", self.result["data_share"][band], (0.0, 1.0), SHARE, "Data share")

    def _flags(self) -> Layer:
        classes = gravest_flag(self.result["flags"])
        colours = ["", *FLAG_COLOURS.values()]
        names = ["no flags", *FLAG_NAMES.values()]
        return _classes(classes, names, [NOTHING, *colours[1:]])

    def _orders(self, band: int) -> Layer:
        reach = self.result["reach"][band]
        names = ["no spectrum", *(ORDER_TEXTS.get(i, "") for i in range(1, 5))]
        colours = [NOTHING, *(ORDER_COLOURS.get(i, NOTHING) for i in range(1, 5))]
        return _classes(np.minimum(reach, 4).astype(np.uint8), names, colours)


#: Opacity of pixels with nothing to show, of 255.
FAINT = 40


def _classes(classes: NDArray[np.uint8], names: list[str], colours: list[str]) -> Layer:
    table = np.zeros((256, 4), np.uint8)
    for i, colour in enumerate(colours):
        table[i] = (*bytes.fromhex(colour[1:]), 255 if i else FAINT)
    counts = np.bincount(classes.ravel(), minlength=len(colours)) / classes.size
    faint = ",".join(str(level) for level in bytes.fromhex(colours[0][1:]))
    shown = [f"rgba({faint},{FAINT / 255:.2f})", *colours[1:]]
    keys = tuple(
        (colour, name, float(share))
        for colour, name, share in zip(shown, names, counts, strict=False)
        if share > 0
    )
    return Layer(classes, (0, 255), table=table, keys=keys)


def _known(layer: Layer) -> NDArray[np.bool_]:
    """Where a picture has a colour."""
    known: NDArray[np.bool_] = np.isfinite(layer.image) if layer.levels else layer.image[..., 3] > 0
    return known


def rgb_of(layer: Layer) -> NDArray[np.uint8]:
    """The colours (rows, columns, 3) that a layer has on the screen, for the cloud; grey without a value."""
    if layer.levels is None:
        colours = layer.image[..., :3].copy()
    else:
        low, high = layer.levels
        table = layer.table
        if table is None:
            table = colour_map(layer.colours).getLookupTable(nPts=256)
        index = np.nan_to_num((layer.image - low) * (255 / (high - low))).clip(0, 255).astype(np.uint8)
        colours = np.ascontiguousarray(np.asarray(table, np.uint8)[index][..., :3])
    # Black would be taken for a dark surface.
    colours[~_known(layer)] = tuple(bytes.fromhex(NOTHING[1:]))
    return colours


def materials_table(shown: ClassMap, ground: Ground) -> NDArray[np.uint8]:
    """Colours (256, 4) of the values of a map; what is not judged shows the picture below."""
    table = np.zeros((256, 4), np.uint8)
    colours = shown.palette(ground)
    for value, colour in enumerate(colours):
        table[value] = (*bytes.fromhex(colour[1:]), 215)
    table[0, 3] = 0
    # What has no name is fainter than what has.
    table[len(colours) - 2 : len(colours), 3] = 150
    return table


def tinted_by(
    colours: NDArray[np.uint8], values: NDArray[np.uint8], table: NDArray[np.uint8]
) -> NDArray[np.uint8]:
    """Colours (points, 3) under those (256, 4) of a map whose ``values`` (points,) say which each is."""
    table = table[values]
    share = table[:, 3:] / np.float32(255)
    return np.ascontiguousarray((colours * (1 - share) + table[:, :3] * share + 0.5).astype(np.uint8))
