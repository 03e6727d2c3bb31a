"""Maps over the camera image of what a calibrated rig holds: evenness, and what the grating leaves over."""

from __future__ import annotations

import numpy as np

from dsl_core.evaluation.report.pictures import Picture, value_picture
from dsl_core.model.rig import Rig

#: Where the residual is drawn: the middle of the bands, and at most this many pixels across.
MIDDLE_NM, MAP_PX = 545.0, 240


def rig_maps(rig: Rig) -> list[Picture]:
    """The flat field, and the residual of each order at 545 nm and middle depth; none for a rig without."""
    pictures = []
    if rig.flat_field is not None:
        from dsl_core.optics.flat_field import relative_gain

        caption = "relative gain of the camera over its image"
        pictures.append(value_picture(relative_gain(rig), "Flat field", caption, ""))
    return pictures + _residuals(rig)


def _residuals(rig: Rig) -> list[Picture]:
    import torch

    from dsl_core.optics.column_residual import residual_columns

    residual = rig.residual
    if residual is None:
        return []
    step = -(-rig.camera.width_px // MAP_PX)
    rows, columns = np.mgrid[0 : rig.camera.height_px : step, 0 : rig.camera.width_px : step].astype(float)
    middle_mm = 2 / sum(1 / z for z in residual.depth_range_mm)
    camera_px = torch.as_tensor(columns.ravel()), torch.as_tensor(rows.ravel())
    depth_mm = torch.full((rows.size,), middle_mm, dtype=torch.float64)
    wavelength_nm = torch.tensor([MIDDLE_NM], dtype=torch.float64)
    pictures = []
    for order in residual.orders:
        found = residual_columns(residual, camera_px, depth_mm, order, wavelength_nm)
        if found is not None:
            pictures.append(
                value_picture(
                    found.reshape(rows.shape).numpy(),
                    f"Residual of order {order:+d}",
                    f"columns beyond the grating equation at {MIDDLE_NM:g} nm and {middle_mm:.0f} mm",
                    "px",
                    "RdBu_r",
                    symmetric=True,
                )
            )
    return pictures
