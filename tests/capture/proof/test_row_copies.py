"""Rows that come twice are told by their noise, and pictures without any are left alone."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from dsl_core.capture.proof.finding import Finding, Verdict
from dsl_core.capture.proof.row_copies import has_row_copies
from dsl_core.capture.proof.verifier import FrameProof
from tests.cases.rendered_rig import RenderedScene, token_image

Mosaic = NDArray[np.uint16]


def picture(noise_dn: float = 3.0) -> Mosaic:
    """Stripes along the rows, on a surface that is mirrored about its middle row."""
    rng = np.random.default_rng(2)
    down, across = np.mgrid[-24:24, :64]
    light = 1000 + 10 * np.abs(down + 0.5) + 400 * (across % 16 < 8) + across
    return np.asarray(np.rint(light + rng.normal(0, noise_dn, light.shape)), np.uint16)


def twice(rows: int, at: int = 20) -> Callable[[Mosaic], Mosaic]:
    return lambda pixels: np.concatenate([pixels[: at + rows], pixels[at:-rows]])


@pytest.mark.parametrize("rows", [2, 4, 8])
def test_rows_that_come_twice_are_told(rows: int) -> None:
    assert not has_row_copies(picture())
    assert has_row_copies(twice(rows)(picture()))


@pytest.mark.parametrize(
    "pixels",
    [
        picture(0.0),
        np.repeat(picture()[::2], 2, axis=0),
        np.full((48, 64), 4095, np.uint16),
        np.where(np.arange(48)[:, None] % 12 < 4, np.uint16(4095), picture()),
        np.tile(picture()[:1], (48, 1)),
        picture()[[*range(12), 10, *range(13, 32), 30, *range(33, 48)]],
    ],
    ids=["without noise", "enlarged", "saturated", "saturated rows", "all alike", "one here, one there"],
)
def test_rows_that_are_alike_for_other_reasons_are_no_copies(pixels: Mosaic) -> None:
    assert not has_row_copies(pixels)


def test_a_picture_with_such_rows_is_taken_again_and_not_believed(scene: RenderedScene) -> None:
    rig, proof = scene.open(4), FrameProof(scene.plan, scene.calibration)
    shots = list(scene.plan.shots())[:2]
    found: list[Finding] = []
    for shot in (shots[0], shots[1], shots[1]):
        rig.camera.configure(shot.exposure_ms)
        rig.projector.show(token_image(scene.plan, shot))
        pixels = rig.camera.snap().pixels
        found.append(proof.judge(shot, twice(4)(pixels) if len(found) == 1 else pixels))
    assert [each.verdict for each in found] == [Verdict.UNTOLD, Verdict.ROWS_TWICE, Verdict.UNTOLD]
    assert found[1].again == (shots[1],)
    assert "some of its rows come twice" in found[1].sentence
