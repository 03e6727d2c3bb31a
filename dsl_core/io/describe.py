"""What a folder or file of this program holds, in facts by name."""

from __future__ import annotations

import itertools
from pathlib import Path
from typing import Any

import numpy as np

from dsl_core.errors import StoreError
from dsl_core.io import CAMPAIGN_NAME, MANIFEST_NAME
from dsl_core.io.campaign_folder import CampaignFolder
from dsl_core.io.plan_file import load_plan
from dsl_core.io.reading import read_bounded, read_json
from dsl_core.io.result.result_file import check_values, has_checksums, load_result
from dsl_core.io.rig_file import load_rig
from dsl_core.io.scan.check import find_problems
from dsl_core.io.scan.folder import ScanReader
from dsl_core.io.sealed import is_sealed
from dsl_core.model.fit import Fit
from dsl_core.model.plan import CapturePlan
from dsl_core.words import counted

#: A file by hand, or one of an earlier version.
_UNCHECKED = "none: damage would not be noticed"
Facts = dict[str, Any]


def describe(path: Path, verify: bool = False) -> Facts:
    """Facts about a scan, result, campaign, rig or plan; ``verify`` also reads all frames or values.

    Raises `StoreError` when the path is none of them, and the reader's own error when it is a damaged one.
    """
    if (path / MANIFEST_NAME).is_file():
        return _scan(path, verify)
    if (path / CAMPAIGN_NAME).is_file():
        return _campaign(CampaignFolder.open(path))
    if (path / "zarr.json").is_file():
        return _result(path, verify)
    if path.is_file() and path.suffix.lower() == ".json":
        return _json(path)
    if not path.exists():
        raise StoreError(f"{path} does not exist. Give a scan (NAME.dsl), a result, a rig or a plan.")
    raise StoreError(
        f"{path} is neither a scan (it has no {MANIFEST_NAME}) nor a result (no zarr.json), nor the"
        " JSON file of a rig or plan. For a published dataset use 'dsl-scan import'."
    )


def _scan(path: Path, verify: bool) -> Facts:
    reader = ScanReader(path)
    manifest = reader.manifest
    problems = find_problems(reader, verify)
    return {
        "kind": "scan",
        "created": manifest.created,
        "rig": manifest.rig_name,
        "camera": manifest.camera.model if manifest.camera else None,
        "projector": manifest.projector.model if manifest.projector else None,
        "calibration": manifest.calibration.name if manifest.calibration else None,
        **_plan_facts(reader.plan),
        "frames_stored": reader.plan.shot_count - len(reader.missing()),
        "bytes": sum(file.stat().st_size for file in path.rglob("*") if file.is_file()),
        "complete": not problems,
        "checked": "every pixel" if verify else "names, sizes and log",
        "checksums": _checksum_of(path / MANIFEST_NAME),
        "problems": problems,
        "notes": manifest.notes,
    }


def _campaign(campaign: CampaignFolder) -> Facts:
    names = sorted(path.name for path in campaign.path.iterdir() if path.is_dir())
    accepted = {name: found for name in names if (found := campaign.accepted(name)) is not None}
    return {
        "kind": "campaign",
        "created": campaign.info.created,
        "rig": campaign.info.rig,
        "options": campaign.info.options,
        "accepted": {name: each.accepted for name, each in accepted.items()},
        "outside_limits": [f"{name}: {f}" for name, each in accepted.items() for f in each.note.failed],
        "settings": campaign.info.settings,
    }


def _result(path: Path, verify: bool) -> Facts:
    result = load_result(path)
    if verify:
        check_values(path)
    checksums = f"of every chunk, {'compared' if verify else 'not compared'}"
    facts: Facts = {
        "kind": "result",
        "size_px": [result.sizes["x"], result.sizes["y"]],
        "variables": [str(name) for name in result.data_vars],
        "checksums": checksums if has_checksums(path) else _UNCHECKED,
    }
    if "wavelength_nm" in result.coords:
        centres = result["wavelength_nm"].values
        facts["bands"] = f"{len(centres)} from {centres[0]:g} to {centres[-1]:g} nm"
    if "depth_mm" in result:
        depth = result["depth_mm"].values
        known = depth[np.isfinite(depth)]
        facts["pixels_with_depth"] = round(known.size / depth.size, 4)
        if known.size:
            facts["depth_mm"] = [round(float(v), 2) for v in (known.min(), np.median(known), known.max())]
    if (fit := Fit.read(result.attrs)) is not None:
        facts["verdict"] = fit.headline
    return {**facts, "attributes": {str(key): value for key, value in result.attrs.items()}}


def _json(path: Path) -> Facts:
    try:
        content = read_json(path)
    except (OSError, ValueError) as error:
        raise StoreError(
            f"{path} is not JSON ({error}). The file may be cut off; restore it from a copy."
        ) from error
    keys = set(content) if isinstance(content, dict) else set()
    if "camera_size_px" in keys or "spectral" in keys:
        return {"kind": "plan", **_plan_facts(load_plan(path)), "checksums": _checksum_of(path)}
    if "film" not in keys and "response" not in keys:
        raise StoreError(f"{path} contains neither a rig nor a plan. Give a file that dsl-scan wrote.")
    rig = load_rig(path)
    return {
        "kind": "rig",
        "name": rig.name,
        "checksums": _checksum_of(path),
        "camera_px": [rig.camera.width_px, rig.camera.height_px],
        "projector_px": [rig.projector.width_px, rig.projector.height_px],
        "film_lines_per_mm": rig.film.lines_per_mm,
        "depth_range_mm": list(rig.depth_range_mm),
        "orders": sorted(rig.efficiency),
        "provenance": rig.provenance.model_dump(),
    }


def _checksum_of(path: Path) -> str:
    """Whether a JSON file that was read carries a checksum, which then agrees."""
    return "agrees" if is_sealed(read_bounded(path)) else _UNCHECKED


def _plan_facts(plan: CapturePlan) -> Facts:
    return {
        "plan": plan.name,
        "frames": plan.shot_count,
        "camera_px": list(plan.camera_size_px),
        "projector_px": list(plan.projector_size_px),
        "code_frames": plan.code_count,
        "spectral_patterns": f"{plan.spectral_count} ({plan.spectral.kind})",
        "sentinels": _sentinel_fact(plan),
        "settings": [f"{s.exposure_ms:.4g} ms at level {s.level:g}" for s in plan.settings],
    }


def _sentinel_fact(plan: CapturePlan) -> str:
    shots = [shot.index for shot in plan.shots() if shot.role == "sentinel"]
    rounds = sum(b - a > 1 for a, b in itertools.pairwise(shots)) + bool(shots)
    share = 100 * len(shots) / plan.shot_count
    return f"{len(shots)} repeats in {counted(rounds, 'round')} ({share:.1f} %)" if shots else "none"
