"""What is said of a reconstruction that is to be done again: its trouble, its cost, its command. No Qt."""

from __future__ import annotations

import shlex
from pathlib import Path

from dsl_app.results.again.state import OWN, AgainOrder, AgainSource
from dsl_core.errors import DslError, PlanError
from dsl_core.model.spectral import WavelengthGrid

RESULT_SUFFIX = ".zarr"
#: Bytes of a result for each pixel: depth, points, normals, colour and their deviations; and for each band.
PIXEL_BYTES, BAND_BYTES = 68, 6


def target_of(order: AgainOrder, source: AgainSource) -> Path:
    """Where the new result is stored: beside its scan, so that its frames are found."""
    return source.session.with_name(order.name.removesuffix(RESULT_SUFFIX) + RESULT_SUFFIX)


def fresh_name(session: Path) -> str:
    """A name for a result of a scan that is not taken."""
    name, count = session.stem, 1
    while session.with_name(name + RESULT_SUFFIX).exists():
        count += 1
        name = f"{session.stem}-{count}"
    return name


def bands_of(order: AgainOrder) -> WavelengthGrid:
    """The bands; raises `PlanError` where they make no grid."""
    from pydantic import ValidationError

    if order.stop_nm <= order.start_nm:
        raise PlanError(
            f"The last band, {order.stop_nm:g} nm, must lie above the first, {order.start_nm:g} nm."
            " Exchange them."
        )
    try:
        return WavelengthGrid(start_nm=order.start_nm, stop_nm=order.stop_nm, step_nm=order.step_nm)
    except ValidationError as error:
        what = error.errors()[0]["msg"].removeprefix("Value error, ")
        raise PlanError(f"The bands do not fit: {what}.") from error


def trouble_of(order: AgainOrder, source: AgainSource) -> str:
    """Why an order cannot be carried out, and what to do; empty when it can."""
    if order.spectra:
        try:
            bands_of(order)
        except DslError as error:
            return str(error)
    if order.calibration == OWN and not source.calibration:
        return "The scan holds no calibration. Choose one of the library, or a file."
    name = order.name.strip()
    if not name or "/" in name or "\\" in name:
        return "Give the result a name without slashes."
    target = target_of(order, source)
    if target.exists() and not order.replace:
        return f"{target.name} exists already. Choose another name, or allow it to be replaced."
    return ""


def cost_of(order: AgainOrder, source: AgainSource) -> str:
    """How many bands and bytes the result has, and what the one before took."""
    pixels = source.size_px[0] * source.size_px[1]
    count = 0
    if order.spectra:
        try:
            count = bands_of(order).count
        except DslError:
            return ""
    words = [f"{count} bands" if count else "depth only"]
    megabytes = pixels * (PIXEL_BYTES + BAND_BYTES * count) / 1e6
    words.append(f"at most {megabytes:.0f} MB" if megabytes >= 1 else "below 1 MB")
    if source.took_s >= 1 and source.before is not None:
        words.append(f"{source.before.name} took {source.took_s:.0f} s")
    return " · ".join(words)


def command_of(order: AgainOrder, source: AgainSource) -> str:
    """The command that does the same; only what differs from its defaults."""
    usual = AgainOrder("")
    words = ["dsl-scan reconstruct", _quoted(source.session), "-o", _quoted(target_of(order, source))]
    if order.spectra:
        words.append(f"--bands {order.start_nm:g}:{order.stop_nm:g}:{order.step_nm:g}")
        words += [
            f"--{name} {getattr(order, name)}"
            for name in ("model", "solver")
            if getattr(order, name) != getattr(usual, name)
        ]
    else:
        words.append("--depth-only")
    if not order.refine:
        words.append("--no-refine")
    if order.calibration != OWN:
        words.append(f"--calibration {_quoted(order.calibration)}")
        if order.override:
            words.append("--override-calibration")
    if order.device != usual.device:
        words.append(f"--device {order.device}")
    if order.replace:
        words.append("--force")
    return " ".join(words)


def _quoted(text: object) -> str:
    return shlex.quote(str(text))
