"""Reconstructing a scan again: the scan, the request, whether it can be done, and its command line."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from dsl_app.shared.evented import Event, Value
from dsl_app.shared.known_files import first_free
from dsl_app.shared.paths import there
from dsl_core.errors import DslError, PlanError
from dsl_core.io.neighbours import RESULT_SUFFIX, SCAN_SUFFIX, stem_of
from dsl_core.model.base import what_is_wrong
from dsl_core.model.spectral import WavelengthGrid
from dsl_core.words import quoted

#: Bytes of a result per pixel: depth, points, normals, colour and their deviations; and per pixel and band.
PIXEL_BYTES, BAND_BYTES = 68, 6
#: Key of the calibration that is stored in the scan.
OWN = ""


@dataclass(frozen=True)
class ReconstructionSource:
    """What the choices depend on.

    ``calibration`` is the name of the scan's own (empty: it has none), ``library`` those of this computer.
    ``before`` is the result to compare with, if any, which took ``took_s`` (0: not known). Without
    ``has_spectra`` the scan has no frames of spectral patterns.
    """

    session: Path
    size_px: tuple[int, int]
    calibration: str = ""
    library: tuple[str, ...] = ()
    has_cuda: bool = False
    before: Path | None = None
    took_s: float = 0.0
    has_spectra: bool = True


@dataclass(frozen=True)
class ReconstructionRequest:
    """What to compute; ``calibration`` is `OWN`, a name in the library or the path of a file."""

    name: str
    start_nm: float = 430.0
    stop_nm: float = 660.0
    step_nm: float = 5.0
    spectra: bool = True
    model: str = "auto"
    solver: str = "best"
    refine: bool = True
    calibration: str = OWN
    override: bool = False
    device: str = "cpu"
    replace: bool = False


@dataclass(frozen=True)
class Reconstructed:
    """The new result, and the one to compare it with, if any."""

    result: Path
    before: Path | None


class ReconstructionState:
    """Values that `ReconstructionController` sets and the dialog follows.

    ``trouble`` says why the request cannot be run (empty: it can), ``cost`` what it makes and how long the
    previous one took. ``ready`` fires when a scan has been read, ``done`` with each new result.
    """

    def __init__(self) -> None:
        self.source: Value[ReconstructionSource | None] = Value(None)
        self.request = Value(ReconstructionRequest(""))
        self.trouble = Value("")
        self.cost = Value("")
        self.ready: Event[ReconstructionSource] = Event()
        self.done: Event[Reconstructed] = Event()


def target_of(request: ReconstructionRequest, source: ReconstructionSource) -> Path:
    """Where to save the new result: next to its scan, so that its frames are found."""
    return source.session.with_name(request.name.removesuffix(RESULT_SUFFIX) + RESULT_SUFFIX)


def fresh_name(session: Path) -> str:
    """An unused name for a result of a scan."""
    return first_free(session.parent, stem_of(session, SCAN_SUFFIX), RESULT_SUFFIX).stem


def bands_of(request: ReconstructionRequest) -> WavelengthGrid:
    """The bands; raises `PlanError` if they do not form a grid."""
    from pydantic import ValidationError

    if request.stop_nm <= request.start_nm:
        raise PlanError(
            f"The last band, {request.stop_nm:g} nm, must be above the first, {request.start_nm:g} nm."
            " Swap them."
        )
    try:
        return WavelengthGrid(start_nm=request.start_nm, stop_nm=request.stop_nm, step_nm=request.step_nm)
    except ValidationError as error:
        what = what_is_wrong(error.errors()[0])
        raise PlanError(f"The bands do not fit: {what}.") from error


def trouble_of(request: ReconstructionRequest, source: ReconstructionSource) -> str:
    """Why a request cannot be run, and what to do; empty when it can."""
    if request.spectra and not source.has_spectra:
        return "The scan has no frames of spectral patterns. Leave out the spectra."
    if request.spectra:
        try:
            bands_of(request)
        except DslError as error:
            return str(error)
    if request.calibration == OWN and not source.calibration:
        return "The scan has no calibration. Choose one from the library, or a file."
    name = request.name.strip()
    if not name or "/" in name or "\\" in name:
        return "Enter a name without slashes."
    target = target_of(request, source)
    if there(target) and not request.replace:
        return f"{target.name} already exists. Choose another name, or allow replacing it."
    return ""


def cost_of(request: ReconstructionRequest, source: ReconstructionSource) -> str:
    """Bands and size of the result, and how long the previous one took."""
    pixels = source.size_px[0] * source.size_px[1]
    count = 0
    if request.spectra:
        try:
            count = bands_of(request).count
        except DslError:
            return ""
    parts = [f"{count} bands" if count else "depth only"]
    megabytes = pixels * (PIXEL_BYTES + BAND_BYTES * count) / 1e6
    parts.append(f"at most {megabytes:.0f} MB" if megabytes >= 1 else "less than 1 MB")
    if source.took_s >= 1 and source.before is not None:
        parts.append(f"{source.before.name} took {source.took_s:.0f} s")
    return " · ".join(parts)


def command_of(request: ReconstructionRequest, source: ReconstructionSource) -> str:
    """The command that does the same; only options that differ from the defaults."""
    usual = ReconstructionRequest("")
    parts = ["dsl-scan reconstruct", quoted(source.session), "-o", quoted(target_of(request, source))]
    if request.spectra:
        parts.append(f"--bands {request.start_nm:g}:{request.stop_nm:g}:{request.step_nm:g}")
        parts += [
            f"--{name} {getattr(request, name)}"
            for name in ("model", "solver")
            if getattr(request, name) != getattr(usual, name)
        ]
    else:
        parts.append("--depth-only")
    if not request.refine:
        parts.append("--no-refine")
    if request.calibration != OWN:
        parts.append(f"--calibration {quoted(request.calibration)}")
        if request.override:
            parts.append("--override-calibration")
    if request.device != usual.device:
        parts.append(f"--device {request.device}")
    if request.replace:
        parts.append("--force")
    return " ".join(parts)
