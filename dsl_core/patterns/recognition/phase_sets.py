"""Which pictures are steps of shifted sinusoids, how many periods each set has, and where they begin."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import islice, pairwise
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from dsl_core.model.captured_code import Phases
from dsl_core.patterns.phases import TURN, read_phases
from dsl_core.patterns.recognition.probes import Lines

#: Steps of a set that are looked for.
STEPS = range(3, 17)
#: Amplitude (of 0.5) of a sinusoid, and how much it and the mean may vary over a picture.
LEAST_AMPLITUDE, AMPLITUDE_SPREAD, MEAN_SPREAD = 0.08, 0.25, 0.1
#: A run of neighbours over which phases are followed, px.
LEAST_RUN = 20
#: Noise of the change of a phase from pixel to pixel, turns.
LEAST_CHANGE = 0.04
#: Pictures that turn less than this along the lines show no position, as white, black and dark together do.
LEAST_TURNS = 0.05
#: Turns of a set that may still be one fringe over the whole projector.
ONE_FRINGE = 1.05
#: Most fringes of a set that are tried, and how far from a whole number they may be, of all and at least.
MOST_FRINGES, OFF_SHARE, OFF = 256, 0.0025, 0.03
#: Positions are compared on a projector of this many columns, at so many pixels, for so many guesses.
VIRTUAL_PX, SAMPLES, MOST_GUESSES = 1024, 500, 12
#: Phases that disagree by this much (rms) show no one position, rad.
MOST_OFF_RAD = 0.35
#: Where sinusoids start, as they are or counted from another of their steps.
STARTS_DEG = (0.0, -90.0, 90.0, 180.0)
#: Readings are compared by their share of what chance gives; those little above the best's fit as well.
AS_GOOD, AS_GOOD_SHARE = 1.15, 0.04
#: Of so many pixels one is enough to leave out readings whose share is this much larger.
FEW, FEW_AS_GOOD, FEW_AS_GOOD_SHARE = 8, 1.6, 0.2
#: A position that jumps within a surface is followed over this share of a line; so many pixels may.
FOLLOWED_SHARE, MOST_JUMPS = 0.03, 0.01
Complex = NDArray[np.complex64]
#: Error as a share of chance's, sum of all fringes, place among the starts, the fringes, and the start, deg.
_Tried = tuple[float, float, int, tuple[float, ...], float]


@dataclass(frozen=True)
class PhaseReading:
    """Sets of ``steps`` pictures each and their fringes.

    ``off_rad`` is by how much phases disagree (rms), ``chance_rad`` by how much those of unrelated pixels do,
    and ``rival_rad`` is what the best other reading would have with the same chance.
    """

    steps: int
    order: Literal["set", "step"]
    fringes: tuple[float, ...]
    start_deg: float
    direction: Literal[1, -1]
    off_rad: float
    rival_rad: float
    chance_rad: float = np.pi


def is_sinusoid(lines: Lines, pictures: Sequence[int]) -> float | None:
    """How far pictures are from equal steps of one sinusoid, 0 for perfect; None when they are none."""
    values = lines.some(pictures)
    if not values.size:
        return None
    mean, first = values.mean(0), _harmonic(values)
    amplitude = np.abs(first) * 2
    middle = float(np.median(amplitude))
    if middle < LEAST_AMPLITUDE:
        return None
    spread = float(np.subtract(*np.percentile(amplitude, (84, 16)))) / 2 / middle
    drift = float(np.subtract(*np.percentile(mean, (84, 16)))) / 2
    if spread > AMPLITUDE_SPREAD or drift > MEAN_SPREAD:
        return None
    return spread + drift


def sinusoid_runs(lines: Lines, pictures: Sequence[int]) -> list[tuple[int, int, int]]:
    """Steps, start and end of the longest run of whole sets for each number of steps, the longest first.

    Stripes beside sinusoids may lengthen a run of another number of steps, so that the longest is not always
    the right one.
    """
    best: dict[int, tuple[int, float, int, int]] = {}
    for steps in STEPS:
        for start in range(max(len(pictures) - steps + 1, 0)):
            end, off = start, 0.0
            while end + steps <= len(pictures):
                found = is_sinusoid(lines, pictures[end : end + steps])
                if found is None:
                    break
                end, off = end + steps, off + found
            if end > start:
                rank = (start - end, off * steps / (end - start), start, end)
                best[steps] = min(rank, best.get(steps, rank))
    return [(steps, *rank[2:]) for steps, rank in sorted(best.items(), key=lambda each: each[1][:2])]


def steps_of_strided(lines: Lines, pictures: Sequence[int]) -> int | None:
    """Steps of sets whose first steps come first, then all second steps and so on; None when it is not so."""
    ranked = []
    for steps in STEPS:
        sets = len(pictures) // steps
        if sets < 2 or len(pictures) % steps:
            continue
        found = [is_sinusoid(lines, pictures[k::sets]) for k in range(sets)]
        if None not in found:
            ranked.append((sum(f for f in found if f is not None), steps))
    return min(ranked)[1] if ranked else None


def read_phase_sets(
    lines: Lines, pictures: Sequence[int], steps: int, order: Literal["set", "step"]
) -> PhaseReading | None:
    """Fringes, start and direction of sets of pictures; None when they fit no whole fringes.

    A single set of several fringes has 0 of them: only stripes tell how many.
    """
    sets = len(pictures) // steps
    chosen = [
        pictures[k::sets] if order == "step" else pictures[k * steps : (k + 1) * steps] for k in range(sets)
    ]
    waves = [_wave(lines, each) for each in chosen]
    turns = _turns(waves, lines.pairs)
    if turns is None:
        return None
    # Columns are taken to rise along the lines; stripes beside them, or whoever sees a mirror image, say so.
    direction: Literal[1, -1] = 1 if turns[int(np.argmax(np.abs(turns)))] > 0 else -1
    if sets == 1:
        whole = 1.0 if abs(turns[0]) < ONE_FRINGE else 0.0
        return PhaseReading(steps, order, (whole,), 0.0, direction, 0.0, np.pi)
    ranked, chance = _ranked(_samples(waves, lines.lit), np.abs(turns), steps, direction)
    if not ranked or ranked[0][0] * chance[ranked[0][3]] > MOST_OFF_RAD:
        return None
    best, _, _, fringes, _ = ranked[0]
    as_good = [each for each in ranked if each[0] <= AS_GOOD * best + AS_GOOD_SHARE]
    coarse = int(np.argmin(fringes))
    if fringes[coarse] == 1 and len(as_good) > 1:
        # One fringe over the projector: where it begins again, the picture of the projector ends.
        wave = waves[coarse]
        steady = [each for each in as_good if _jumps(wave, lines.lit, each[4], direction) < MOST_JUMPS]
        if steady:
            as_good, ranked = steady, [*steady, *(each for each in ranked if each not in as_good)]
    share, _, _, fringes, start = min(as_good, key=lambda each: (each[1], each[2]))
    most = chance[fringes]
    # Multiples of the fringes fit in any case, and are another question.
    ratios = {each[3]: np.divide(each[3], fringes) for each in ranked}
    others = (each for each in ranked if each[4] != start or np.ptp(ratios[each[3]]) > 1e-9)
    rival = min((each[0] for each in others), default=np.pi / most)
    return PhaseReading(steps, order, fringes, start, direction, share * most, rival * most, most)


def turn_nowhere(lines: Lines, pictures: Sequence[int]) -> bool:
    """Whether steps of what passes for a sinusoid are the same all along the lines."""
    turns = _turns([_wave(lines, pictures)], lines.pairs)
    return turns is not None and abs(float(turns[0])) < LEAST_TURNS


def _ranked(
    samples: Complex, turns: NDArray[np.float64], steps: int, direction: Literal[1, -1]
) -> tuple[list[_Tried], dict[tuple[float, ...], float]]:
    """Fringes and starts that may be those of samples (sets, pixels), the best first, and chance's errors.

    Many fringes fit anything: an error (rad) is a share of what the same fringes make of unrelated pixels.
    ``turns`` (sets,) are those seen along the lines.
    """
    guesses = list(dict.fromkeys(islice(_fringes(turns), MOST_GUESSES)))
    mixed = _by_chance(samples, int(np.argmax(turns)))
    chance = {fringes: max(_off(mixed, fringes, 0.0, steps, direction), 1e-3) for fringes in guesses}
    tried = [
        (sum(fringes), k, fringes, start) for fringes in guesses for k, start in enumerate(_starts(steps))
    ]
    # A few pixels tell what is far off.
    few = [_off(samples[:, ::FEW], *each[2:], steps, direction) / chance[each[2]] for each in tried]
    near = FEW_AS_GOOD * min(few, default=0.0) + FEW_AS_GOOD_SHARE
    ranked = sorted(
        (_off(samples, *each[2:], steps, direction) / chance[each[2]] if share <= near else share, *each)
        for share, each in zip(few, tried, strict=True)
    )
    return ranked, chance


def _by_chance(samples: Complex, kept: int) -> Complex:
    """Samples (sets, pixels) of which each set but one comes from other pixels than the rest."""
    rng = np.random.default_rng(0)
    mixed = [each if k == kept else rng.permutation(each) for k, each in enumerate(samples)]
    return np.asarray(mixed, np.complex64)


def _starts(steps: int) -> tuple[float, ...]:
    """Starts that are tried, degrees, the commonest first.

    >>> _starts(3)[:6]
    (0.0, -90.0, 90.0, 180.0, -120.0, 120.0)
    """
    turns = sorted(range(1, steps), key=lambda k: (min(k, steps - k), -k))
    counted = [360.0 * k / steps + start for start in STARTS_DEG for k in turns]
    own = [each - 360.0 * np.ceil((each - 180.0) / 360.0) for each in counted]
    return tuple(dict.fromkeys(round(float(each), 6) for each in (*STARTS_DEG, *own)))


def _jumps(wave: Complex, lit: NDArray[np.bool_], start_deg: float, direction: Literal[1, -1]) -> float:
    """Share of the lit pixels from which a position of one fringe begins again a little further on."""
    turns = np.mod((np.angle(wave) * direction - np.deg2rad(start_deg)) / TURN, 1.0)
    far = max(int(FOLLOWED_SHARE * turns.shape[1]), 1)
    both = lit[:, far:] & lit[:, :-far]
    change = turns[:, far:] - turns[:, :-far]
    return float((np.abs(change[both]) > 0.5).mean()) if both.any() else 0.0


def turns_per_number(
    lines: Lines, pictures: Sequence[int], direction: Literal[1, -1], number: NDArray[np.int32]
) -> tuple[float, float]:
    """Periods of a sinusoid in one stripe, a power of two, and its start in degrees (of a quarter turn).

    ``number`` (lines, length) is what stripes say, ``direction`` that of the phase where numbers rise, which
    they need not do along the lines.
    """
    phase = np.angle(_wave(lines, pictures)) * direction
    change = np.angle(np.exp(1j * np.diff(phase, axis=-1))) / TURN
    step = np.diff(number, axis=-1)
    near = lines.pairs & (np.abs(step) <= 1)
    turns = 2.0 ** np.round(np.log2(max(abs(change[near].sum()) / max(abs(step[near].sum()), 1), 1e-3)))
    # At the edge of a stripe the column is known: there the stripe of the larger number begins.
    edge = near & (np.abs(step) == 1)
    expected = TURN * turns * np.maximum(number[:, 1:], number[:, :-1])
    between = phase[:, 1:] - np.pi * change
    off = np.angle(np.exp(1j * (between - expected))[edge].mean()) if edge.any() else 0.0
    return float(turns), float(90 * np.round(np.rad2deg(off) / 90))


def _harmonic(values: NDArray[np.float32]) -> Complex:
    turn = np.exp(-1j * TURN * np.arange(len(values)) / len(values)).astype(np.complex64)
    return np.asarray(np.tensordot(turn, values, (0, 0)) / len(values), np.complex64)


def _wave(lines: Lines, pictures: Sequence[int]) -> Complex:
    return _harmonic(lines.values[np.asarray(pictures)])


def _turns(waves: Sequence[Complex], pairs: NDArray[np.bool_]) -> NDArray[np.float64] | None:
    """Mean turns of each set over long runs, relative to each other exact; None if none turns."""
    change = np.stack([np.angle(wave[:, 1:] * np.conj(wave[:, :-1])) / TURN for wave in waves])
    if not pairs.any():
        return None
    # Edges of things are left out: phases jump there, by turns that nobody sees.
    usual = np.array([np.median(each[pairs]) for each in change])
    near = np.abs(change - usual[:, None, None]) < LEAST_CHANGE + 2 * np.abs(usual)[:, None, None]
    steady = pairs & near.all(0)
    runs = []
    for line in range(steady.shape[0]):
        edges = np.flatnonzero(np.diff(np.r_[False, steady[line], False].astype(np.int8)))
        for start, end in edges.reshape(-1, 2):
            if end - start >= LEAST_RUN:
                # Differences of neighbours telescope, so noise does not add up.
                runs.append(change[:, line, start:end].sum(-1))
    if not runs:
        return None
    table = np.array(runs)
    finest = int(np.argmax(np.abs(table).mean(0)))
    length = np.abs(table[:, finest])
    if not length.max() > 0:
        return None  # the same picture at every step
    longest = table[length >= 0.5 * length.max()]
    ratio = np.median(longest / longest[:, [finest]], axis=0)
    return np.asarray(ratio * table[np.argmax(length), finest])


def _fringes(turns: NDArray[np.float64]) -> Iterator[tuple[float, ...]]:
    """Whole numbers of fringes in the ratio of the turns that are seen."""
    order = np.argsort(turns)
    if turns[order[0]] < ONE_FRINGE:
        # From coarse to fine each ratio is known better than to one half.
        fringes = np.ones(len(turns))
        for lower, upper in pairwise(order):
            ratio = turns[upper] / max(turns[lower], 1e-9)
            fringes[upper] = max(np.round(ratio * fringes[lower]), 1.0)
        if fringes.max() <= MOST_FRINGES:
            yield tuple(float(f) for f in fringes)
    finest = turns[order[-1]]
    for count in range(int(np.ceil(finest)), MOST_FRINGES + 1):
        scaled = turns / finest * count
        off = np.abs(scaled - np.round(scaled))
        if (off < OFF + OFF_SHARE * count).all() and (np.round(scaled) > 0).all():
            yield tuple(float(f) for f in np.round(scaled))


def _samples(waves: Sequence[Complex], lit: NDArray[np.bool_]) -> NDArray[np.complex64]:
    """Harmonics of all sets at some lit pixels, (sets, pixels)."""
    table = np.stack([wave[lit] for wave in waves])
    return np.asarray(table[:, :: max(table.shape[1] // SAMPLES, 1)], np.complex64)


def _off(
    samples: NDArray[np.complex64],
    fringes: tuple[float, ...],
    start_deg: float,
    steps: int,
    direction: Literal[1, -1],
) -> float:
    """By how much the phases of samples disagree on their best position, rad (rms, to three digits)."""
    periods = tuple(VIRTUAL_PX / f for f in fringes)
    spec = Phases(periods_px=periods, steps=steps, start_deg=start_deg, direction=direction)
    noise = np.full(samples.shape[1:], 4e-4, np.float32)
    frames = (
        (np.asarray(2 * np.real(wave * np.exp(1j * TURN * k / steps)), np.float32), noise)
        for wave in samples
        for k in range(steps)
    )
    position = read_phases(spec, VIRTUAL_PX, frames).position_px
    phases = np.angle(samples) * direction - np.deg2rad(start_deg)
    expected = TURN * position / np.array(periods)[:, None]
    off = np.angle(np.exp(1j * (expected - phases)))
    # A few pixels see two surfaces.
    return round(float(np.sqrt(np.mean(np.sort(off**2, axis=1)[:, : int(0.9 * off.shape[1])]))), 3)
