"""What a plan really reaches: scanned with the twin in a few small pieces of its picture, and compared.

Each piece shows a small chart at full magnification, so that noise, blur and normals are those of the whole
picture at a hundredth of its cost. Patterns that are not a few lines are rendered in fine slices.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from dsl_core import pipeline
from dsl_core.capture.runner import Runner
from dsl_core.evaluation.summary import Evaluation, Truth, interior
from dsl_core.model.plan import CapturePlan
from dsl_core.model.rig import Rig
from dsl_core.model.spectral import SpectralCurve, WavelengthGrid
from dsl_core.patterns.images import pattern_image
from dsl_core.planning.references import FINE_NM, References
from dsl_core.planning.samples import SamplePixels, _of_plane
from dsl_core.reconstruction.surface import default_window_px
from dsl_core.simulation.rendered_scene import Setup
from dsl_core.simulation.scenes import materials
from dsl_core.simulation.scenes.flat import patch_grid
from dsl_core.simulation.scenes.surfaces import ENDLESS, tilted
from dsl_core.simulation.scenes.truth import Materials, Scene
from dsl_core.simulation.sim_devices import assemble
from dsl_core.simulation.world import World
from tests.cases.memory_sink import MemorySink

#: Pixels of a patch across and down, patches of a piece, and its grey rim, where demosaicing lacks pixels.
PATCH_PX, PATCHES, RIM_PX = 10, (6, 4), 4
#: Width and height of a piece, px.
PIECE_PX = (PATCH_PX * PATCHES[0] + 2 * RIM_PX, PATCH_PX * PATCHES[1] + 2 * RIM_PX)
#: Middles of the pieces, as shares of the picture: where +1 reaches all bands, and where both orders meet.
PLACES = ((0.14, 0.5), (0.6, 0.5))
#: Lets all light pass; with a filter in front of the camera the twin renders any pattern in fine slices.
CLEAR = SpectralCurve.of([390.0, 710.0], [1.0, 1.0])


class Palette(Protocol):
    """What a trial looks at."""

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the spectra."""

    @property
    def spectra(self) -> NDArray[np.float64]:
        """Reflectance over 400 to 700 nm in steps of 1, (spectra, 301)."""


@dataclass(frozen=True)
class Trial:
    """Figures over the pieces of one plan; ``fwhm_nm`` is None where no truth is a narrow peak.

    ``rmse``, ``angle_rad`` and ``delta_e`` are of patch means and are averaged over patches; ``pixel_*`` are
    of single pixels, ``pixel_rmse`` the root of the mean square over all of them; ``cpu_s`` are those of the
    reconstruction on one core, ``pixels`` those of all pieces.
    """

    rmse: float
    pixel_rmse: float
    angle_rad: float
    pixel_angle_rad: float
    delta_e: float
    fwhm_nm: float | None
    depth_rmse_mm: float
    depth_coverage: float
    cpu_s: float
    pixels: int


def window_rig(rig: Rig, place: tuple[float, float]) -> Rig:
    """The rig with a camera that reads only one piece; even corners keep the phase of the mosaic."""
    width, height = PIECE_PX
    left, top = (
        int(np.clip(share * size - piece / 2, 0, size - piece)) // 2 * 2
        for share, size, piece in zip(
            place, (rig.camera.width_px, rig.camera.height_px), (width, height), strict=True
        )
    )
    camera = rig.camera.model_copy(
        update={
            "cx_px": rig.camera.cx_px - left,
            "cy_px": rig.camera.cy_px - top,
            "width_px": width,
            "height_px": height,
        }
    )
    return rig.model_copy(update={"camera": camera})


def chart_scene(rig: Rig, palette: Palette, depth_mm: float) -> Scene:
    """A chart that fills the picture of a piece; patches repeat where the palette has fewer."""
    lens = rig.camera
    middle = (lens.width_px - 1) / 2 - lens.cx_px, (lens.height_px - 1) / 2 - lens.cy_px
    centre = (middle[0] / lens.fx_px * depth_mm, middle[1] / lens.fy_px * depth_mm, depth_mm)
    pitch = PATCH_PX * depth_mm / lens.fx_px
    count, places = len(palette.names), PATCHES[0] * PATCHES[1]
    grid = patch_grid(PATCHES[0], PATCHES[1], pitch, pitch, places)

    def paint(u: NDArray[np.float64], v: NDArray[np.float64]) -> NDArray[np.int32]:
        found = grid(u, v)
        return np.where(found == places, count, found % count).astype(np.int32)

    named = dict(zip(palette.names, palette.spectra, strict=True))
    colours = Materials.of({**named, "rim": materials.flat(0.5)}, ("rim",))
    return Scene("chart", "a small chart", (tilted(centre, 0.0, 0.0, ENDLESS, paint),), colours)


def trial_samples(rig: Rig, palette: Palette, depth_mm: float = 700.0) -> SamplePixels:
    """Pixels that trials take their figures from, with the spectra of their patches.

    Half of the inside of each patch, from all of its columns. Coarse patterns leave a few columns of the
    picture badly off, and a figure hangs on what these show.
    """
    pixels, spectra = [], []
    for place in PLACES:
        piece = window_rig(rig, place)
        truth = chart_scene(piece, palette, depth_mm).render(piece.camera, piece.pose.projector_centre_mm)
        left, top = round(rig.camera.cx_px - piece.camera.cx_px), round(rig.camera.cy_px - piece.camera.cy_px)
        inside = interior(truth.material) & (truth.material < len(palette.names))
        for material in np.unique(truth.material[inside]):
            for y, x in _two_a_column(np.argwhere(inside & (truth.material == material))):
                pixels.append((top + y) * rig.camera.width_px + left + x)
                spectra.append(palette.spectra[material])
    view = _of_plane(rig, depth_mm, np.array(pixels, np.int64), 1.0)
    return replace(view, spectra=np.array(spectra), wavelengths_nm=FINE_NM)


def _two_a_column(found: NDArray[np.int64]) -> list[tuple[int, int]]:
    """Two of some pixels (row, column) from each column, in rows that take turns."""
    chosen = []
    for i, x in enumerate(np.unique(found[:, 1])):
        rows = found[found[:, 1] == x, 0]
        chosen += [(int(row), int(x)) for row in rows[i % 2 :: 2]]
    return chosen


def run_trial(
    rig: Rig,
    plan: CapturePlan,
    palette: References,
    *,
    depth_mm: float = 700.0,
    options: pipeline.Options | None = None,
    seed: int = 0,
    places: tuple[tuple[float, float], ...] = PLACES,
) -> Trial:
    """Scan and evaluate every piece. Raises `DecodeError` where nothing can be reconstructed."""
    options = options or pipeline.Options()
    window = options.surface_window_px or default_window_px(rig)
    spent_s = 0.0
    found = []
    for place in places:
        piece = window_rig(rig, place)
        sink, truth = scan_piece(piece, plan, palette, depth_mm, options.grid, seed)
        chosen = replace(options, surface_window_px=window)
        start_s = time.process_time()
        result = pipeline.reconstruct(sink, piece, chosen)
        spent_s += time.process_time() - start_s
        if options.solver != "best":
            result = result.drop_vars(["reflectance_std", "data_share"])  # the others state none
        found.append(pipeline.evaluate(result, truth))
    return _combined(found, spent_s, len(places) * PIECE_PX[0] * PIECE_PX[1])


def scan_piece(
    piece: Rig, plan: CapturePlan, palette: Palette, depth_mm: float, grid: WavelengthGrid, seed: int
) -> tuple[MemorySink, Truth]:
    """A finished scan of a piece in memory, and its truth."""
    world = World(Setup(piece), scene_at=lambda position_mm: chart_scene(piece, palette, depth_mm), seed=seed)
    world.insert(True, CLEAR)
    devices = assemble(world)
    sink = MemorySink(pipeline.fit_plan(plan, devices))
    Runner(devices, sink.plan, sink, pattern_image).run()
    seen = world.truth
    spectra = seen.materials.at(grid.centres_nm)
    truth = Truth(
        seen.depth_mm, seen.lit, seen.material, seen.materials.names, spectra, seen.materials.targets
    )
    return sink, truth


def _combined(found: list[Evaluation], cpu_s: float, pixels: int) -> Trial:
    widths = [each.mean_fwhm_nm for each in found if each.mean_fwhm_nm is not None]
    depths = [each.depth for each in found if each.depth is not None]

    def mean(figure: str) -> float:
        return float(np.mean([each.mean(figure) for each in found]))

    squares = [patch.pixel_rmse**2 for each in found for patch in each.patches]

    return Trial(
        rmse=mean("rmse"),
        pixel_rmse=float(np.sqrt(np.mean(squares))),
        angle_rad=mean("angle_rad"),
        pixel_angle_rad=mean("pixel_angle_rad"),
        delta_e=mean("delta_e"),
        fwhm_nm=float(np.mean(widths)) if widths else None,
        depth_rmse_mm=float(np.sqrt(np.mean([depth.rmse_mm**2 for depth in depths]))),
        depth_coverage=float(np.mean([depth.coverage for depth in depths])),
        cpu_s=cpu_s,
        pixels=pixels,
    )
