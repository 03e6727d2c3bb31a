"""First-order light of any pattern, summed over slices of the spectrum."""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor

from dsl_core.optics.correspondence import chebyshev_nodes, interpolation_matrix, like
from dsl_core.simulation.order_tables import OrderTables
from dsl_core.simulation.pattern_table import PatternTable
from dsl_core.simulation.spectral_tables import NM, Slicing


def order_light(
    tables: OrderTables,
    table: PatternTable,
    led: int,
    of_led: slice,
    material_channel: Tensor,
    slicing: Slicing,
) -> Tensor:
    """Light of an order on its active pixels, (A,), for one of the pattern's LEDs.

    ``of_led`` are the LEDs of the projector that show it.
    """
    step = slicing.rows_nm if table.has_rows else slicing.nm
    weights = tables.spectra.slices[step][:, of_led].sum(1)
    nodes = chebyshev_nodes(NM[0], NM[-1])
    edges = np.arange(NM[0], NM[-1] + 1, step)
    centres = 0.5 * (edges[1:] + edges[:-1])
    to_edges = like(interpolation_matrix(nodes, edges), tables.middle_px)
    to_centres = like(interpolation_matrix(nodes, centres), tables.middle_px)
    material = material_channel[tables.active]
    total = torch.zeros_like(tables.middle_px)
    strongest = weights.amax(1)
    used = torch.nonzero(strongest >= slicing.floor * strongest.max()).ravel().tolist()
    low, high = float(tables.limits_nm[0].max()), float(tables.limits_nm[1].min())
    stop, last = None, -2
    for i in used:
        start = stop if stop is not None and last == i - 1 else to_edges[i] @ tables.node_columns
        stop, last = to_edges[i + 1] @ tables.node_columns, i
        row = to_centres[i] @ tables.node_rows if table.has_rows else None
        mean = table.mean_between(led, start, stop, row)
        nm = float(centres[i])
        if not low <= nm <= high:
            mean *= (tables.limits_nm[0] <= nm) & (tables.limits_nm[1] >= nm)
        total.addcmul_(mean, weights[i][material])
    return total
