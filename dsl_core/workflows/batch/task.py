"""One scan of a batch: reconstructed unless its result is there, and told as a few figures."""

from __future__ import annotations

import contextlib
import time
import traceback
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np

from dsl_core.errors import DslError, StoreError, TakenError
from dsl_core.evaluation.cost import StageTimer
from dsl_core.extras import names_missing_packages, require_package
from dsl_core.io.claims import Claim, ClaimedError
from dsl_core.io.objects.address import address_of
from dsl_core.io.objects.claim import ObjectClaim
from dsl_core.io.objects.copies import published_as
from dsl_core.io.objects.rooms import bring_frames, brought, published
from dsl_core.io.objects.store import ObjectFolder
from dsl_core.io.result.inventory import MADE_OF
from dsl_core.io.scan.folder import ScanReader
from dsl_core.model.attributes import DOUBTS, sentences_of
from dsl_core.model.fit import Fit
from dsl_core.model.options import Options
from dsl_core.model.rig import Rig
from dsl_core.workflows.captures import is_import
from dsl_core.workflows.scans import is_made_of, key_of_result, reconstruct_to, says_what_made_it

if TYPE_CHECKING:
    import xarray as xr

#: Is told how many rows of a scan's picture are finished, and of how many.
SeenRows = Callable[[int, int], object]
State = Literal["made", "kept", "claimed", "failed"]


@dataclass(frozen=True)
class ScanTask:
    """A scan, where its result belongs, and how to make it; may be done any number of times."""

    scan: Path
    target: Path
    calibration: Rig | None = None
    options: Options = field(default_factory=Options)
    override_calibration: bool = False
    overwrite: bool = False


@dataclass(frozen=True)
class Outcome:
    """What became of a scan: its result was made, kept as it was, is claimed by another process, or failed.

    ``sentence`` says why it failed or who works on it; ``remarks`` are of a result that is there. Costs are
    those of making it now: processor seconds, seconds, largest memory of the process in bytes.
    """

    scan: Path
    target: Path
    state: State
    sentence: str = ""
    remarks: tuple[str, ...] = ()
    verdict: str = ""
    pixels_with_depth: float = float("nan")
    cpu_s: float = 0.0
    seconds: float = 0.0
    peak_bytes: int = 0


def do_task(task: ScanTask, seen_rows: SeenRows | None = None) -> Outcome:
    """Reconstruct a scan, unless its result is complete and of the same frames, calibration and options.

    Never raises for what is wrong with the scan: that is the outcome. A run that was killed is continued.
    """
    failed = Outcome(task.scan, task.target, "failed")
    try:
        return names_missing_packages(_done)(task, seen_rows)
    except ClaimedError as error:
        return replace(failed, state="claimed", sentence=str(error))
    except (DslError, OSError) as error:
        return replace(failed, sentence=str(error))
    except MemoryError:
        return replace(failed, sentence="There is not enough memory. Use fewer jobs, or another machine.")
    except Exception as error:
        where = traceback.extract_tb(error.__traceback__)[-1]
        told = f"{type(error).__name__}: {error}, in {Path(where.filename).name}, line {where.lineno}"
        return replace(failed, sentence=f"This is a bug in dsl-scan ({told}). Report it.")


def _done(task: ScanTask, seen_rows: SeenRows | None) -> Outcome:
    if address_of(task.scan) is None and address_of(task.target) is None:
        return _done_here(task, seen_rows)
    target, remarks = address_of(task.target), tuple[str, ...]()
    with contextlib.ExitStack() as stack:
        folder = stack.enter_context(brought(task.scan, frames=False))
        reader = ScanReader(folder)
        key = key_of_result(reader, task.calibration, _options_for(reader, task.options))
        if target is None:
            if _is_there(task, key):
                return _with_figures(Outcome(task.scan, task.target, "kept"))
        else:
            require_package("obstore")

            def is_there() -> bool:
                return published_as(ObjectFolder(target), MADE_OF) == key

            remarks = _claimed(stack, partial(ObjectClaim, target), is_there)
            if is_there():
                return Outcome(task.scan, task.target, "kept")
        draft = stack.enter_context(published(task.target, overwrite=task.overwrite))
        bring_frames(task.scan, folder)
        # A draft is our own.
        inner = replace(task, scan=folder, target=draft, overwrite=task.overwrite or target is not None)
        outcome = _done_here(inner, seen_rows, is_room=target is not None)
    state = outcome.state if target is None else "made"
    return replace(
        outcome,
        scan=task.scan,
        target=task.target,
        state=state,
        remarks=(*remarks, *outcome.remarks),
    )


def _options_for(reader: ScanReader, options: Options) -> Options:
    """Pictures of other programs have no frames of spectral patterns."""
    return replace(options, spectra=False) if is_import(reader) else options


def _done_here(task: ScanTask, seen_rows: SeenRows | None, *, is_room: bool = False) -> Outcome:
    """The target may be a room, which is claimed by whoever lends it."""
    reader = ScanReader(task.scan)
    options = _options_for(reader, task.options)
    is_there = partial(_is_there, task, key_of_result(reader, task.calibration, options))
    with contextlib.ExitStack() as stack:
        remarks = () if is_room else _claimed(stack, partial(Claim, task.target), is_there)
        if is_there():
            outcome = Outcome(task.scan, task.target, "kept")
        else:
            outcome = replace(_made(task, options, seen_rows), remarks=remarks)
    return _with_figures(outcome)


def _claimed(
    stack: contextlib.ExitStack, claim: Callable[[], Claim | ObjectClaim], is_there: Callable[[], bool]
) -> tuple[str, ...]:
    """Claim a result while a stack lasts; remarks on whose claim was taken over.

    One that is there is not claimed where nothing can be written, nor needs to be.
    """
    try:
        held = claim()
    except ClaimedError:
        raise
    except StoreError:
        if is_there():
            return ()
        raise
    stack.enter_context(held)
    return (held.taken_over,) if held.taken_over else ()


def _is_there(task: ScanTask, key: str) -> bool:
    """Whether a result is there; raises `TakenError` where it is another one, which must not be replaced."""
    try:
        found = is_made_of(task.target, key)
    except StoreError as error:
        if task.overwrite:  # whatever is wrong with it
            return False
        raise TakenError(f"{error} With --force, it is replaced.") from error
    if not found and task.target.exists() and not task.overwrite:
        unlike = (
            "made of other frames or with another calibration, options or version"
            if says_what_made_it(task.target)
            else "and does not say what it was made of, as results saved from Python do not"
        )
        raise TakenError(
            f"{task.target} already exists, {unlike}. Choose another folder for results, or replace it"
            " with --force."
        )
    return found


def _made(task: ScanTask, options: Options, seen_rows: SeenRows | None) -> Outcome:
    timer, began_s, began_cpu_s = StageTimer(), time.perf_counter(), time.process_time()
    reconstruct_to(
        task.target,
        task.scan,
        task.calibration,
        options,
        timer=timer,
        override_calibration=task.override_calibration,
        overwrite=task.overwrite,
        seen_rows=seen_rows,
    )
    return Outcome(
        task.scan,
        task.target,
        "made",
        cpu_s=time.process_time() - began_cpu_s,
        seconds=time.perf_counter() - began_s,
        peak_bytes=max(stage.peak_bytes for stage in timer.stages),
    )


def _with_figures(outcome: Outcome) -> Outcome:
    """The outcome with what the result says of itself."""
    from dsl_core.io.result.result_file import load_result

    result = load_result(outcome.target)
    fit = Fit.read({str(name): value for name, value in result.attrs.items()})
    return replace(
        outcome,
        remarks=(*outcome.remarks, *doubts_of(result)),
        verdict="" if fit is None else fit.headline,
        pixels_with_depth=float(np.isfinite(result["depth_mm"].values).mean()),
    )


def doubts_of(result: xr.Dataset) -> list[str]:
    """Sentences about pictures that did not show their pattern, and what to do."""
    return [
        f"{doubt} The result may be wrong; scan again, or see 'dsl-scan info --verify'."
        for doubt in sentences_of(result.attrs, DOUBTS)
    ]
