"""Rigs with fewer, larger camera pixels, as benchmarks of accuracy against time compare them."""

from __future__ import annotations

from dsl_core.errors import PlanError
from dsl_core.model.rig import Rig


def binned(rig: Rig, factor: int) -> Rig:
    """The rig with ``factor x factor`` pixels of a colour averaged into one; raises `PlanError`.

    A mean of n values has n times the electrons a DN and a read noise smaller by the root of n; lenses see
    the same field with fewer pixels. The black level and the full scale stay.
    """
    lens = rig.camera
    if factor < 1 or min(lens.width_px, lens.height_px) // factor < 16:
        raise PlanError(f"Binning by {factor} leaves too few of {lens.width_px} x {lens.height_px} pixels.")
    if factor == 1:
        return rig
    sensor = rig.sensor.model_copy(
        update={
            "electrons_per_dn": rig.sensor.electrons_per_dn * factor**2,
            "read_noise_dn": rig.sensor.read_noise_dn / factor,
        }
    )
    camera = lens.resized(lens.width_px // factor // 2 * 2, lens.height_px // factor // 2 * 2)
    return rig.model_copy(update={"camera": camera, "sensor": sensor})
