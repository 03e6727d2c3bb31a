"""A model that takes over what a scan itself says about the film: its motion, and the light of its orders.

A film that has slipped since the calibration displaces both first orders as a motion does
(`dsl_core.reconstruction.spectral.film_motion`). One that has aged or become dirty sends less light into one
order than into the other. Pixels that both orders reach, and the zero order, tell by how much; patterns
that light a pixel by several orders at once also tell how bright second orders are. What is too small to
matter, or could be chance, is left as calibrated; so is what does not make the frames fit better.
Displaced orders that no motion explains stay where they are, and deviations hold them: a scan cannot tell a
film that is bent otherwise from a line spread that is not symmetric, and the wrong correction makes spectra
worse.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from dsl_core.optics.pixel_model import PixelModel
from dsl_core.optics.spectra import ORDERS, SECOND_ORDERS
from dsl_core.reconstruction.spectral.causes import EXPLAINS, MOST_EXCESS, Causes, fit_causes
from dsl_core.reconstruction.spectral.film_motion import FilmMotion, coarseness, fit_motion, moved
from dsl_core.reconstruction.spectral.probing.probe import Probe, probe
from dsl_core.reconstruction.spectral.probing.probed_light import ProbedScan, second_share
from dsl_core.reconstruction.spectral.turned import Turn, find_turn

#: How many deviations the chi-square of pixels has to fall by.
SURELY = 3.0
#: Steps towards a film that has moved, and from which displacement of the orders (px) the first one does not
#: go all the way.
STEPS, FAR_PX = 2, 0.3
#: How far light seems displaced at most, nm, where a colour of it has changed by a factor of e against all
#: light: the slope between two colours, twice that over some 80 nm, times the variance, (20 nm)^2, of what a
#: colour of the camera sees of an LED.
LIGHT_NM = 10.0


@dataclass(frozen=True)
class Followed:
    """A model that follows a scan, and what the scan says.

    ``motion`` is that of the film, None where none was found; where it is not sure, it is not followed.
    ``balanced`` is whether the light of the orders was taken over (None: nothing asked for it). ``probe`` is
    what the scan says of the model with the film moved, ``left`` what it says of ``model``. ``turn`` is what
    of the motion may be one of camera and projector, None where there is none, or it is not sure. ``aged`` is
    whether one first order has become brighter than the other.
    """

    model: PixelModel
    probe: Probe
    left: Probe
    motion: FilmMotion | None = None
    balanced: bool | None = None
    turn: Turn | None = None
    aged: bool = False

    @property
    def has_changed(self) -> bool:
        """Whether the film seems to have moved, or one order to have become brighter, since calibrated."""
        return self.motion is not None or (bool(self.balanced) and self.aged)


def follow(
    scan: ProbedScan,
    as_calibrated: bool = False,
    rows_px: float | None = None,
    colour_changed: float = 0.0,
) -> Followed | None:
    """The model of a scan with what the scan shows of the film taken over; None where it shows nothing.

    With ``as_calibrated`` the model stays as it is. ``rows_px`` is as for `find_turn`.
    Light that changed its colour on the way, by ``colour_changed`` (log), displaces the orders a little, as a
    film does: then no motion is sure that is not larger.
    """
    found = probe(scan)
    if found is None or as_calibrated:
        return None if found is None else Followed(scan.model, found, found)
    model, motion, doubt = scan.model, None, None
    for _ in range(STEPS):
        more = fit_motion(replace(scan, model=model), found)
        if more is None:
            break
        there = moved(model, more)
        after = probe(replace(scan, model=there))
        by_light = motion is None and more.shift_px * found.nm_per_px < LIGHT_NM * colour_changed
        if after is None or not more.sure or by_light or not fits_better(found, after):
            # Spectra that curve along wide bands displace the orders as well; and what displaces one order
            # where there is no other can be more than a film.
            if motion is None and coarseness(found.step_nm) <= 1 and found.seen_orders.all():
                motion, doubt = replace(more, sure=False, by_light=by_light), (there, after)
            break
        model, found = there, after
        motion = more if motion is None else motion.then(more)
        if more.shift_px < FAR_PX:
            break
    turn = None
    if motion is not None:
        film, of_film = doubt or (model, found)
        turn = None if of_film is None else find_turn(scan, motion, of_film, film, probe, rows_px, found)
    causes = fit_causes(found)
    balanced = corrected(model, causes)
    if balanced is None:
        return Followed(model, found, found, motion, turn=turn)
    left = _tried(replace(scan, model=balanced), found)
    if left is None:
        return Followed(model, found, found, motion, balanced=False, turn=turn)
    return Followed(balanced, found, left, motion, balanced=True, turn=turn, aged=causes.unequal)


def _tried(scan: ProbedScan, before: Probe) -> Probe | None:
    """The probe of a scan with another model, None where its frames do not fit that better."""
    after = probe(scan)
    return after if after is not None and fits_better(before, after) else None


def corrected(model: PixelModel, causes: Causes) -> PixelModel | None:
    """The model with orders as bright as the scan says, where that matters; None where it does not."""
    gains = dict[int, float]()
    if causes.unequal:
        own = causes.gain - causes.common_gain
        gains |= {order: 1 + float(gain) for order, gain in zip(ORDERS, own, strict=True)}
    if causes.seconds_differ:
        more = max(causes.second[0] / second_share(model), -1.0)
        gains |= dict.fromkeys(SECOND_ORDERS, 1 + more)
    if not gains:
        return None
    moments = {order: values * gains.get(order, 1.0) for order, values in model.bands.moments.items()}
    bands = replace(model.bands, moments=moments)
    return PixelModel(model.rig, bands, model.profiles, model.correspondence, model.lines)


def fits_better(before: Probe, after: Probe) -> bool:
    """Whether the frames of the pixels in both probes fit the second model better, not by chance.

    Where they lack much, it has to explain a share of that: surfaces finer than pixels ask for a film that
    has moved as well, which explains little.
    """
    both = before.sound & after.sound
    fall = (before.chi_square - after.chi_square)[both]
    if both.sum() < 2 or fall.mean() <= SURELY * fall.std() / np.sqrt(both.sum()):
        return False
    first, second = (float(np.median(each.chi_square[both])) for each in (before, after))
    return first - 1 < MOST_EXCESS or first - second > EXPLAINS * (first - 1)
