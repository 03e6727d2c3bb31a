"""Whether camera and projector have moved against each other, where first orders look as if the film had.

Both displace first orders much alike: depth follows the pose, and how far light is dispersed follows depth
as it follows the film's distance. A film that moves leaves depth as it is, a camera that turns does not. So
the pose that puts first orders where a moved film puts them is fitted, and the frames of pixels say which of
both they fit better, as do rows that the code names. Where nothing says, depth is as unsure as the pose would
make it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace

import numpy as np
import torch
from numpy.typing import NDArray

from dsl_core.model.geometry import Pose
from dsl_core.model.rig import Rig
from dsl_core.optics.correspondence import GratingModel, triangulate, zero_order
from dsl_core.optics.pixel_model import PixelModel
from dsl_core.optics.spectra import ORDERS
from dsl_core.reconstruction.geometry import Geometry
from dsl_core.reconstruction.spectral.film_motion import PRIOR_STD as FILM_STD
from dsl_core.reconstruction.spectral.film_motion import FilmMotion, orders_off_px
from dsl_core.reconstruction.spectral.probing.probe import Probe, probed_pixels
from dsl_core.reconstruction.spectral.probing.probed_light import ProbedScan

Floats = NDArray[np.float64]

#: What changes: the camera's turns about its axes, degrees, and its place across, mm; one deviation of each,
#: and steps of differences.
PRIOR_STD = np.array([0.1, 0.1, 0.1, 1.0])
STEPS = np.array([1e-2, 1e-2, 1e-2, 1e-1])
#: Rounds of the fit to columns of the first orders, and their deviation, px.
ROUNDS, COLUMN_STD_PX = 8, 0.01
#: By how many deviations frames must fit one better than the other.
SURELY = 3.0
#: A film that would have moved by more deviations than this of `film_motion.PRIOR_STD` is another rig's,
#: unless its calibration left first orders displaced nearly as far: a dent looks like any motion.
IMPLAUSIBLE = 4.0
#: Rows that the pose would displace by more than this (px, rms) tell of it: those of a changed pose are seen
#: displaced by at least this share.
TELLING_ROWS_PX, ROWS_SEEN = 0.1, 0.5
#: Share of the error of depth that its deviation holds where film and pose explain frames alike: 95 % bands
#: then hold the depth of either, with room for what the displacement itself is unsure of.
EITHER = 0.7
#: What pixels are unsure of besides their own share, relative to the rms over the picture: a pose fitted to
#: columns is not known everywhere.
ELSEWHERE = 0.3


@dataclass(frozen=True)
class Turn:
    """The pose that explains displaced first orders in the place of the film's motion.

    ``rig`` has that pose; ``believed`` is the share of its error of depth that deviations hold: 0 where
    frames fit a moved film better, about 1 where they fit the pose better or no film can have moved so far:
    then it is told ``instead`` of the film's motion. ``depth_share`` is that error relative to depth, rms
    over the probed pixels.
    """

    rig: Rig
    believed: float
    instead: bool
    depth_share: float

    @property
    def level_rel_std(self) -> float:
        """Deviation of all reflectance: light falls with the square of the distance."""
        return 2 * self.believed * self.depth_share

    def doubted(self, geometry: Geometry, window_px: int | None = None) -> Geometry:
        """Geometry whose deviations of depth hold what the pose may have changed it by."""
        there = geometry.by(self.rig, np.zeros_like(geometry.column_std_px), window_px).depth_mm
        off = np.abs(there - geometry.depth_mm)
        usual = float(np.sqrt(np.nanmean(off**2)))
        unsure = self.believed * np.hypot(np.nan_to_num(off, nan=usual), ELSEWHERE * usual)
        return replace(geometry, depth_std_mm=np.hypot(geometry.depth_std_mm, unsure))


def find_turn(
    scan: ProbedScan,
    motion: FilmMotion,
    of_film: Probe,
    moved: PixelModel,
    probe: Callable[[ProbedScan], Probe | None],
    rows_px: float | None = None,
    now: Probe | None = None,
) -> Turn | None:
    """What of a film's ``motion`` may be a changed pose; None where models know of neither, or it is not.

    ``scan`` has the model as calibrated, ``of_film`` is what a ``probe`` says with the film ``moved``, and
    ``now`` with the film where it is taken to be, None where that is the same.
    ``rows_px`` is how far (rms) rows lie from where a code names them, None where it names none.
    """
    if not isinstance(scan.model.correspondence, GratingModel):
        return None
    assert isinstance(moved.correspondence, GratingModel)
    rig = with_pose(scan.model.rig, _fit(scan, moved.correspondence, of_film))
    there = _with_rig(scan, rig)
    if rows_px is not None and _refuted(scan, there, of_film, rows_px):
        return None
    asked = np.flatnonzero(np.isfinite(there.pixels.depth_mm))
    share = there.pixels.depth_mm.ravel()[asked] / scan.pixels.depth_mm.ravel()[asked] - 1
    depth_share = float(np.sqrt(np.mean(share**2))) if asked.size else 0.0
    of_pose = probe(there)
    belief = _belief(
        motion, _surer((of_film, now or of_film), of_pose), motion.may_be_dent(orders_off_px(rig))
    )
    return Turn(rig, *belief, depth_share)


def _belief(motion: FilmMotion, surer: float, dented: bool = False) -> tuple[float, bool]:
    """Share of the pose's error that deviations hold, and whether it is told instead of the film's motion.

    ``surer`` is by how many deviations frames fit the pose better than the ``motion``; ``dented`` is whether
    what the calibration could not record of the film's shape may look like that.
    """
    far = bool((np.abs(motion.values) > IMPLAUSIBLE * FILM_STD).any())
    # How far orders are displaced, and with them depth, is not known exactly either.
    unsure = min(motion.shift_std_px / max(motion.shift_px, 1e-12), 1.0)
    if surer > SURELY or (far and not dented):
        return float(np.hypot(1.0, unsure)), True
    return 0.0 if surer < -SURELY else float(np.hypot(EITHER, unsure)), False


def with_pose(rig: Rig, changes: Floats) -> Rig:
    """The rig whose camera has turned by three angles (degrees) and moved across (mm), (4,)."""
    from scipy.spatial.transform import Rotation

    turn = Rotation.from_rotvec(changes[:3], degrees=True).as_matrix()
    rotation = rig.pose.matrix @ turn
    translation = rig.pose.vector_mm + rotation @ [changes[3], 0.0, 0.0]
    pose = Pose.model_validate({"rotation": rotation.tolist(), "translation_mm": translation.tolist()})
    return rig.model_copy(update={"pose": pose})


def _fit(scan: ProbedScan, moved: GratingModel, of_film: Probe) -> Floats:
    """Changes of the pose (4,) that put first orders where a moved film puts them."""
    pixels = torch.as_tensor(of_film.pixel[of_film.sound])
    column = torch.as_tensor(scan.pixels.column_px.ravel()[pixels.numpy()], dtype=torch.float64)
    depth = torch.as_tensor(scan.pixels.depth_mm.ravel()[pixels.numpy()], dtype=torch.float64)
    nm = scan.model.bands.centres_nm[scan.model.bands.reported][[0, -1]]
    kind = type(scan.model.correspondence)
    assert issubclass(kind, GratingModel)
    wanted = _columns(moved, pixels, depth, nm)[of_film.seen_orders]
    width = scan.model.rig.projector.width_px
    shown = (wanted > 0) & (wanted < width - 1)

    def left(changes: Floats) -> Floats:
        rig = with_pose(scan.model.rig, changes)
        here = _columns(kind(rig), pixels, triangulate(rig, pixels, column)[0], nm)
        return np.asarray(wanted - here[of_film.seen_orders])

    changes = np.zeros(len(STEPS))
    for _ in range(ROUNDS):
        now = left(changes)
        slopes = np.stack([(now - left(changes + step)) / step.sum() for step in np.diag(STEPS)], -1)
        known = shown & np.isfinite(now) & np.isfinite(slopes).all(-1)
        if not known.any():
            break
        some = slopes[known] / COLUMN_STD_PX
        normal = some.T @ some + np.diag(PRIOR_STD**-2.0)
        changes += np.linalg.solve(normal, some.T @ now[known] / COLUMN_STD_PX - changes / PRIOR_STD**2)
    return changes


def _columns(model: GratingModel, pixels: torch.Tensor, depth: torch.Tensor, nm: Floats) -> Floats:
    """Columns of both first orders at wavelengths, (orders, wavelengths, n)."""
    return np.stack([model.exact(pixels, depth, order, nm).columns.numpy() for order in ORDERS])


def _with_rig(scan: ProbedScan, rig: Rig) -> ProbedScan:
    """The scan by another pose, at the probed pixels: NaN elsewhere."""
    model, pixels = scan.model, scan.pixels
    kind = type(model.correspondence)
    assert issubclass(kind, GratingModel)
    asked = probed_pixels(pixels.valid, rig.sensor.bayer)
    depth = np.full(pixels.depth_mm.shape, np.nan, np.float32)
    column = torch.as_tensor(pixels.column_px.ravel()[asked], dtype=torch.float64)
    depth.ravel()[asked] = triangulate(rig, torch.as_tensor(asked), column)[0].numpy()
    turned = PixelModel(rig, model.bands, model.profiles, kind(rig), model.lines)
    return replace(scan, model=turned, pixels=replace(pixels, depth_mm=depth))


def _refuted(scan: ProbedScan, there: ProbedScan, of_film: Probe, rows_px: float) -> bool:
    """Whether a pose would displace rows of the projector, which are hardly seen displaced."""
    pixels = torch.as_tensor(of_film.pixel)
    here, turned = (
        zero_order(each.model.rig, pixels, torch.as_tensor(each.pixels.depth_mm.ravel()[of_film.pixel]))[1]
        for each in (scan, there)
    )
    expected_px = float(np.sqrt(np.nanmean(((turned - here) ** 2).numpy())))
    return expected_px > TELLING_ROWS_PX and rows_px < ROWS_SEEN * expected_px


def _surer(others: Iterable[Probe], of_pose: Probe | None) -> float:
    """By how many deviations frames of pixels fit a changed pose better than any of the ``others``.

    A moved film that fits worse than the calibrated one makes no pose better than that.
    """
    return 0.0 if of_pose is None else min(_better(each, of_pose) for each in others)


def _better(before: Probe, after: Probe) -> float:
    """By how many deviations frames of pixels fit better after than before."""
    both = before.sound & after.sound
    fall = (before.chi_square - after.chi_square)[both]
    scatter = float(fall.std()) / max(float(both.sum()) ** 0.5, 1.0)
    return float(fall.mean()) / scatter if both.sum() > 1 and scatter > 0 else 0.0
