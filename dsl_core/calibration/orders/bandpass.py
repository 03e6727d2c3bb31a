"""From what each filter shows to efficiencies, response, white scale, blur and halo."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dsl_core.calibration.common.white import white_target
from dsl_core.calibration.light.chain_equations import LineScan, colours_of
from dsl_core.calibration.light.zero_order import ZeroOrderFit, fit_zero_order
from dsl_core.calibration.orders.efficiency import (
    EfficiencyFit,
    RatioSample,
    fit_efficiency,
    require_both_orders,
    second_order_curve,
    second_order_share,
    shares_of_sides,
)
from dsl_core.calibration.orders.filter_check import (
    NOISE_SIGMAS,
    PlacedFilter,
    effective_nm,
    found_wavelengths,
    verdict,
)
from dsl_core.calibration.orders.filter_shift import angle_of_view, cell_terms
from dsl_core.calibration.orders.order_light import FilterLight
from dsl_core.calibration.orders.order_place import PlanePixels, cell_means, of_colours
from dsl_core.calibration.orders.response import BandSample, fit_response, shift_of_all
from dsl_core.calibration.orders.steady_light import LightJump
from dsl_core.errors import CalibrationError
from dsl_core.model.calibration.bandpass import BandpassCalibration, FilterSample, OrderSample
from dsl_core.model.conditions import mosaic_colours
from dsl_core.model.rig import Rig
from dsl_core.model.spectral import SpectralCurve
from dsl_core.optics.filters import (
    FINE_NM,
    NO_SHIFT,
    FilterAngle,
    passed,
    passed_width_nm,
    relative_shift,
    shift_terms,
    through_filter,
)
from dsl_core.optics.spectra import ORDERS, SECOND_ORDERS
from dsl_core.optics.unlit import unlit_px
from dsl_core.progress import Progress
from dsl_core.solve.thinned import thinned

Floats = NDArray[np.float64]

#: Pixels that blur and halo are fitted to.
PROFILE_PIXELS = 3000
#: Zero orders moved farther than this (px) mean that target or rig moved between captures.
MOVED_PX = 0.15
#: Rows left free at the frame's edges, px.
ROW_MARGIN_PX = 8.0


@dataclass(frozen=True)
class SeenFilter:
    """One filter: nominal centre, transmission, whether that was measured, and what was seen."""

    filter_nm: float
    transmission: SpectralCurve
    measured_curve: bool
    light: FilterLight


def profile_scan(scan: LineScan) -> LineScan:
    """The pixels that blur and halo are fitted to, spread over all."""
    return scan.at(thinned(np.arange(len(scan.pixels)), PROFILE_PIXELS))


def plane_profile(rig: Rig, scan: LineScan, progress: Progress | None = None) -> ZeroOrderFit:
    """Blur and halo from the scan without filter; raises `CalibrationError`."""
    some = profile_scan(scan)
    reach_px = unlit_px(rig, some.lines.width_px)[1]
    return fit_zero_order(
        some.lines, some.column_px, some.radiance, some.std, rig.projector_response, reach_px, progress
    )


def plane_pixels(rig: Rig, scan: LineScan, filter_nm: float) -> PlanePixels:
    """The pixels of the scan without filter, as the captures through a filter need them."""
    import torch

    from dsl_core.optics.correspondence import GratingModel

    rows, columns = np.divmod(scan.pixels, rig.camera.width_px)
    place = np.stack([(rows + 0.5) / rig.camera.height_px, (columns + 0.5) / rig.camera.width_px])
    # The film's data sheet is good enough for which rows light comes from.
    model = GratingModel(rig)
    whole: dict[int, NDArray[np.bool_]] = {}
    ends = np.array([filter_nm - 15.0, filter_nm + 15.0])
    for order in (*ORDERS, *SECOND_ORDERS):
        at = model.trace(
            torch.as_tensor(scan.pixels), torch.as_tensor(scan.depth_mm), order, ends
        ).rows.numpy()
        last = rig.projector.height_px - 1 - ROW_MARGIN_PX
        whole[order] = np.asarray(((at > ROW_MARGIN_PX) & (at < last)).all(0))
    return PlanePixels(scan.column_px, scan.shading, colours_of(rig, scan), place, whole)


def fit_bandpass(
    rig: Rig,
    scan: LineScan,
    profile: ZeroOrderFit,
    filters: Sequence[SeenFilter],
    reflectance: float | None = None,
) -> BandpassCalibration:
    """All that filters say of a rig whose response and emission are known about.

    ``scan`` is the target without filter; ``reflectance`` (share) is that of the target, of the rig's white
    if not given. Raises `CalibrationError` that names a filter which is not the one requested, and where too
    few filters show an order.
    """
    if not filters:
        raise CalibrationError("No filter was captured. Capture at least two of different wavelengths.")
    angle, shift = _angle(rig, scan, filters)
    lights = [passed(rig, each.transmission, shift) for each in filters]
    # Orders are placed in the middle of the image.
    middle = relative_shift(shift_terms(rig, _middle(rig)), np.array(angle.values))
    placed = [_placed(rig, each, passed(rig, each.transmission, middle)) for each in filters]
    found = found_wavelengths(rig, placed)
    warnings = _check(rig, filters, placed, found)
    samples = {
        order: _ratios(
            order,
            filters,
            [passed(rig, each.transmission, shift, each.light.orders[order].cells) for each in filters],
        )
        for order in ORDERS
    }
    require_both_orders(samples)
    fits = {order: fit_efficiency(order, samples[order]) for order in ORDERS}
    seconds = shares_of_sides(
        {order: second_order_share(_second(order, filters, lights, fits[order])) for order in ORDERS}
    )
    white, white_std = _white(rig, profile_scan(scan), profile)
    target = white_target(rig, reflectance).at(FINE_NM)
    bands = [
        BandSample(each.light.zero, each.light.zero_std, light * target, each.measured_curve)
        for each, light in zip(filters, lights, strict=True)
    ]
    refined = fit_response(rig, bands, white, white_std, target)
    through = [through_filter(each.transmission, shift) for each in filters]
    off_nm, off_std_nm = shift_of_all(rig, bands, through, white, white_std, target)
    efficiency = {order: fit.curve for order, fit in fits.items()}
    for order, side in seconds.items():
        efficiency[2 * order] = second_order_curve(fits[order].curve, *side)
    shares, stds = np.transpose(list(seconds.values()) or [(0.0, 1.0)])
    return BandpassCalibration(
        filters=tuple(
            _sample(each, place, where) for each, place, where in zip(filters, placed, found, strict=True)
        ),
        efficiency=efficiency,
        second_order_share=float(shares.mean()),
        second_order_share_std=float(np.sqrt(np.mean(stds**2) + shares.var())),
        misfit={order: fit.misfit for order, fit in fits.items()},
        response=refined.response,
        white_scale=refined.white_scale,
        white_scale_rel_std=refined.white_scale_rel_std,
        blur_px=profile.response.blur_px,
        blur_std_px=profile.std[0],
        halo_peak_per_px=profile.response.halo_peak_per_px,
        halo_peak_std_per_px=profile.std[1],
        halo_decay_px=profile.response.halo_decay_px,
        halo_decay_std_px=profile.std[2],
        spread=profile.response.spread,
        field=profile.response.field,
        filters_off_nm=off_nm,
        filters_off_std_nm=off_std_nm,
        filter_index=angle.index,
        warnings=tuple(warnings),
    )


def _angle(rig: Rig, scan: LineScan, filters: Sequence[SeenFilter]) -> tuple[FilterAngle, Floats]:
    """How filters shift with the angle of view, none where that is in doubt; and the shift of each cell."""
    pixels = plane_pixels(rig, scan, 550.0)
    terms = cell_terms(rig, pixels, scan.pixels)
    white = cell_means(pixels, scan.amplitude / scan.shading)
    found = angle_of_view(
        rig, [each.transmission for each in filters], [each.light for each in filters], white, terms
    )
    angle = found if found.is_of_filters else NO_SHIFT
    return angle, relative_shift(terms, np.array(angle.values))


def _middle(rig: Rig) -> NDArray[np.int64]:
    """Flat index of the pixel in the middle of the image, (1,)."""
    return np.array([rig.camera.height_px // 2 * rig.camera.width_px + rig.camera.width_px // 2])


def _placed(rig: Rig, each: SeenFilter, light: Floats) -> PlacedFilter:
    offsets = {
        order: (each.light.orders[order].offset_px, each.light.orders[order].offset_std_px)
        for order in ORDERS
        if np.isfinite(each.light.orders[order].offset_px)
    }
    width_nm = passed_width_nm(rig, each.transmission)
    return PlacedFilter(each.filter_nm, effective_nm(light), each.measured_curve, offsets, width_nm)


def _check(
    rig: Rig,
    filters: Sequence[SeenFilter],
    placed: Sequence[PlacedFilter],
    found: Sequence[tuple[float, float] | None],
) -> list[str]:
    """Sentences on doubtful filters; raises `CalibrationError` with all that cannot be used."""
    wrong: list[str] = []
    doubts: list[str] = []
    for each, place, where in zip(filters, placed, found, strict=True):
        first = [
            each.light.orders[order] for order in ORDERS if np.isfinite(each.light.orders[order].offset_px)
        ]
        width = max((light.width_px for light in first), default=0.0)
        # Noise between the orders looks like light that is spread out.
        share = min((light.share + NOISE_SIGMAS * light.share_std for light in first), default=1.0)
        unusable, sentence = verdict(rig, place, where, width, share)
        shift = each.light.shift_px[0]
        if abs(shift) > MOVED_PX:
            unusable, sentence = True, _moved(each.filter_nm, shift)
        elif each.light.jump is not None and not unusable:
            unusable, sentence = True, _jumped(each.filter_nm, each.light.jump)
        if sentence:
            (wrong if unusable else doubts).append(sentence)
    if wrong:
        raise CalibrationError("; ".join(wrong)[:1].upper() + "; ".join(wrong)[1:] + ".")
    return doubts


def _moved(filter_nm: float, shift_px: float) -> str:
    return (
        f"the filter of {filter_nm:g} nm: the zero order is {shift_px:+.2f} columns from where it was"
        " without a filter. The target, camera or projector moved; capture all steps again"
    )


def _jumped(filter_nm: float, jump: LightJump) -> str:
    return (
        f"the filter of {filter_nm:g} nm: light changed by {jump.share:+.0%} at once while lines were about"
        f" at column {jump.column_px:.0f}. Switch automatic exposure and gain of the camera and eco mode of"
        " the projector off, check that the filter stays in its place, and capture the step again"
    )


def _ratios(order: int, filters: Sequence[SeenFilter], lights: Sequence[Floats]) -> list[RatioSample]:
    return [
        RatioSample(float(seen.ratio[c]), float(seen.std[c]), light[c])
        for each, light in zip(filters, lights, strict=True)
        for seen in [each.light.orders[order]]
        for c in range(3)
        if np.isfinite(seen.std[c])
    ]


def _second(
    order: int, filters: Sequence[SeenFilter], lights: Sequence[Floats], fit: EfficiencyFit
) -> list[tuple[float, float, float]]:
    """Ratios of one side's second order with deviation, and what its first order has at the same light."""
    return [
        (
            float(seen.ratio[c]),
            float(seen.std[c]),
            float(light[c] @ fit.curve.at(FINE_NM) / light[c].sum()),
        )
        for each, light in zip(filters, lights, strict=True)
        for seen in [each.light.orders[2 * order]]
        for c in range(3)
        if np.isfinite(seen.std[c]) and light[c].sum() > 0
    ]


def _white(rig: Rig, scan: LineScan, profile: ZeroOrderFit) -> tuple[Floats, Floats]:
    """Zero order of white at unit shading in each colour (DN per ms), and its deviation by cells.

    The amplitudes are those of the fit that knows blur and halo. NaN, infinite for colours that the camera's
    mosaic does not have.
    """
    pixels = plane_pixels(rig, scan, 550.0)
    relative = profile.amplitude / scan.shading
    value, std = of_colours(pixels, relative, profile.good, np.median)
    if np.isnan(value[list(mosaic_colours(rig.sensor.bayer))]).any():
        raise CalibrationError(
            "The scan without a filter shows too little of the target. Fill the picture with a flat white"
            " target and capture the step again."
        )
    return value, std


def _sample(each: SeenFilter, place: PlacedFilter, found: tuple[float, float] | None) -> FilterSample:
    orders = []
    for order, light in sorted(each.light.orders.items()):
        use = np.isfinite(light.std)
        if use.any() and np.isfinite(light.offset_px):
            weight = light.std[use] ** -2
            orders.append(
                OrderSample(
                    order=order,
                    ratio=float((weight * light.ratio[use]).sum() / weight.sum()),
                    ratio_std=float(weight.sum() ** -0.5),
                    offset_px=light.offset_px,
                    offset_std_px=light.offset_std_px,
                )
            )
    red, green, blue = (float(value) for value in np.nan_to_num(each.light.zero))
    return FilterSample(
        filter_nm=each.filter_nm,
        effective_nm=place.effective_nm,
        found_nm=None if found is None else found[0],
        found_std_nm=None if found is None else found[1],
        curve_measured=each.measured_curve,
        zero_dn_per_ms=(red, green, blue),
        orders=tuple(orders),
    )
