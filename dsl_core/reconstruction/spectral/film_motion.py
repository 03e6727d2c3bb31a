"""By how much the film has moved since the calibration, from where a scan's first orders are.

A film that slips in its frame tilts, turns, bends or changes its distance: five numbers move both orders over
the whole picture, each in its own way over place and wavelength. They are fitted to all probed pixels with
the calibration as prior, together with gains and profile, which could look alike. A line spread that is not
symmetric displaces both orders alike and is granted a little of that. Numbers that are not surely off zero
stay as calibrated. Where none is, the least sure ones are left out one by one: many a slip is of one kind,
which five numbers share out among themselves. A motion is one only if it explains pixels that the fit has
not seen. The density of the film's lines stays: no motion changes it. Of a film bent as no record says, the
nearest motion is found.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray

from dsl_core.model.calibration.accepted import HELD_OUT_ORDERS
from dsl_core.model.fit import SIGMAS
from dsl_core.model.rig import Rig
from dsl_core.optics.correspondence import GratingModel
from dsl_core.optics.pixel_model import PixelModel
from dsl_core.optics.spectra import ORDERS
from dsl_core.reconstruction.spectral.causes import MOST_EXCESS, beside_curves
from dsl_core.reconstruction.spectral.probing.held_out import Hypothesis, explains_others
from dsl_core.reconstruction.spectral.probing.probe import LEADING, Probe
from dsl_core.reconstruction.spectral.probing.probe import PRIOR_STD as PARAMETER_STD
from dsl_core.reconstruction.spectral.probing.probed_light import PARAMETERS, ProbedScan

Floats = NDArray[np.float64]

#: What moves, how far (one deviation), and steps of differences.
FIELDS = ("tilt_x_deg", "tilt_y_deg", "roll_deg", "bend_per_mm", "distance_mm")
PRIOR_STD = np.array([0.3, 0.3, 0.3, 0.0005, 0.3])
STEPS = np.array([1e-2, 1e-2, 1e-2, 1e-5, 1e-2])
#: Deviations of a motion of one kind that is doubtful, and by how much less it explains pixels which its fit
#: has not seen than one that is sure: of few frames these tell too little. Frames must otherwise fit.
DOUBTFUL, LESS_FALL = 4.0, 9.0
#: By how much lines that are not symmetric may displace both orders alike, px.
LOPSIDED_PX = 0.03
#: Less displacement of the orders than this (px, root mean square) is no motion that matters, at bands of
#: `FINE_NM`. Spectra are taken as linear between bands, and what that leaves in the frames, which looks like
#: a displacement, grows with the square of their distance.
LEAST_MOTION_PX, FINE_NM = 0.02, 5.0


@dataclass(frozen=True)
class FilmMotion:
    """Changes (5,) of `FIELDS` with deviations ``std`` (5,), in their units; 0 where none is sure, or asked.

    ``shift_px`` is by how much they displace the first orders at the probed pixels, root mean square, and
    ``shift_std_px`` its deviation. A motion that is not ``sure`` does not make the frames of
    a scan fit better, or is as likely ``by_light`` that has changed its colour.
    """

    values: Floats
    std: Floats
    shift_px: float
    shift_std_px: float
    sure: bool = True
    by_light: bool = False

    def may_be_dent(self, calibrated_px: float) -> bool:
        """Whether a film whose orders lay so far (rms, px) from their places when calibrated looks so."""
        return self.shift_px < SIGMAS * calibrated_px

    def then(self, more: FilmMotion) -> FilmMotion:
        """Both motions, the second of which is small and tells how sure all is that it asked for."""
        std = np.where(more.std > 0, more.std, self.std)
        return FilmMotion(self.values + more.values, std, self.shift_px, more.shift_std_px)


def orders_off_px(rig: Rig) -> float:
    """How far first orders lay from their places (rms, px) when the film was calibrated; 0 if not noted."""
    values = [
        figure.value for note in rig.calibrations for figure in note.figures if figure.name == HELD_OUT_ORDERS
    ]
    return values[-1] if values else 0.0


def moved(model: PixelModel, motion: FilmMotion) -> PixelModel:
    """The model of a rig whose film has moved."""
    rig = with_film(model.rig, motion.values)
    kind = type(model.correspondence)
    assert issubclass(kind, GratingModel)
    return PixelModel(rig, model.bands, model.profiles, kind(rig), model.lines)


def fit_motion(scan: ProbedScan, probe: Probe) -> FilmMotion | None:
    """The motion of the film that a probe of a scan tells; None where it tells of none.

    A model without the grating equation has no film that could move.
    """
    if not probe.places or not isinstance(scan.model.correspondence, GratingModel):
        return None
    effect = _effect(scan, scan.model.correspondence, probe)
    kept, doubt = list(range(len(FIELDS))), None
    while kept:
        count = len(kept)
        moves = beside_curves(probe, *_design(effect[..., kept], PRIOR_STD[kept], probe.step_nm))
        fit = moves.sums.fit(moves.prior_std)
        found, covariance = fit.values[:count], fit.covariance[:count, :count]
        sigmas = np.abs(found) / np.sqrt(np.diag(covariance))
        # What could be chance helps no pixel, and harms those at the edge of the frame.
        sure = sigmas > SIGMAS
        if sure.all() or (sure.any() and count == len(FIELDS)):
            doubt = _motion_of(effect, probe, kept, np.where(sure, found, 0.0), covariance, moves)
            if doubt is not None and doubt.sure:
                return doubt
        del kept[int(sigmas.argmin())]
    return doubt


def _motion_of(
    effect: Floats, probe: Probe, kept: list[int], found: Floats, covariance: Floats, moves: Hypothesis
) -> FilmMotion | None:
    """The motion of the ``kept`` fields, found to be (k,); None where it is too small, or could be chance.

    What is hardly chance and explains no other pixels is not sure.
    """
    shift = effect[probe.sound][:, _SHIFT][..., kept]
    squares = (shift @ found) ** 2, np.einsum("nok,kl,nol->no", shift, covariance, shift)
    shift_px, shift_std_px = (float(np.sqrt(np.mean(square))) for square in squares)
    if shift_px < LEAST_MOTION_PX * coarseness(probe.step_nm):
        return None
    values, std = np.zeros((2, len(FIELDS)))
    values[kept], std[kept] = found, np.sqrt(np.diag(covariance))
    # Without the film, gains and profile explain a part already.
    if explains_others(moves, len(kept)):
        return FilmMotion(values, std, shift_px, shift_std_px)
    fits = probe.usual_chi_square < 1 + MOST_EXCESS and coarseness(probe.step_nm) <= 1
    alone = len(kept) == 1 and abs(found[0]) > DOUBTFUL * std[kept[0]]
    if fits and alone and explains_others(moves, 1, LESS_FALL):
        return FilmMotion(values, std, shift_px, shift_std_px, sure=False)
    return None


def coarseness(step_nm: float) -> float:
    """How many times more bands of a width displace lines than those of `FINE_NM` do.

    What a spectrum curves between the middles of two bands rises with the square of their distance.
    """
    return max(step_nm / FINE_NM, 1.0) ** 2


def _effect(scan: ProbedScan, correspondence: GratingModel, probe: Probe) -> Floats:
    """What each of `FIELDS` does to the parameters of the probe, per unit, (n, p, 5)."""
    nm = scan.model.bands.centres_nm[scan.model.bands.reported]
    ends = np.array([nm[0], (nm[0] + nm[-1]) / 2, nm[-1]])
    pixels = torch.as_tensor(probe.pixel)
    depth = torch.as_tensor(scan.pixels.depth_mm.ravel()[probe.pixel], dtype=torch.float64)
    effect = np.zeros((len(pixels), len(PARAMETERS), len(FIELDS)))
    for index, step in enumerate(np.diag(STEPS)):
        for number, order in enumerate(ORDERS):
            low, high = (
                type(correspondence)(with_film(scan.model.rig, change))
                .exact(pixels, depth, order, ends)
                .columns.numpy()
                for change in (-step, step)
            )
            first, middle, last = (high - low) / (2 * STEPS[index])
            effect[:, _SHIFT[number], index] = (first + middle + last) / 3
            effect[:, _STRETCH[number], index] = (last - first) / 2
    return np.nan_to_num(effect)


def _design(effect: Floats, prior_std: Floats, step_nm: float) -> tuple[Floats, Floats]:
    """Design (n, p, k) and prior (k,) of some of a film's numbers, and of what could look like them.

    Lines that are not symmetric displace both orders alike; bands wider than `FINE_NM`, along which spectra
    curve, to opposite sides.
    """
    count, wide_px = effect.shape[2], LEAST_MOTION_PX * (coarseness(step_nm) - 1.0)
    sides = [(1.0, 1.0), (1.0, -1.0)][: 2 if wide_px else 1]
    design = np.zeros((*effect.shape[:2], count + len(sides) + LEADING - 2))
    design[..., :count] = effect
    for column, shifts in enumerate(sides, count):
        design[:, _SHIFT, column] = shifts
    design[:, 2:LEADING, count + len(sides) :] = np.eye(LEADING - 2)
    displaced = (LOPSIDED_PX, wide_px)[: len(sides)]
    return design, np.r_[prior_std, displaced, PARAMETER_STD[2:LEADING]]


def with_film(rig: Rig, changes: Floats) -> Rig:
    """The rig with `FIELDS` of its film changed by as much (5,)."""
    now = {
        name: getattr(rig.film, name) + change for name, change in zip(FIELDS, changes.tolist(), strict=True)
    }
    return rig.model_copy(update={"film": rig.film.model_copy(update=now)})


_SHIFT = [PARAMETERS.index(name) for name in ("shift +1", "shift -1")]
_STRETCH = [PARAMETERS.index(name) for name in ("stretch +1", "stretch -1")]
