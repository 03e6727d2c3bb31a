"""A valid rig with few samples, close to the published prototype."""

from __future__ import annotations

from dsl_core.model.geometry import Lens, Pose
from dsl_core.model.rig import Film, Rig
from dsl_core.model.spectral import SpectralCurve


def small_rig() -> Rig:
    """A rig of 890 x 580 camera and 640 x 360 projector pixels."""

    def curve(*values: float) -> SpectralCurve:
        return SpectralCurve.of([430, 545, 660], values)

    return Rig(
        name="small",
        camera=Lens(
            width_px=890,
            height_px=580,
            fx_px=1761.23,
            fy_px=1764.04,
            cx_px=428.86,
            cy_px=294.84,
            distortion=(-0.234, 0.10229, -0.00193, -0.00087, 1.05616),
        ),
        projector=Lens(
            width_px=640,
            height_px=360,
            fx_px=982.96,
            fy_px=982.53,
            cx_px=337.78,
            cy_px=394.87,
            distortion=(-0.02184, 0.36888, -0.00058, 0.00293, -1.50212),
        ),
        pose=Pose(
            rotation=(
                (0.99702, 0.03338, 0.06958),
                (-0.01862, 0.97903, -0.20287),
                (-0.07490, 0.20097, 0.97673),
            ),
            translation_mm=(-54.98, -20.13, 21.86),
        ),
        film=Film(),
        response=(curve(0.1, 0.2, 0.9), curve(0.1, 1.0, 0.2), curve(1.0, 0.2, 0.1)),
        emission=(curve(0, 0.05, 1), curve(0, 1, 0.1), curve(1, 0.1, 0)),
        efficiency={-1: curve(0.16, 0.09, 0.06), 0: curve(1, 1, 1), 1: curve(0.21, 0.12, 0.08)},
        white_scale=40.0,
    )
