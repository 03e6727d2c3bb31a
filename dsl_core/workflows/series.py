"""Results as a series: a flat target at positions of a stage, or scans of one scene over their seconds."""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from dsl_core.errors import DecodeError
from dsl_core.evaluation.difference import compare_results, require_same_places, shared_bands
from dsl_core.evaluation.seen_target import Region, SeenTarget, find_target
from dsl_core.evaluation.summary import Truth, evaluate
from dsl_core.evaluation.time_sweep import (
    SweepPoint,
    point_against_result,
    point_against_truth,
    require_sweep,
)
from dsl_core.io.result.result_arrays import load_arrays
from dsl_core.io.result.result_file import load_result
from dsl_core.io.scan.origin import rig_of_notes
from dsl_core.model.attributes import plan_of, stated_band_width_nm
from dsl_core.progress import NoProgress, Progress
from dsl_core.workflows.truths import truth_of

#: A number of mm in the name of a result, as in ``stage -695,2 mm.zarr``. What can be read in two ways is
#: found without its number: a dash after a word need not be a minus, and what parts "1,200" or "1 200" may
#: part thousands.
_ALONE = r"(?<![^\s_=])"
_MM = re.compile(
    rf"(?:((?:{_ALONE}[+\-−]|(?<!\de)(?<![\d.,+\-−]))\d+(?:\.\d+|,\d\d?)?)"
    rf"|{_ALONE}[+\-−]?[1-9]\d?\d?\s\d{{3}}(?:[.,]\d+)?|\d)\s?mm(?![a-z])",
    re.IGNORECASE,
)
#: Options of the twin that say where it puts a flat target.
_PLACES = ("position_mm", "depth_mm")
#: Truths that differ by less are of one scene, mm.
_SAME_MM = 1e-3


def position_of(path: Path, attributes: Mapping[str, Any]) -> float | None:
    """Where the stage stood, mm: from the name of the result, else from the twin that took it.

    >>> position_of(Path("stage -695,2 mm.zarr"), {})
    -695.2
    """
    named = _MM.findall(path.stem)
    if len(named) == 1 and named[0]:
        return float(named[0].replace(",", ".").replace("−", "-"))
    origin = rig_of_notes(attributes)
    options = {} if origin is None else origin[1]
    for text in (options[key] for key in _PLACES if key in options):
        try:
            return float(text)
        except ValueError:
            continue
    return None


def seconds_of(attributes: Mapping[str, Any]) -> float | None:
    """What the capture took: exposures and, where the scan knows it, the projector's latency."""
    plan = plan_of(attributes)
    with suppress(KeyError, TypeError, ValueError):
        return float(attributes["capture_seconds"])
    return None if plan is None else plan.duration_s()


# Depth test ----------------------------------------------------------------------------------------


def read_target(path: Path, region: Region | None = None) -> tuple[SeenTarget, float | None]:
    """The flat target that a result shows, and its position if that is known.

    Raises `DecodeError` when it shows none, `StoreError` when it cannot be read.
    """
    result = load_result(path)
    if "points_mm" not in result:
        raise DecodeError(f"{path.name} contains no points in space. Reconstruct its scan again.")
    flags = result["flags"].values if "flags" in result else None
    try:
        return find_target(result["points_mm"].values, flags, region), position_of(path, result.attrs)
    except DecodeError as error:
        raise DecodeError(f"{path.name}: {error}") from error


def read_targets(
    paths: Sequence[Path],
    positions_mm: Sequence[float] | None = None,
    region: Region | None = None,
    progress: Progress | None = None,
) -> tuple[list[SeenTarget], list[float]]:
    """Targets and positions of results; without ``positions_mm`` each result must know its own.

    Raises `DecodeError` for a result without a target or a position.
    """
    if positions_mm is not None and len(positions_mm) != len(paths):
        raise DecodeError(
            f"{len(paths)} results and {len(positions_mm)} positions were given; give one for each."
        )
    progress = progress or NoProgress()
    targets, found = [], []
    for i, path in enumerate(paths):
        progress.report("find planes", i, len(paths))
        target, known = read_target(path, region)
        if positions_mm is not None:
            known = positions_mm[i]
        if known is None:
            raise DecodeError(
                f"{path.name} does not say where the stage was. Give the positions of all results in mm,"
                " or write them into their names, like 'stage 695.2 mm.zarr'."
            )
        targets.append(target)
        found.append(known)
    return targets, found


# Sweep ---------------------------------------------------------------------------------------------


class TruthReference:
    """The ground truth of the twin's scene; all results must show the same one."""

    name = "the truth of the twin"

    def __init__(self) -> None:
        self._known: dict[Path, tuple[str, Truth]] = {}

    def keep(self, paths: Collection[Path]) -> None:
        """Forget results other than these: those to come need not show their scene."""
        for path in [path for path in list(self._known) if path not in paths]:
            self._known.pop(path, None)

    def judge(self, path: Path, progress: Progress) -> SweepPoint:
        """Seconds and errors against the truth; raises `DecodeError` for another scene."""
        result = load_result(path)
        progress.report("compare with the truth", 0, 1)
        truth = self._truth(path, result)
        return point_against_truth(path.stem, _seconds(path, result.attrs), evaluate(result, truth))

    def _truth(self, path: Path, result: Any) -> Truth:
        bands = result["wavelength_nm"].values if "wavelength_nm" in result.coords else ()
        places = [result[axis].values.tolist() for axis in ("x", "y") if axis in result.coords]
        width_nm = stated_band_width_nm(result.attrs, bands)
        key = repr((rig_of_notes(result.attrs), tuple(bands), width_nm, places))
        # What was known of this path is of a result that has been replaced.
        self._known.pop(path, None)
        known = list(self._known.values())
        truth = next((truth for of, truth in known if of == key), None)
        if truth is None:
            truth = truth_of(result)
            if known:
                _require_same_scene(path, known[0][1], truth)
        self._known[path] = key, truth
        return truth


class ResultReference:
    """One result as the reference, such as that of the longest scan."""

    def __init__(self, path: Path, progress: Progress | None = None) -> None:
        self.path, self.name = path, path.stem
        self._arrays = load_arrays(path, progress)

    def keep(self, paths: Collection[Path]) -> None:
        """Nothing to forget: every result is compared with the reference alone."""

    def judge(self, path: Path, progress: Progress) -> SweepPoint:
        """Seconds and differences from the reference; raises `DecodeError` for the reference itself."""
        if path.resolve() == self.path.resolve():
            raise DecodeError(f"{path.name} is what the others are compared with. Name other results.")
        mine, other = self._arrays, load_arrays(path, progress)
        require_same_places(mine.places_px, other.places_px)
        mine, other = mine.averaged_like(other), other.averaged_like(mine)
        both = mine.has_spectra and other.has_spectra
        bands = shared_bands(mine.wavelengths_nm, other.wavelengths_nm) if both else []
        cubes = [side["reflectance"] if both else None for side in (mine, other)]
        found = compare_results(mine["depth_mm"], other["depth_mm"], cubes[0], cubes[1], bands, progress)
        return point_against_result(path.stem, _seconds(path, other.attributes), found)


def read_sweep(
    paths: Sequence[Path], against: Path | None = None, progress: Progress | None = None
) -> tuple[list[SweepPoint], TruthReference | ResultReference]:
    """Points of results of one scene against its truth, or against one result."""
    progress = progress or NoProgress()
    reference = TruthReference() if against is None else ResultReference(against, progress)
    points = []
    for i, path in enumerate(paths):
        progress.report("compare results", i, len(paths))
        points.append(reference.judge(path, progress))
    require_sweep(points)
    return points, reference


def _seconds(path: Path, attributes: Mapping[str, Any]) -> float:
    seconds = seconds_of(attributes)
    if seconds is None:
        raise DecodeError(
            f"{path.name} does not say how long its capture took. Reconstruct its scan again, with its plan."
        )
    return seconds


def _require_same_scene(path: Path, known: Truth, truth: Truth) -> None:
    if known.depth_mm is None or truth.depth_mm is None:
        return
    if known.depth_mm.shape == truth.depth_mm.shape and np.allclose(
        known.depth_mm, truth.depth_mm, atol=_SAME_MM, rtol=0, equal_nan=True
    ):
        return
    raise DecodeError(
        f"{path.name} shows another scene or part of it, or another camera captured it, than the other"
        " results. A sweep compares scans of one scene, all of the same part."
    )
