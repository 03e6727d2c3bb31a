"""One self-contained page about a calibrated rig: what was found, how well, and what it replaced."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any

import numpy as np
from pydantic import ValidationError

from dsl_core.evaluation.cost import StageCost
from dsl_core.evaluation.report.curves import HEIGHT, WIDTH, Chart, wavelength_chart
from dsl_core.evaluation.report.pages import render_page
from dsl_core.evaluation.report.pictures import ReportPicture, value_picture
from dsl_core.model.calibration.accepted import AcceptedCalibration
from dsl_core.model.calibration.geometry import GeometryCalibration
from dsl_core.model.conditions import CaptureConditions
from dsl_core.model.figure import Figure, failures
from dsl_core.model.geometry import Lens
from dsl_core.model.rig import Rig
from dsl_core.model.spectral import SpectralCurve

#: Channels and LEDs, and orders, in colours that the common kinds of colour blindness tell apart (P. Tol).
_RGB = (("red", "#cc3311"), ("green", "#228833"), ("blue", "#4477aa"))
_ORDERS = {-2: "#aa3377", -1: "#4477aa", 1: "#ee7733", 2: "#228833"}


@dataclass(frozen=True)
class _Section:
    """One calibration on the page."""

    title: str
    facts: dict[str, str]
    figures: tuple[Figure, ...]
    geometry: GeometryCalibration | None
    is_good: bool


def render_calibration_report(
    rig: Rig,
    accepted: Sequence[AcceptedCalibration],
    history: Sequence[AcceptedCalibration] = (),
    costs: Sequence[StageCost] = (),
) -> str:
    """The page, without references to other files: the calibrations in order, and those they replaced.

    Raises `StoreError` when its template is missing.
    """
    sections = [_section(each) for each in accepted]
    return render_page(
        "calibration.html.j2",
        rig=rig,
        sections=sections,
        missed=[f"{s.title}: {figure}" for s in sections for figure in failures(s.figures)],
        charts=_charts(rig),
        maps=rig_maps(rig),
        film=_film(rig),
        geometry=_geometry(rig),
        conditions=_conditions(rig.conditions),
        history=[(old.title, old.accepted, old.figures) for old in history],
        costs=costs,
        total_seconds=sum(cost.seconds for cost in costs),
        width=WIDTH,
        height=HEIGHT,
    )


def _section(accepted: AcceptedCalibration) -> _Section:
    facts = {"Accepted": short_time(accepted.accepted)}
    if accepted.captured:
        facts["Captured"] = short_time(accepted.captured)
    facts |= {name.replace("_", " ").capitalize(): value for name, value in accepted.settings.items()}
    figures = accepted.figures
    return _Section(accepted.title, facts, figures, _poses(accepted.record), not failures(figures))


def short_time(time: str) -> str:
    """A time of ISO 8601 to the minute.

    >>> short_time("2026-03-01T10:20:30.5+00:00")
    '2026-03-01 10:20 UTC'
    """
    return datetime.fromisoformat(time).astimezone(UTC).strftime("%Y-%m-%d %H:%M UTC") if time else "never"


def _poses(record: dict[str, Any]) -> GeometryCalibration | None:
    """The geometric calibration in a record, at its top or one level below; None where there is none."""
    for candidate in (record, *(value for value in record.values() if isinstance(value, dict))):
        if "poses" not in candidate:
            continue
        try:
            return GeometryCalibration.model_validate(candidate)
        except ValidationError:
            continue
    return None


def _charts(rig: Rig) -> list[Chart]:
    def coloured(curves: Sequence[SpectralCurve]) -> list[tuple[str, str, SpectralCurve]]:
        return [(name, colour, curve) for (name, colour), curve in zip(_RGB, curves, strict=True)]

    orders = [
        (f"order {order:+d}", _ORDERS.get(order, "#777777"), curve)
        for order, curve in sorted(rig.efficiency.items())
        if order
    ]
    charts = [
        wavelength_chart("Camera response", "relative, of each channel", coloured(rig.response)),
        wavelength_chart("LED emission", "relative, of each LED at full drive", coloured(rig.emission)),
    ]
    if orders:
        charts.append(wavelength_chart("Efficiency of the film", "relative to the zero order", orders))
    if rig.chain_rel_std is not None:
        line = [("relative", "var(--accent)", rig.chain_rel_std)]
        charts.append(
            wavelength_chart("Uncertainty left in reflectance", "standard deviation, relative", line)
        )
    return charts


def _geometry(rig: Rig) -> list[tuple[str, str, str]]:
    """Name, camera and projector."""
    lenses = (rig.camera, rig.projector)

    def row(name: str, form: str, values: Sequence[float]) -> tuple[str, str, str]:
        return name, form.format(values[0]), form.format(values[1])

    return [
        ("Image size", _size(rig.camera), _size(rig.projector)),
        row("Focal length across", "{:.2f} px", [lens.fx_px for lens in lenses]),
        row("Focal length down", "{:.2f} px", [lens.fy_px for lens in lenses]),
        row("Centre across", "{:.2f} px", [lens.cx_px for lens in lenses]),
        row("Centre down", "{:.2f} px", [lens.cy_px for lens in lenses]),
        ("Distortion k1 k2 p1 p2 k3", _distortion(rig.camera), _distortion(rig.projector)),
    ]


def _size(lens: Lens) -> str:
    return f"{lens.width_px} × {lens.height_px} px"


def _distortion(lens: Lens) -> str:
    return " ".join(f"{k:.4f}" for k in lens.distortion)


def _film(rig: Rig) -> dict[str, str]:
    film, response = rig.film, rig.projector_response
    tone = "" if response.tone is None else " (a measured curve instead of a power law)"
    x, y, z = rig.pose.projector_centre_mm
    return {
        "Projector's centre": f"{x:.2f}, {y:.2f}, {z:.2f} mm from the camera's",
        "Film": f"{film.lines_per_mm:.2f} lines/mm, {film.distance_mm:.2f} mm in front of the projector",
        "Tilt, roll": f"{film.tilt_x_deg:.3f}°, {film.tilt_y_deg:.3f}°, {film.roll_deg:.3f}°",
        "Bend": f"{film.bend_per_mm:.5f} per mm",
        "Column uncertainty": f"{rig.column_std_px:.3f} px",
        "Gamma, black": f"{response.gamma:.3f}{tone}, {response.black_fraction:.5f}",
        "White scale": f"{rig.white_scale:.4g} ± {100 * rig.white_scale_rel_std:.2g} %"
        + (f", its white itself ± {100 * rig.reference_rel_std:.2g} %" if rig.reference_rel_std else ""),
        "Depth range": "{:g} to {:g} mm".format(*rig.depth_range_mm),
        "Sensor": (
            f"black {rig.sensor.black_level_dn:.1f} DN, {rig.sensor.electrons_per_dn:.2f} e-/DN,"
            f" read noise {rig.sensor.read_noise_dn:.2f} DN"
        ),
    }


def _conditions(known: CaptureConditions | None) -> dict[str, str]:
    if known is None:
        return {}
    camera, projector = known.camera, known.projector
    region = (
        "the whole sensor" if camera.region_px is None else "x {} y {}, {} × {} px".format(*camera.region_px)
    )
    return {
        "Camera": f"{camera.model}, serial number {camera.serial}",
        "Image": f"{camera.size_px[0]} × {camera.size_px[1]} px of {region}, binning {camera.binning}",
        "Read out": f"gain {camera.gain_db:g} dB, {camera.bayer}, {camera.bit_depth} bits",
        "Projector": f"{projector.model}, serial number {projector.serial}",
        "Projected": (
            f"{projector.size_px[0]} × {projector.size_px[1]} px, {projector.frame_period_ms:.3f} ms/frame"
            + (f", mode {projector.mode}" if projector.mode else "")
        ),
    }


#: Where the residual is drawn: the middle of the bands, and at most this many pixels across.
MIDDLE_NM, MAP_PX = 545.0, 240


def rig_maps(rig: Rig) -> list[ReportPicture]:
    """The flat field, and the residual of each order at 545 nm and middle depth; none for a rig without."""
    pictures = []
    if rig.flat_field is not None:
        from dsl_core.optics.sensor import relative_gain

        caption = "relative gain of the camera over its image"
        pictures.append(value_picture(relative_gain(rig), "Flat field", caption, ""))
    return pictures + _residuals(rig)


def _residuals(rig: Rig) -> list[ReportPicture]:
    import torch

    from dsl_core.optics.column_residual import residual_columns

    residual = rig.residual
    if residual is None:
        return []
    step = -(-rig.camera.width_px // MAP_PX)
    rows, columns = np.mgrid[0 : rig.camera.height_px : step, 0 : rig.camera.width_px : step].astype(float)
    middle_mm = 2 / sum(1 / z for z in residual.depth_range_mm)
    camera_px = torch.as_tensor(columns.ravel()), torch.as_tensor(rows.ravel())
    depth_mm = torch.full((rows.size,), middle_mm, dtype=torch.float64)
    wavelength_nm = torch.tensor([MIDDLE_NM], dtype=torch.float64)
    pictures = []
    for order in residual.orders:
        found = residual_columns(residual, camera_px, depth_mm, order, wavelength_nm)
        if found is not None:
            pictures.append(
                value_picture(
                    found.reshape(rows.shape).numpy(),
                    f"Residual of order {order:+d}",
                    f"columns beyond the grating equation at {MIDDLE_NM:g} nm and {middle_mm:.0f} mm",
                    "px",
                    "RdBu_r",
                    symmetric=True,
                )
            )
    return pictures
