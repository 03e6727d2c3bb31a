"""Columns that are off displace both first orders alike, which is no motion of the film."""

from __future__ import annotations

import numpy as np
import pytest

from dsl_core import pipeline
from dsl_core.model.fit import Fit
from dsl_core.model.presets import preset_plan
from dsl_core.reconstruction.spectral.probing.probe import with_columns_unsure
from dsl_core.simulation import sim_devices
from dsl_core.simulation.published_rig import published_rig
from tests.cases.twin_scan import twin_scan

PIXELS, COUNT = 5, 4
#: Displacement of both orders alike, and of one against the other.
ALIKE, APART = np.array([1.0, 1.0, 0.0, 0.0]), np.array([1.0, -1.0, 0.0, 0.0])


def equations(displaced: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Of pixels whose orders are displaced, and see both orders equally well."""
    spread = np.random.default_rng(1).normal(size=(PIXELS, 20, COUNT))
    spread[:, 10:, 0], spread[:, :10, 1] = 0.0, 0.0
    spread[:, 10:, 1] = spread[:, :10, 0]
    spread[..., 2:] *= 0.1
    normal = spread.mT @ spread
    return normal, normal @ displaced


def test_certain_columns_change_nothing() -> None:
    normal, score = equations(APART)
    found = with_columns_unsure(normal, score, np.zeros(PIXELS))
    assert found[0] == pytest.approx(normal, rel=1e-6, abs=1e-6)
    assert found[1] == pytest.approx(score, rel=1e-6, abs=1e-6)


def test_a_column_that_is_off_asks_for_nothing() -> None:
    normal, score = equations(0.3 * ALIKE)
    unsure = with_columns_unsure(normal, score, np.full(PIXELS, 1e3))
    assert np.abs(score).max() > 1
    assert np.abs(unsure[1]).max() < 1e-4


def test_orders_that_are_farther_apart_ask_for_it_all_the_same() -> None:
    normal, score = equations(0.3 * APART)
    unsure = with_columns_unsure(normal, score, np.full(PIXELS, 1e3))
    asked = score @ APART, np.einsum("p,npq,q->n", APART, normal, APART)
    now = unsure[1] @ APART, np.einsum("p,npq,q->n", APART, unsure[0], APART)
    assert now[0] == pytest.approx(asked[0], rel=0.01)
    assert now[1] == pytest.approx(asked[1], rel=0.01)


def test_a_coarse_film_under_a_comb_has_not_moved(monkeypatch: pytest.MonkeyPatch) -> None:
    rig = published_rig()
    coarse = rig.model_copy(update={"film": rig.film.model_copy(update={"lines_per_mm": 300.0})})
    monkeypatch.setattr(sim_devices, "published_rig", lambda: coarse)
    devices, scan = twin_scan(preset_plan("preview"), scene="face", size="112x72", seed="3")
    assert devices.calibration is not None
    found = Fit.read(pipeline.reconstruct(scan, devices.calibration).attrs)
    assert found is not None
    assert [each.name for each in found.significant if each.part in {"film", "geometry"}] == []
