"""Flags become findings where they are not normal; only what is wrong is named."""

from __future__ import annotations

import numpy as np
import pytest

from dsl_core.model.fit import Fit, FitFinding, Part
from dsl_core.model.result import Flag
from dsl_core.reconstruction.findings.band_findings import band_findings
from dsl_core.reconstruction.findings.flag_findings import SpectralCounts, count_spectra, share_findings

SHAPE = (20, 20)


def judged(
    made: np.ndarray[tuple[int, ...], np.dtype[np.uint16]], reflectance: float = 1.5, std: float = 0.0
) -> list[FitFinding]:
    """What is said of flags and of even spectra that reach nothing."""
    nothing = np.zeros((1, *SHAPE), np.uint8)
    even, deviation = np.full(nothing.shape, reflectance), np.full(nothing.shape, std)
    return list(share_findings(made, count_spectra(made, nothing.astype(float), nothing, even, deviation)))


def scattered(flag: Flag, share: float) -> np.ndarray[tuple[int, ...], np.dtype[np.uint16]]:
    made = flags(flag, share).ravel()
    return np.random.default_rng(2).permutation(made).reshape(SHAPE)


def flags(flag: Flag, share: float) -> np.ndarray[tuple[int, ...], np.dtype[np.uint16]]:
    values = np.zeros(SHAPE, np.uint16)
    values.ravel()[: round(share * values.size)] = int(flag)
    return values


@pytest.mark.parametrize(
    ("flag", "limit", "part"),
    [
        (Flag.POOR_FIT, 0.4, "mixed pixels"),
        (Flag.AT_BOUND, 0.1, "light"),
        (Flag.CODES_DISAGREE, 0.1, "coverage"),
        (Flag.OUT_OF_RANGE, 0.1, "coverage"),
        (Flag.UNUSUAL_PEAK, 0.02, "profile"),
    ],
)
def test_a_flag_is_told_from_the_share_that_is_not_normal(flag: Flag, limit: float, part: str) -> None:
    below, above = (Fit.of(judged(scattered(flag, limit + d))) for d in (-0.01, 0.02))
    assert below.parts == ()
    assert above.parts == (part,)
    assert f"{limit + 0.02:.0%}" in above.words


@pytest.mark.parametrize(
    ("flag", "part", "words"),
    [(Flag.POOR_FIT, "surfaces", "dirt on the film"), (Flag.NOT_REFINED, "profile", "too dark, translucent")],
)
def test_whole_areas_are_told_though_they_are_a_small_part_of_the_picture(
    flag: Flag, part: Part, words: str
) -> None:
    area, lines = np.zeros(SHAPE, np.uint16), np.zeros(SHAPE, np.uint16)
    area[5:14, 3:14] = lines[::4] = int(flag)
    found = Fit.of(judged(area))
    assert found.parts == (part,)
    assert words in found.words
    # Seen edges of so many pixels more are no areas, and neither are pixels that something else explains.
    assert part not in Fit.of(judged(lines)).parts
    assert Fit.of(judged(flags(Flag.SATURATED | Flag.NOT_REFINED, 0.3))).parts == ()


def test_a_small_translucent_patch_is_told_and_pixels_along_an_edge_are_not() -> None:
    patch, edge = np.zeros((2, 60, 60), np.uint16)
    patch[20:28, 20:28] = edge[:, 30] = int(Flag.UNUSUAL_PEAK)
    told = Fit.of(share_findings(patch, None))
    assert told.parts == ("profile",)
    assert "light leaves a translucent surface elsewhere" in told.words
    assert Fit.of(share_findings(edge, None)).parts == ()
    assert Fit.of(share_findings(patch, None, blurred=True)).parts == ()


def test_pixels_that_are_lost_to_overexposure_are_told_by_themselves() -> None:
    bright = flags(Flag.SATURATED | Flag.CODE_UNSURE, 0.3)
    fit = Fit.of(judged(bright))
    assert fit.parts == ("exposure",)
    assert "30% of the lit pixels" in fit.words
    assert "darker setting" in fit.words
    assert Fit.of(judged(flags(Flag.SATURATED, 0.3))).parts == (), "these have a depth"
    assert Fit.of(judged(flags(Flag.SATURATED | Flag.OUT_OF_RANGE, 0.3))).parts == ("coverage",)
    assert Fit.of(judged(bright | np.flip(flags(Flag.OUT_OF_RANGE, 0.2)))).parts == ("exposure", "coverage")


def test_a_background_beyond_the_calibrated_depths_is_not_blamed_on_motion_alone() -> None:
    far, unsure = flags(Flag.OUT_OF_RANGE, 0.3), np.flip(flags(Flag.CODES_DISAGREE, 0.2))
    assert "if they show a background" in Fit.of(judged(far | unsure)).words
    assert "surfaces that light each other" in Fit.of(judged(unsure)).words
    assert "background" not in Fit.of(judged(flags(Flag.OUT_OF_RANGE, 0.1) | unsure)).words


def test_lines_of_another_shape_are_no_news_where_the_camera_is_out_of_focus() -> None:
    made = flags(Flag.UNUSUAL_PEAK, 0.3)
    assert Fit.of(share_findings(made, None)).parts == ("profile",)
    assert Fit.of(share_findings(made, None, blurred=True)).parts == ()


def test_spectra_at_a_bound_that_fit_poorly_say_nothing_of_the_light() -> None:
    both = scattered(Flag.POOR_FIT, 0.3) | scattered(Flag.AT_BOUND, 0.35)
    assert Fit.of(judged(both)).parts == ()
    assert Fit.of(judged(both | scattered(Flag.AT_BOUND, 0.45))).parts == ("light",)


@pytest.mark.parametrize(
    ("reflectance", "std", "told"),
    # Noise takes dark surfaces to 0. The least that a band holds one of whose nodes is 1.5 is 1.
    [(0.0, 0.008, False), (0.9, 0.0, False), (1.0, 0.0, True), (1.5, 0.2, True), (1.3, 0.2, False)],
)
def test_spectra_at_a_bound_by_their_noise_say_nothing_of_the_light(
    reflectance: float, std: float, told: bool
) -> None:
    found = judged(flags(Flag.AT_BOUND, 0.5), reflectance, std)
    assert (Fit.of(found).parts == ("light",)) == told


@pytest.mark.parametrize(("pixels", "told"), [(49, ()), (50, ("bands", "exposure", "profile", "surfaces"))])
def test_fewer_than_fifty_pixels_say_nothing(pixels: int, told: tuple[str, ...]) -> None:
    made = np.full(SHAPE, int(Flag.NO_LIGHT), np.uint16)
    made.ravel()[:pixels] = int(Flag.POOR_FIT | Flag.UNUSUAL_PEAK)
    lost = np.where(made == int(Flag.NO_LIGHT), made, int(Flag.SATURATED | Flag.CODE_UNSURE))
    counts = SpectralCounts(reached=pixels, undecided=pixels)
    found = [*share_findings(lost, None), *share_findings(made, counts), *band_findings(5, 11.0, counts)]
    assert tuple(sorted(Fit.of(found).parts)) == told


def test_pixels_in_shadow_are_not_lost_and_depth_alone_has_no_spectra_to_judge() -> None:
    assert Fit.of(judged(flags(Flag.NO_LIGHT, 0.8))).parts == ()
    assert Fit.of(share_findings(flags(Flag.POOR_FIT, 0.8), None)).parts == ()


def test_counts_of_rows_add_up_to_those_of_the_picture() -> None:
    made, rng = flags(Flag.POOR_FIT, 0.3), np.random.default_rng(0)
    share, reach = rng.uniform(0, 1, (3, *SHAPE)), rng.integers(1, 5, (3, *SHAPE))
    made |= flags(Flag.AT_BOUND, 0.6)
    dark, std = rng.uniform(0, 0.04, (3, *SHAPE)), np.full((3, *SHAPE), 0.002)
    parts = (
        count_spectra(made[each], share[:, each], reach[:, each], dark[:, each], std[:, each])
        for each in (slice(0, 7), slice(7, 20))
    )
    assert sum(parts, SpectralCounts()) == count_spectra(made, share, reach, dark, std)
