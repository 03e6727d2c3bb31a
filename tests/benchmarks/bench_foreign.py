"""Scans of twins that differ from what their solver assumes: errors, and whether stated bands hold them.

Run ``python -m tests.benchmarks.bench_foreign [--size 222x145] [--variants blur/prnu,curves] [--seeds 0,1]``
from the repository's root; without ``--variants`` all, one by one and then together. Seed 0 is the published
rig, any other the rig drawn by that number. The calibration is that of the rig without its foreign variant:
true, nothing else wrong; with ``--calibrate DIR`` it is what ``dsl-scan calibrate all`` finds of the foreign
rig, nothing told.

``--keep DIR`` stores frames, calibration and truth of every scan; ``--scans DIR`` reconstructs stored ones,
so that two versions of the code can be measured on the same captures. For an older one without this file run
``PYTHONPATH=OLD python tests/benchmarks/bench_foreign.py --variants ... --scans DIR``.

Columns: RMSE of depth (mm) per pixel, its 99th and 99.9th percentile, and the share of pixels inside the
stated 95 % band; RMSE and angle (rad) of patch means; RMSE of pixels, 99th and 99.9th percentile of the error
of reflectance over pixels and bands, and the share of these inside their band; width of peaks (nm) with
``--scene filters``; the share inside the band of patches darker than .15; median chi-square; shares flagged
POOR_FIT and DEPTH_EDGE; seconds of the reconstruction; and the parts of the model of which the result itself
says that they do not fit. ``--plans`` scans with presets. ``--sphere`` scans a ball instead, matt and glossy,
and prints its mean reflectance over the true one, the scatter of that, the angle, the share inside the stated
95 % band and the share of pixels with any flag, by incidence of the light.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any
from unittest.mock import patch

import numpy as np
from numpy.typing import NDArray

from dsl_core import pipeline
from dsl_core.errors import DslError
from dsl_core.evaluation.summary import Truth, interior
from dsl_core.io.rig_file import load_rig
from dsl_core.model.plan import CapturePlan
from dsl_core.model.presets import preset_plan
from dsl_core.model.result import Flag
from dsl_core.model.rig import Rig
from dsl_core.model.spectral import WavelengthGrid
from dsl_core.reconstruction.rows.assembly import Assembly
from dsl_core.reconstruction.rows.bands import Band
from dsl_core.reconstruction.spectral.spectral_maps import SpectralMaps
from dsl_core.workflows import truths
from tests.benchmarks.common import options, print_table, write_json
from tests.cases.twin_scan import MemoryScan, capture

if TYPE_CHECKING:
    import xarray as xr

Floats = NDArray[np.float64]
HEADER = (
    "variant", "seed", "depth mm", "p99", "p99.9", "band %", "patch", "angle", "pixel", "p99", "p99.9",
    "band %", "FWHM", "dark %", "chi2", "poor %", "edge %", "s", "said",
)  # fmt: skip
#: What the scene of a ball is made of.
BALL = {"yellow", "diffuser"}
#: Mean reflectance below which a patch is dark.
DARK = 0.15
#: Edges of the classes of incidence, degrees.
INCIDENCE_DEG = (0, 10, 20, 30, 40, 50, 60)


@dataclass(frozen=True)
class Captured:
    """A scan with the calibration that it is reconstructed with, and what is true of its scene.

    ``incidence_deg`` (h, w) is the angle between surface and projector's light.
    """

    scan: MemoryScan
    rig: Rig
    truth: Truth
    incidence_deg: Floats

    def save(self, folder: Path) -> None:
        """Store all of it in a folder."""
        folder.mkdir(parents=True, exist_ok=True)
        truth = self.truth
        np.save(folder / "frames.npy", np.stack(self.scan.frames))
        (folder / "plan.json").write_text(self.scan.plan.model_dump_json(), encoding="utf-8")
        # Without what has its default, an older version can read it too.
        known = self.rig.model_dump(mode="json", exclude_defaults=True) | {"schema_version": 1}
        (folder / "rig.json").write_text(json.dumps(known), encoding="utf-8")
        assert truth.depth_mm is not None
        assert truth.lit is not None
        assert truth.material is not None
        assert truth.spectra is not None
        np.savez(
            folder / "truth.npz",
            depth_mm=truth.depth_mm,
            lit=truth.lit,
            material=truth.material,
            names=np.array(truth.names),
            spectra=truth.spectra,
            targets=np.array(truth.targets),
            incidence_deg=self.incidence_deg,
        )

    @classmethod
    def load(cls, folder: Path) -> Captured:
        """What `save` stored."""
        plan = CapturePlan.model_validate_json((folder / "plan.json").read_text(encoding="utf-8"))
        known = np.load(folder / "truth.npz")
        truth = Truth(
            known["depth_mm"],
            known["lit"],
            known["material"],
            tuple(str(name) for name in known["names"]),
            known["spectra"],
            tuple(int(i) for i in known["targets"]),
        )
        frames = tuple(np.load(folder / "frames.npy"))
        return cls(MemoryScan(plan, frames), load_rig(folder / "rig.json"), truth, known["incidence_deg"])


def capture_variant(
    variant: str, seed: int, size: str, look: dict[str, str], plan: CapturePlan | None = None
) -> Captured:
    """Scan the scene with a foreign twin; the calibration is that of the twin without the variant."""
    from dsl_core.simulation.sim_devices import open_twin

    devices = open_twin({**look, "size": size, "seed": str(1000 + seed), **rig_options(variant, seed)})
    truth = truths.twin_truth(devices, WavelengthGrid())
    assert truth is not None
    world = devices.camera.world  # type: ignore[attr-defined]
    shown = plan or CapturePlan()
    return Captured(capture(devices, shown), world.rig, truth, incidence_deg(world.rig, world.truth))


def rig_options(variant: str, seed: int) -> dict[str, str]:
    """Options of the rig: a drawn one, and what is foreign about it."""
    drawn = {"truth": str(seed)} if seed else {}
    return drawn if variant == "usual" else {**drawn, "foreign": variant}


def incidence_deg(rig: Rig, truth: Any) -> Floats:
    """Angle between normal and light at every pixel, (h, w)."""
    from dsl_core.optics.pinhole import pixel_rays

    points = pixel_rays(rig.camera) * np.nan_to_num(truth.depth_mm, nan=1.0)
    to_light = rig.pose.projector_centre_mm[:, None, None] - points
    cosine = (truth.normals * to_light).sum(0) / np.linalg.norm(to_light, axis=0)
    return np.asarray(np.degrees(np.arccos(np.clip(cosine, -1, 1))))


def calibrated(variant: str, seed: int, size: str, folder: Path) -> Rig:
    """The rig that the commands find, left in a folder; raises `DslError` with the sentence of a refusal."""
    home = folder / f"{variant}-{seed}"
    # A rig is there from the first step on; with this record the calibration is whole.
    if not (home / "depth-stage.json").exists():
        chosen = {"size": size, "seed": str(seed), **rig_options(variant, seed)}
        words = ["--rig", "twin", "--yes", "--no-library"]
        words += [part for key, value in chosen.items() for part in ("--option", f"{key}={value}")]
        done = subprocess.run(
            [sys.executable, "-m", "dsl_core", "calibrate", "all", str(home), *words],
            env={**os.environ, "PYTHONPATH": str(Path.cwd())},
            capture_output=True,
            text=True,
        )
        if done.returncode != 0:
            raise DslError(f"calibrate all: {done.stderr.strip()[-300:]}")
    return load_rig(home / "rig.json")


@contextmanager
def chi_squares() -> Iterator[list[Floats]]:
    """Reduced chi-square of every pixel of each result that is made meanwhile."""
    kept: list[Floats] = []
    usual = Assembly.put

    def put(self: Assembly, band: Band, spectra: SpectralMaps | None) -> None:
        if spectra is not None:
            kept.append(np.asarray(spectra.chi_square, np.float64))
        usual(self, band, spectra)

    with patch.object(Assembly, "put", put):
        yield kept


def measure(taken: Captured) -> dict[str, Any]:
    """All figures of a scan."""
    start = time.process_time()
    with chi_squares() as fits:
        result = pipeline.reconstruct(taken.scan, taken.rig)
    seconds = time.process_time() - start
    found = pipeline.evaluate(result, taken.truth)
    assert found.depth is not None
    assert found.depth_calibration is not None
    flags, spectral = result["flags"].values, found.spectral_calibration
    depth_error, known = depth_errors(result, taken.truth)
    errors = reflectance_errors(result, taken.truth)
    figures: dict[str, Any] = {
        "depth_rmse_mm": found.depth.rmse_mm,
        "depth_p99_mm": float(np.quantile(depth_error, 0.99)),
        "depth_p999_mm": float(np.quantile(depth_error, 0.999)),
        "depth_band": found.depth_calibration.coverage_95,
        "patch_rmse": found.mean("rmse"),
        "angle_rad": found.mean("angle_rad"),
        "pixel_rmse": found.pixel_rmse,
        "error_p99": float(np.quantile(errors, 0.99)),
        "error_p999": float(np.quantile(errors, 0.999)),
        "spectral_band": None if spectral is None else spectral.coverage_95,
        "dark_band": dark_band(result, taken.truth),
        "fwhm_nm": found.mean_fwhm_nm,
        "chi2": float(np.nanmedian(fits[0])),
        "poor_fit": float(((flags[known] & Flag.POOR_FIT) > 0).mean()),
        "depth_edge": float(((flags[known] & Flag.DEPTH_EDGE) > 0).mean()),
        "cpu_s": seconds,
        "said": said(result),
    }
    if set(taken.truth.names) >= BALL:
        figures["by_incidence"] = by_incidence(result, taken)
    return figures


def depth_errors(result: xr.Dataset, truth: Truth) -> tuple[Floats, NDArray[np.bool_]]:
    """Absolute errors of depth (mm) of lit pixels that have one, and which pixels these are."""
    assert truth.depth_mm is not None
    assert truth.lit is not None
    error = np.abs(result["depth_mm"].values - truth.depth_mm)
    known = np.isfinite(error) & truth.lit
    return np.asarray(error[known], np.float64), known


def reflectance_errors(result: xr.Dataset, truth: Truth) -> Floats:
    """Absolute errors of reflectance of all bands inside the patches."""
    error = _errors_and_std(result, truth, truth.targets or ())[0]
    return np.asarray(error[np.isfinite(error)], np.float64)


def dark_band(result: xr.Dataset, truth: Truth) -> float | None:
    """Share of the reflectances of dark patches inside their band; None where there are none."""
    assert truth.spectra is not None
    dark = [target for target in truth.targets or () if truth.spectra[target].mean() < DARK]
    error, std = _errors_and_std(result, truth, dark)
    known = np.isfinite(error)
    return float((error < 1.96 * std)[known].mean()) if known.any() else None


def _errors_and_std(result: xr.Dataset, truth: Truth, targets: Sequence[int]) -> tuple[Floats, Floats]:
    """Absolute errors of reflectance and its stated deviation, (bands, pixels), inside some patches."""
    assert truth.material is not None
    assert truth.spectra is not None
    assert truth.lit is not None
    chosen = interior(truth.material) & np.isin(truth.material, targets) & truth.lit
    wanted = truth.spectra[truth.material[chosen]].T
    error = np.abs(result["reflectance"].values[:, chosen] - wanted)
    return np.asarray(error, np.float64), np.asarray(result["reflectance_std"].values[:, chosen], np.float64)


def by_incidence(result: xr.Dataset, taken: Captured) -> list[dict[str, float]]:
    """Reflectance of the ball over its true one, by angle of incidence, and whether its band holds it."""
    truth = taken.truth
    assert truth.material is not None
    assert truth.spectra is not None
    cube, std = result["reflectance"].values, result["reflectance_std"].values
    wanted = truth.spectra[truth.names.index("yellow")]
    ball = interior(truth.material) & (truth.material == truth.names.index("yellow")) & truth.lit
    ball &= np.isfinite(cube).all(0)
    rows = []
    for low, high in zip(INCIDENCE_DEG, (*INCIDENCE_DEG[1:], 90), strict=True):
        here = ball & (taken.incidence_deg >= low) & (taken.incidence_deg < high)
        if not here.any():
            continue
        seen = cube[:, here].astype(np.float64)
        ratio = seen.mean(0) / wanted.mean()
        inside = np.abs(seen - wanted[:, None]) < 1.96 * std[:, here]
        cosine = (wanted @ seen) / np.linalg.norm(wanted) / np.linalg.norm(seen, axis=0)
        rows.append(
            {
                "from_deg": low,
                "pixels": int(here.sum()),
                "ratio": float(ratio.mean()),
                "scatter": float(ratio.std()),
                "angle_rad": float(np.arccos(np.clip(cosine, -1, 1)).mean()),
                "in_band": float(inside.mean()),
                "flagged": float((result["flags"].values[here] > 0).mean()),
            }
        )
    return rows


def said(result: xr.Dataset) -> str:
    """Parts of the model that the result says do not fit, worst first; a dash for none or an older result."""
    findings = json.loads(str(result.attrs.get("fit", "{}"))).get("findings", [])
    parts = [f"{f['part']}:{f['name']}" for f in findings if f["significant"]]
    return ", ".join(dict.fromkeys(parts)) or "-"


def row(variant: str, seed: int, figures: dict[str, Any]) -> list[str]:
    """The cells of a table."""

    def share(value: float | None) -> str:
        return "-" if value is None else f"{100 * value:.1f}"

    f = figures
    return [
        variant, str(seed), f"{f['depth_rmse_mm']:.3f}", f"{f['depth_p99_mm']:.2f}",
        f"{f['depth_p999_mm']:.2f}", share(f["depth_band"]), f"{f['patch_rmse']:.4f}",
        f"{f['angle_rad']:.4f}", f"{f['pixel_rmse']:.4f}",
        f"{f['error_p99']:.3f}", f"{f['error_p999']:.3f}", share(f["spectral_band"]),
        "-" if f["fwhm_nm"] is None else f"{f['fwhm_nm']:.1f}", share(f["dark_band"]),
        f"{f['chi2']:.2f}", share(f["poor_fit"]), share(f["depth_edge"]), f"{f['cpu_s']:.0f}", f["said"],
    ]  # fmt: skip


def looks(arguments: argparse.Namespace) -> dict[str, dict[str, str]]:
    """Options of the twin's scene by what is added to the names of its scans."""
    if not arguments.sphere:
        scene = arguments.scene
        return {"" if scene == "color-checker" else f"-{scene}": {"scene": scene}}
    from dsl_core.simulation.effects.catalogue import USUAL

    effects = ",".join(sorted(USUAL | {"specular"}))
    return {"-matt": {"scene": "sphere"}, "-glossy": {"scene": "sphere", "gloss": "0.04", "effects": effects}}


def cases(arguments: argparse.Namespace) -> Iterator[tuple[str, str, int, Captured]]:
    """Every scan that was asked for, stored or taken now: its name in the table, variant, seed."""
    for seed in arguments.seeds:
        for variant in arguments.variants:
            for look, texts in ({"": {}} if arguments.scans else looks(arguments)).items():
                for plan in arguments.plans:
                    name = variant + look + (f"-{plan}" if plan else "")
                    folder = f"{variant}-{seed}-{arguments.size}{look}" + (f"-{plan}" if plan else "")
                    if not arguments.scans:
                        taken = capture_variant(variant, seed, arguments.size, texts, preset_plan(plan))
                        if arguments.keep:
                            taken.save(arguments.keep / folder)
                        yield name, variant, seed, taken
                    elif (arguments.scans / folder / "truth.npz").is_file():
                        yield name, variant, seed, Captured.load(arguments.scans / folder)


def main() -> None:
    """Print one row a scan, and the ball by incidence."""
    parser = options(__doc__)
    parser.add_argument("--size", default="222x145")
    parser.add_argument(
        "--variants", type=lambda text: text.split("/"), help="slashes between; commas combine"
    )
    parser.add_argument("--seeds", type=lambda text: [int(s) for s in text.split(",")], default=[0])
    parser.add_argument("--scene", default="color-checker")
    parser.add_argument("--plans", type=lambda text: text.split(","), default=[""], help="quick,coarse")
    parser.add_argument("--sphere", action="store_true", help="a matt and a glossy ball")
    parser.add_argument("--keep", type=Path, metavar="DIR")
    parser.add_argument("--scans", type=Path, metavar="DIR")
    parser.add_argument("--calibrate", type=Path, metavar="DIR", help="folder for the calibrations")
    arguments = parser.parse_args()
    if arguments.variants is None:
        from dsl_core.simulation.foreign.variants import VARIANTS

        arguments.variants = ["usual", *VARIANTS, "all"]  # usual: the twin's own renderer
    if arguments.quick:
        arguments.variants, arguments.size = arguments.variants[:3], "112x72"
    rows: list[dict[str, Any]] = []
    print_table(HEADER, [])
    for name, variant, seed, taken in cases(arguments):
        try:
            if arguments.calibrate:
                found = calibrated(variant, seed, arguments.size, arguments.calibrate)
                taken = Captured(taken.scan, found, taken.truth, taken.incidence_deg)
            figures = measure(taken)
        except DslError as error:
            print(f"{variant} {seed}: {error}", flush=True)
            rows.append({"variant": variant, "seed": seed, "failure": str(error)})
            continue
        print("  ".join(row(name, seed, figures)), flush=True)
        for part in figures.get("by_incidence", []):
            print("    " + "  ".join(f"{key} {value:.4g}" for key, value in part.items()), flush=True)
        rows.append({"variant": name, "seed": seed, **figures})
    print()
    print_table(HEADER, [row(r["variant"], r["seed"], r) for r in rows if "failure" not in r])
    write_json(arguments.json, {"size": arguments.size, "scene": arguments.scene, "rows": rows})


if __name__ == "__main__":
    main()
