"""The import of a folder of pictures, with depth where there is a calibration. No Qt."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from dsl_app.importing.captures.look import decoded_of, rig_of
from dsl_app.importing.captures.state import CaptureRequest, Imported, target_trouble
from dsl_core.errors import StoreError
from dsl_core.io.pictures.mapping import Mapping
from dsl_core.progress import Progress

if TYPE_CHECKING:
    from dsl_core.io.calibration_library import CalibrationLibrary


def carry_out(
    request: CaptureRequest, mapping: Mapping, library: CalibrationLibrary, progress: Progress
) -> Imported:
    """Make a scan, complete or not at all, and its depth if there is a calibration.

    Raises `DslError`, before any work where scan or result exist already.
    """
    from dsl_core.io.pictures.source import open_pictures
    from dsl_core.io.staging import staged
    from dsl_core.workflows.captures import decode_scan, import_pictures

    assert request.folder is not None
    if taken := target_trouble(request):
        raise StoreError(taken)
    source = open_pictures(request.folder, mapping)
    rig, _ = rig_of(request, mapping, source.plan.camera_size_px, library)
    with staged([request.target]) as (draft,):
        import_pictures(request.folder, draft, mapping, rig, progress)
    if rig is None:
        decoded = decoded_of(decode_scan(request.target, progress))
        share = f"{100 * decoded.share:.0f} %"
        verdict = f"{share} of the lit pixels have a column. There is no depth without a calibration."
        return Imported(request.target, None, verdict)
    return _with_depth(request.target, progress)


def _with_depth(scan: Path, progress: Progress) -> Imported:
    from dsl_core.io.result.result_file import load_result
    from dsl_core.pipeline import Options
    from dsl_core.workflows.scans import reconstruct_to

    target = scan.with_suffix(".zarr")
    reconstruct_to(target, scan, options=Options(spectra=False), progress=progress)
    share = float(load_result(target)["depth_mm"].notnull().mean())
    return Imported(scan, target, f"{100 * share:.0f} % of the pixels have a depth.")
