"""Class maps of the twin's chart, leaves (metamers) and filters: right, wrong, none, by noise and by method.

Run ``python -m tests.benchmarks.bench_classify [--size 222x145] [--noise 0 0.001] [--json FILE]`` from the
repository's root. Classes are the true spectra of the scene, averaged over the bands by their width; a second
table leaves one class after the other out of the list, when all of its pixels should be none of these. Beside
the probability stand the spectral angle and the difference at their usual limits and, from the package
`spectral`, its angle, Mahalanobis and Gaussian classifiers, the last two trained on a quarter of the pixels
of each material. They name every pixel; "none" does not exist for them.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

import dsl_core as dsl
from dsl_core.analysis.classes import Member, SpectralClass
from dsl_core.analysis.classification import classify_result
from dsl_core.analysis.classify import Measure
from dsl_core.evaluation.summary import interior
from dsl_core.model.spectral import SpectralCurve, at_bands
from dsl_core.simulation.sim_devices import SimCamera
from tests.benchmarks.common import print_table, write_json

if TYPE_CHECKING:
    import xarray as xr

#: Scenes, and noise beyond the sensor's own, as a share of full scale. With 0.001, the check of captured
#: pictures refuses some of a chart.
SCENES = ("color-checker", "leaves", "filters")
NOISE = (0.0,)
#: Materials around a scene, of which nobody asks.
_AROUND = ("frame", "wall", "board")
ABSENT = ("scene", "noise", "seed", "method", "pixels", "none", "undecided", "wrong")
HEADS = ("scene", "noise", "seed", "method", "pixels", "right", "wrong", "none", "undecided", "seconds")


@dataclass(frozen=True)
class Case:
    """A result with the material of its pixels, and classes from their true spectra."""

    scene: str
    noise: float
    seed: int
    result: xr.Dataset
    material: NDArray[np.int32]
    known: NDArray[np.bool_]
    classes: tuple[SpectralClass, ...]


def scanned(scene: str, noise: float, seed: int, size: str, folder: Path) -> Case:
    """Scan and reconstruct a scene of the twin."""
    with dsl.open_rig("twin", scene=scene, size=size, seed=seed, sigma=noise) as rig:
        scan = dsl.scan(rig, folder / f"{scene}-{noise}-{seed}.dsl", dsl.plan(rig))
        assert isinstance(rig.camera, SimCamera)
        truth = rig.camera.world.truth
    result = dsl.reconstruct(scan)
    materials, bands = truth.materials, result["wavelength_nm"].values
    spectra = (at_bands(SpectralCurve.of(materials.wavelengths_nm, r), bands) for r in materials.reflectance)
    classes = tuple(
        SpectralClass(name, (Member.of(each.values),))
        for name, each in zip(materials.names, spectra, strict=True)
    )
    asked = np.isin(truth.material, [i for i, name in enumerate(materials.names) if name not in _AROUND])
    known = interior(truth.material) & truth.lit & asked
    return Case(scene, noise, seed, result, truth.material, known, classes)


def by_us(case: Case, measure: Measure, classes: tuple[SpectralClass, ...]) -> tuple[Any, float]:
    """Our map, and the seconds it took."""
    start = time.perf_counter()
    found = classify_result(case.result, classes, measure)
    return found.shown, time.perf_counter() - start


def by_spectral(case: Case) -> dict[str, tuple[NDArray[np.intp], float]]:
    """Maps (index of the class for each pixel) of the package's classifiers, and their seconds."""
    import spectral

    cube = np.nan_to_num(np.moveaxis(case.result["reflectance"].values, 0, -1)).astype(np.float64)
    means = np.stack([each.mean for each in case.classes])
    start = time.perf_counter()
    nearest = spectral.spectral_angles(cube, means).argmin(-1)
    found = {"spectral: angle": (nearest, time.perf_counter() - start)}
    labels = np.zeros(case.material.shape, int)
    at = np.flatnonzero(case.known)[::4]
    labels.flat[at] = case.material.flat[at] + 1
    training = spectral.create_training_classes(cube, labels, calc_stats=True)
    for name, kind in (
        ("spectral: Mahalanobis", spectral.MahalanobisDistanceClassifier),
        ("spectral: Gaussian", spectral.GaussianClassifier),
    ):
        start = time.perf_counter()
        try:
            answer = kind(training).classify_image(cube) - 1
        except Exception as error:  # too few pixels for as many bands, or a covariance without inverse
            print(f"{name} on {case.scene}: {error}")
            continue
        found[name] = (np.asarray(answer, np.intp), time.perf_counter() - start)
    return found


def rows_of(case: Case) -> list[tuple[Any, ...]]:
    """A line of the table for each method."""
    head, rows = (case.scene, case.noise, case.seed), []
    for measure in Measure:
        shown, seconds = by_us(case, measure, case.classes)
        judged = case.known & (shown.values > 0)
        values, truth = shown.values[judged], case.material[judged] + 1
        shares = (
            (values == truth).mean(),
            ((values != truth) & (values < shown.none)).mean(),
            (values == shown.none).mean(),
            (values == shown.unsure).mean(),
        )
        figures = (round(float(share), 5) for share in shares)
        rows.append((*head, measure.value, int(judged.sum()), *figures, round(seconds, 2)))
    solid = case.known & np.isfinite(case.result["reflectance"].values).all(0)
    for name, (answer, seconds) in by_spectral(case).items():
        right = round(float((answer[solid] == case.material[solid]).mean()), 5)
        rows.append((*head, name, int(solid.sum()), right, round(1 - right, 5), 0.0, 0.0, round(seconds, 2)))
    return rows


def left_out(case: Case) -> list[tuple[Any, ...]]:
    """What pixels become whose class is not in the list: none, undecided, or named after another."""
    rows = []
    for measure in Measure:
        none = unsure = wrong = pixels = 0
        for index in np.unique(case.material[case.known])[:6]:
            classes = tuple(each for i, each in enumerate(case.classes) if i != index)
            shown, _ = by_us(case, measure, classes)
            values = shown.values[case.known & (case.material == index) & (shown.values > 0)]
            pixels += values.size
            none += int((values == shown.none).sum())
            unsure += int((values == shown.unsure).sum())
            wrong += int((values < shown.none).sum())
        shares = (round(count / max(pixels, 1), 5) for count in (none, unsure, wrong))
        rows.append((case.scene, case.noise, case.seed, measure.value, pixels, *shares))
    return rows


def main() -> None:
    """Run all scenes and print the tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--size", default="222x145")
    parser.add_argument("--seeds", type=int, default=1)
    parser.add_argument("--noise", type=float, nargs="+", default=NOISE)
    parser.add_argument("--scenes", nargs="+", default=SCENES)
    parser.add_argument("--json", type=Path)
    given = parser.parse_args()
    rows, unknown = [], []
    with tempfile.TemporaryDirectory() as folder:
        for scene in given.scenes:
            for noise in given.noise:
                for seed in range(1, given.seeds + 1):
                    case = scanned(scene, noise, seed, given.size, Path(folder))
                    rows += (known := rows_of(case))
                    unknown += (absent := left_out(case))
                    print_table(HEADS, known)
                    print_table(ABSENT, absent)
    write_json(given.json, {"known": rows, "left out": unknown})


if __name__ == "__main__":
    main()
