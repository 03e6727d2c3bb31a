"""What white and black of one setting say that no other picture of a scan does."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dsl_core.capture.proof.lasting.black_light import black_light, lit_black, room_light
from dsl_core.capture.proof.lasting.black_values import filled_rows, low_black
from dsl_core.capture.proof.lasting.missing_light import missing_light
from dsl_core.capture.proof.lasting.sensor_parts import sensor_parts
from dsl_core.capture.proof.lasting.written_row import written_row
from dsl_core.capture.proof.noise import Noise
from dsl_core.capture.proof.raster import Counts, Raster
from dsl_core.model.plan import CapturePlan
from dsl_core.model.rig import Rig


def sentences_of_ends(
    white: Counts, black: Counts, plan: CapturePlan, setting: int, rig: Rig | None,
    channels: NDArray[np.int8], noise: Noise, raster: Raster, with_colours: bool,
) -> list[str]:  # fmt: skip
    """What is wrong with white and black, rasters of a setting of the plan, in sentences.

    ``channels`` are the colours of their pixels. Without a calibration, nobody knows what is usual; without
    ``with_colours``, missing ones are left out, which a filter before the camera takes away.
    """
    written = written_row(black, noise, raster)
    if written is not None:
        return [written.sentence]  # its numbers look like light
    lit = lit_black(white, black, channels, noise, raster, plan.camera_size_px)
    if lit is not None:
        return [lit.sentence]  # the rest would be judged by what is in the picture
    level = plan.settings[setting].level
    is_highest = level == max(each.level for each in plan.settings)
    room = room_light(white, black, level, noise, is_highest=is_highest)
    if rig is None or room:
        return [room] if room else []  # room light is not told from the projector's
    glow = black_light(white, black, level, rig.projector_response, channels, noise, raster)
    parts = sensor_parts(white, black, channels, noise, raster, plan.camera_size_px[0])
    found = [low_black(black, noise), filled_rows(black, noise, raster)]
    found += [each.sentence for each in (glow, parts) if each is not None]
    if with_colours:
        found.append(missing_light(white, black, rig, channels, noise, raster))
    return [each for each in found if each]
