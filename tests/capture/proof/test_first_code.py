"""Pictures of a first code that a camera sees column by column: what is located, and what is not."""

from __future__ import annotations

import numpy as np
import pytest

from dsl_core.capture.proof.finding import Verdict
from dsl_core.capture.proof.first_code import FirstCode
from dsl_core.capture.proof.raster import Counts, Noise, Raster
from dsl_core.model.plan import CapturePlan, GrayCode, LineComb, Setting, Shot
from dsl_core.model.rig import Sensor
from dsl_core.optics.sensor import bayer_channels
from dsl_core.patterns.images import pattern_image

PLAN = CapturePlan(
    camera_size_px=(32, 18),
    projector_size_px=(32, 18),
    code=GrayCode(rows=False),
    spectral=LineComb(width_px=2, step_px=2, period_px=8),
    settings=(Setting(exposure_ms=10.0, level=1.0),),
    code_settings=(0,),
)
SHOTS = [shot for shot in PLAN.shots() if shot.role in ("code", "white", "black")]
RASTER = Raster(PLAN.camera_size_px)
SENSOR = Sensor()


def seen(shot: Shot, light: np.ndarray | float = 2000.0) -> Counts:
    """The camera's column is the projector's."""
    image = pattern_image(PLAN, shot)[..., 1] / 255.0
    return RASTER.take((SENSOR.black_level_dn + light * image).astype(np.uint16))


def judged(light: np.ndarray | float = 2000.0) -> tuple[FirstCode, list[Verdict]]:
    assert isinstance(PLAN.code, GrayCode)
    code = FirstCode(PLAN, PLAN.code, SHOTS, RASTER, Noise(SENSOR), "RGGB", True)
    verdicts, before = [], None
    for shot in SHOTS:
        picture = seen(shot, light)
        verdicts.append(code.add(shot, picture, before).verdict)
        before = picture
    return code, verdicts


def test_every_column_is_located_with_its_colour_and_contrast() -> None:
    code, verdicts = judged()
    assert set(verdicts) <= {Verdict.RIGHT, Verdict.UNTOLD}
    assert code.lacking == ()
    assert code.lit is not None
    assert set((code.lit.key // 3).tolist()) == set(range(32)), "the first and the last among them"
    columns = RASTER.take(np.tile(np.arange(32, dtype=np.uint16), (18, 1)))
    colours = RASTER.take(bayer_channels("RGGB", 18, 32).astype(np.uint16))
    assert (code.lit.key // 3).tolist() == columns[code.lit.index].tolist()
    assert (code.lit.key % 3).tolist() == colours[code.lit.index].tolist()
    assert code.lit.contrast == pytest.approx(np.full(code.lit.index.size, 2000.0), abs=1)


def test_pixels_in_shadow_and_saturated_ones_are_not_located() -> None:
    light = np.full((18, 32), 2000.0)
    light[:, :5], light[:, 27:] = 3.0, SENSOR.full_scale_dn - SENSOR.black_level_dn
    code, _ = judged(light)
    assert code.lit is not None
    assert set((code.lit.key // 3).tolist()) == set(range(5, 27))


def test_nothing_is_located_of_few_pixels_or_without_all_pictures() -> None:
    light = np.zeros((18, 32))
    light[:, :3] = 2000.0
    assert judged(light)[0].lit is None
    light[:, :8] = 2000.0
    assert judged(light)[0].lit is not None
    assert isinstance(PLAN.code, GrayCode)
    part = FirstCode(PLAN, PLAN.code, SHOTS, RASTER, Noise(SENSOR), "RGGB", True)
    for shot in SHOTS[:-1]:
        part.add(shot, seen(shot), None)
    assert part.lit is None
