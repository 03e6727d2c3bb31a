"""The stated rate of "none of these", on a scan of the twin whose spectra are known."""

import numpy as np
import pytest

from dsl_core.analysis.classes import Member, SpectralClass
from dsl_core.analysis.classification import classify_result
from dsl_core.analysis.classify import Limits, Measure
from dsl_core.evaluation.summary import interior
from dsl_core.io.result.result_file import load_result
from dsl_core.model.spectral import SpectralCurve, at_bands
from dsl_core.resources import resource_path
from dsl_core.simulation.scenes.materials import chart_spectra
from dsl_core.simulation.scenes.truth import FINE_NM
from dsl_core.workflows.truths import truth_of

#: A part of the picture with four patches and what is between them.
PART = {"y": slice(20, 130), "x": slice(20, 160)}


def test_none_of_these_keeps_its_rate_and_no_patch_gets_the_name_of_another() -> None:
    whole = load_result(resource_path("examples/color-checker.zarr"))
    truth = truth_of(whole)
    assert truth.material is not None
    assert truth.lit is not None
    result, material = whole.isel(PART), truth.material[PART["y"], PART["x"]]
    bands = result["wavelength_nm"].values
    classes = []
    for name, values in chart_spectra().items():
        spectrum = at_bands(SpectralCurve.of(FINE_NM, values), bands).values
        classes.append(SpectralClass(name, (Member.of(spectrum),)))
    limits = Limits(0.01, 0.95)
    found = classify_result(result, classes, Measure.PROBABILITY, limits)
    known = interior(material) & truth.lit[PART["y"], PART["x"]] & (material >= 0) & (material < len(classes))
    known &= result["flags"].values == 0
    assert known.sum() > 6_000
    shown, best = found.shown.values[known], found.scores.best[known]
    assert truth.names[:2] == (classes[0].name, classes[1].name)
    right = shown == material[known] + 1
    named = shown <= len(classes)
    assert right[named].all()
    assert right.mean() > 0.98
    assert (best == material[known]).mean() > 0.999
    assert (found.scores.fit[known] < limits.worst).mean() <= limits.worst
    # Without its own patch in the library, a pixel is none of these or undecided, not another patch.
    two = [each for each in classes if each.name not in ("foliage", "orange")]
    without = classify_result(result, two).shown
    unknown = known & np.isin(material, [3, 6])
    assert (without.values[unknown] > len(two)).mean() == pytest.approx(1.0, abs=1e-3)
