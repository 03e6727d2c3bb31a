from dataclasses import replace

import numpy as np
import pytest

from dsl_core.analysis.alike import groups_alike
from dsl_core.analysis.classes import (
    Member,
    SpectralClass,
    class_of_pixels,
    doubt_of,
    known_classes,
    summed_up,
)
from dsl_core.analysis.classify import ClassMap, Limits, Measure, score
from dsl_core.errors import DecodeError
from dsl_core.model.result import Flag
from tests.cases.chart_cube import SMOOTH, ChartCube, chart_cube


@pytest.fixture(scope="module")
def cube() -> ChartCube:
    return chart_cube()


def _classes(cube: ChartCube, left_out: int | None = None) -> list[SpectralClass]:
    known = zip(cube.names, cube.spectra, strict=True)
    return [SpectralClass(n, (Member.of(s),)) for i, (n, s) in enumerate(known) if i != left_out]


def _map(cube: ChartCube, classes: list[SpectralClass], rate: float = 0.01, **options: object) -> ClassMap:
    scores = score(cube.reflectance, cube.std, None, cube.flags, classes, **options)  # type: ignore[arg-type]
    return ClassMap.of(scores, Limits(rate, 0.95))


@pytest.mark.parametrize("rate", [0.01, 0.1])
@pytest.mark.parametrize("smooth", [0.0, SMOOTH])
def test_none_of_these_keeps_its_rate_and_no_pixel_gets_a_wrong_name(rate: float, smooth: float) -> None:
    cube = chart_cube(smooth=smooth)
    shown = _map(cube, _classes(cube), rate)
    judged = shown.values > 0
    named = judged & (shown.values <= len(cube.names))
    assert (shown.values[named] == cube.material[named] + 1).all()
    none = (shown.values[judged] == shown.none).mean()
    if smooth:
        # A share of each deviation is taken as the band's own: fewer pixels than stated, never more.
        assert none <= rate
    else:
        assert none == pytest.approx(rate, rel=0.35)


def test_a_material_that_is_in_no_class_is_none_of_these(cube: ChartCube) -> None:
    shown = _map(cube, _classes(cube, left_out=4))
    unknown = cube.material == 4
    assert (shown.values[unknown] == shown.none).mean() > 0.99


def test_flags_are_respected(cube: ChartCube) -> None:
    assert cube.flags[0, 0] == Flag.POOR_FIT
    assert _map(cube, _classes(cube)).values[0, 0] == 0


def test_a_saturated_frame_leaves_a_pixel_its_material_unless_its_column_is_coarse(cube: ChartCube) -> None:
    flags = np.zeros_like(cube.flags)
    flags[1], flags[2] = Flag.SATURATED, Flag.SATURATED | Flag.NOT_REFINED
    flags[3] = Flag.NOT_REFINED
    shown = _map(replace(cube, flags=flags), _classes(cube)).values
    assert (shown[[0, 1, 3]] > 0).all()
    assert (shown[2] == 0).all()
    mask = np.isin(np.arange(len(flags)), [1, 2])[:, None] & np.ones(flags.shape, bool)
    kept = class_of_pixels("kept", cube.reflectance, cube.std, mask, flags)
    mask[2] = False
    np.testing.assert_array_equal(
        kept.mean, class_of_pixels("kept", cube.reflectance, cube.std, mask, flags).mean
    )


def test_what_only_brightness_tells_apart_is_undecided_when_brightness_is_free(cube: ChartCube) -> None:
    twice = [SpectralClass("dark", (Member.of(cube.spectra[1] / 1.5),))]
    twice += [SpectralClass("bright", (Member.of(cube.spectra[1]),))]
    here = cube.material == 1
    stated, free = _map(cube, twice), _map(cube, twice, brightness="free")
    assert (stated.values[here] == 2).mean() > 0.98
    assert (free.values[here] == free.unsure).mean() > 0.98


def test_a_brightness_of_its_own_is_within_what_is_stated() -> None:
    cube = chart_cube(share=0.003, level=0.05)
    shown = _map(cube, _classes(cube))
    judged = shown.values > 0
    assert (shown.values[judged] == shown.none).mean() <= 0.012


def test_deviations_decide_and_angles_do_not() -> None:
    """Two classes whose shapes differ by less than the noise are undecided, not named at random."""
    cube = chart_cube(count=2, share=0.2)
    near = cube.spectra[0] * (1 + 0.01 * np.linspace(-1, 1, cube.spectra.shape[1]))
    classes = [SpectralClass("a", (Member.of(cube.spectra[0]),)), SpectralClass("b", (Member.of(near),))]
    here = cube.material == 0
    assert (_map(cube, classes).values[here] > 2).mean() > 0.98
    angles = score(cube.reflectance, None, None, cube.flags, classes, Measure.ANGLE)
    assert (angles.best[here] == 1).mean() > 0.2


def test_bands_that_the_prior_decided_do_not_count(cube: ChartCube) -> None:
    share, values = np.ones_like(cube.reflectance), cube.reflectance.copy()
    share[:4, 30:40], values[:4, 30:40] = 0.1, 0.9
    scores = score(values, cube.std, share, cube.flags, _classes(cube))
    assert (scores.best[30:40] == cube.material[30:40]).all()
    assert np.median(scores.fit[30:40]) > 0.2
    assert np.median(score(values, cube.std, None, cube.flags, _classes(cube)).fit[30:40]) < 1e-6


@pytest.mark.parametrize("measure", [Measure.ANGLE, Measure.RMSE])
def test_distances_name_the_nearest_and_limits_work_afterwards(cube: ChartCube, measure: Measure) -> None:
    scores = score(cube.reflectance, None, None, cube.flags, _classes(cube), measure)
    wide, narrow = ClassMap.of(scores, Limits(1.0, 0.0)), ClassMap.of(scores, Limits(1e-4, 0.0))
    judged = scores.best >= 0
    assert (wide.values[judged] == cube.material[judged] + 1).mean() > 0.98
    assert (narrow.values[judged] == narrow.none).all()


def test_marked_pixels_make_a_class_that_varies_as_they_do(cube: ChartCube) -> None:
    varied = cube.reflectance * (1 + 0.2 * np.sin(np.arange(cube.flags.shape[1]) / 3)).astype("f4")
    made = class_of_pixels("x", varied, cube.std, cube.material == 1)
    (member,) = made.members
    assert len(member.components) == 1
    level = np.abs(member.components[0]) / member.mean
    assert level == pytest.approx(0.2 * np.sqrt(0.5), rel=0.2)
    scores = score(varied, cube.std, None, cube.flags, [made])
    assert (scores.fit[cube.material == 1] < 0.01).mean() < 0.02
    plain = class_of_pixels("x", cube.reflectance, cube.std, cube.material == 1)
    assert len(plain.members[0].components) == 0


def test_a_region_of_two_materials_is_doubted_and_flagged_pixels_define_nothing(cube: ChartCube) -> None:
    both = class_of_pixels("both", cube.reflectance, cube.std, cube.material < 2)
    assert "both varies by" in doubt_of(both)
    one = class_of_pixels("one", cube.reflectance, cube.std, cube.material == 1)
    assert doubt_of(one) == ""
    flags = np.where(cube.material == 0, np.uint16(Flag.POOR_FIT), cube.flags)
    kept = class_of_pixels("kept", cube.reflectance, cube.std, cube.material < 2, flags)
    assert kept.mean == pytest.approx(one.mean)


def test_a_pin_whose_spectrum_is_not_known_names_nothing(cube: ChartCube) -> None:
    dark = SpectralClass("dark", (Member.of(np.full(24, 0.01), np.full(24, 0.02)),))
    edge = SpectralClass("edge", (Member.of(np.full(24, 0.1), np.full(24, 0.4)),))
    sure = class_of_pixels("sure", cube.reflectance, cube.std, cube.material == 1)
    kept, notes = known_classes([edge, sure, dark])
    assert [each.name for each in kept] == ["sure", "dark"]
    assert notes == (
        "edge is left out: its reflectance of 0.10 is known to ±0.40 only and would explain other materials"
        " as well. Mark another place.",
    )
    with pytest.raises(DecodeError, match="edge is left out"):
        known_classes([edge])


def test_a_pin_that_is_far_less_certain_than_the_pixels_takes_no_other_material(cube: ChartCube) -> None:
    first = cube.reflectance[:, cube.material == 1].mean(1).astype(np.float64)
    vague = SpectralClass("vague", (Member.of(first, np.full(24, 0.25 * first.mean())),))
    sure = class_of_pixels("sure", cube.reflectance, cube.std, cube.material == 1)
    kept, notes = known_classes([vague, sure], cube.std)
    assert [each.name for each in kept] == ["sure"]
    assert notes[0].startswith("vague is left out")
    # Where all pixels are as uncertain, a pin can be no better than they are.
    noisy = np.full_like(cube.std, 0.2 * first.mean())
    assert len(known_classes([vague, sure], noisy)[0]) == 2


def test_few_members_stay_and_many_are_summed_up(cube: ChartCube) -> None:
    members = [Member.of(cube.spectra[0] * level) for level in np.linspace(0.9, 1.1, 30)]
    assert len(summed_up("x", members[:5]).members) == 5
    assert len(summed_up("x", members).members) == 1


def test_pixels_of_pins_find_their_material(cube: ChartCube) -> None:
    pins = []
    for index, name in enumerate(cube.names):
        mask = np.zeros(cube.flags.shape, bool)
        mask[tuple(np.argwhere(cube.material == index)[70])] = True
        pins.append(class_of_pixels(name, cube.reflectance, cube.std, mask))
    shown = _map(cube, pins)
    named = (shown.values > 0) & (shown.values <= len(pins))
    assert named.mean() > 0.9
    assert (shown.values[named] == cube.material[named] + 1).mean() > 0.995


def test_wrong_input_is_told(cube: ChartCube) -> None:
    with pytest.raises(DecodeError, match="1 to 250 classes; given 0"):
        score(cube.reflectance, cube.std, None, cube.flags, [])
    unknown = np.full_like(cube.std, np.nan)
    with pytest.raises(DecodeError, match=r"none of its .* has deviations .* by spectral angle"):
        class_of_pixels("x", cube.reflectance, unknown, cube.material == 1)
    with pytest.raises(DecodeError, match=r"has a spectrum\. Mark another place"):
        class_of_pixels("x", np.full_like(cube.reflectance, np.nan), unknown, cube.material == 1)
    for std in (None, unknown):
        with pytest.raises(DecodeError, match="states no deviations"):
            score(cube.reflectance, std, None, cube.flags, _classes(cube))
    with pytest.raises(DecodeError, match="does not have the 24 bands"):
        score(cube.reflectance, cube.std, None, cube.flags, [SpectralClass("x", (Member.of(np.ones(3)),))])


@pytest.mark.parametrize("wrong", [-0.1, float("nan"), float("inf")])
def test_limits_that_are_no_limits_are_told(wrong: float) -> None:
    with pytest.raises(DecodeError, match="'worst' must be"):
        Limits(wrong, 0.1)
    with pytest.raises(DecodeError, match="'margin' must be"):
        Limits(0.1, wrong)


def test_shares_and_probabilities_are_at_most_one() -> None:
    assert Limits.chosen(Measure.PROBABILITY, None, 0.5) == Limits(0.01, 0.5)
    assert Limits.chosen(Measure.ANGLE, 1.5, None) == Limits(1.5, 0.1)
    with pytest.raises(DecodeError, match=r"from 0 to 1; given 7 and 0\.95"):
        Limits.chosen(Measure.PROBABILITY, 7, None)


@pytest.mark.parametrize("bands", [1, 2])
def test_marked_pixels_of_one_or_two_bands_are_told_apart_by_their_difference(
    cube: ChartCube, bands: int
) -> None:
    values, std = cube.reflectance[:bands], cube.std[:bands]
    marked = [class_of_pixels(f"{at}", values, std, cube.material == at) for at in (0, 1)]
    scores = score(values, std, None, cube.flags, marked, Measure.RMSE)
    np.testing.assert_array_equal(scores.best[cube.material == 1], 1)
    with pytest.raises(DecodeError, match=f"has {bands} band.*3 at least.*rmse"):
        score(values, std, None, cube.flags, marked)


@pytest.mark.parametrize("measure", [Measure.ANGLE, Measure.PROBABILITY])
@pytest.mark.parametrize("bands", [1, 2])
def test_too_few_bands_have_no_shape_that_names_a_class(
    cube: ChartCube, measure: Measure, bands: int
) -> None:
    classes = [SpectralClass(name, (Member.of(np.full(bands, 0.5)),)) for name in "ab"]
    with pytest.raises(DecodeError, match=f"has {bands} band.*3 at least.*rmse"):
        score(cube.reflectance[:bands], cube.std[:bands], None, cube.flags, classes, measure)
    by_rmse = score(cube.reflectance[:bands], None, None, cube.flags, classes, Measure.RMSE)
    assert np.nanmax(by_rmse.margin) == 0


def test_two_classes_that_fit_exactly_are_undecided() -> None:
    values = np.full((3, 1, 1), 0.5, np.float32)
    classes = [SpectralClass(name, (Member.of(values[:, 0, 0].astype(float)),)) for name in "ab"]
    scores = score(values, None, None, np.zeros((1, 1), np.uint16), classes, Measure.RMSE)
    shown = ClassMap.of(scores)
    assert shown.values[0, 0] == shown.unsure


@pytest.mark.parametrize("stripe_px", [1, 12, 40])
@pytest.mark.parametrize(("together_nm", "apart"), [(8.0, 0.01), (15.0, 0.01), (8.0, 0.006)])
def test_names_of_similar_materials_are_as_sure_as_they_are_right(
    stripe_px: int, together_nm: float, apart: float
) -> None:
    """Two classes about one deviation apart; pixels have exactly the deviations that are stated."""
    rng, std, nm = np.random.default_rng(3), 0.01, np.arange(430.0, 661.0, 5.0)
    correlation = np.exp(-0.5 * ((nm[:, None] - nm) / together_nm) ** 2)
    root = np.linalg.cholesky(correlation + 1e-6 * np.eye(len(nm)))
    first = 0.3 + 0.1 * np.sin(nm / 40)
    spectra = np.stack([first, first + apart * np.cos(nm / 25)])
    material = np.broadcast_to(np.arange(80) // stripe_px % 2, (120, 80))
    noise = np.tensordot(root, rng.standard_normal((len(nm), *material.shape)), axes=1)
    values = (np.moveaxis(spectra[material], -1, 0) + std * noise).astype(np.float32)
    classes = [SpectralClass(n, (Member.of(s),)) for n, s in zip("ab", spectra, strict=True)]
    flags = np.zeros(material.shape, np.uint16)
    scores = score(values, np.full_like(values, std), None, flags, classes, bands_nm=nm)
    for least in (0.6, 0.8, 0.95):
        told = scores.margin >= least
        said_wrong = float(np.mean(1 - scores.margin[told]))
        wrong = float(np.mean((scores.best != material)[told]))
        assert wrong < 1.25 * said_wrong + 2 * np.sqrt(said_wrong / told.sum())
    if stripe_px > 1:
        assert (scores.margin >= 0.95).mean() > 0.05, "caution leaves no name"


@pytest.mark.parametrize(("apart", "most_told"), [(0.0, 0.2), (0.02, 1.0), (0.03, 1.0)])
def test_a_class_that_is_known_better_takes_no_pixels_of_one_that_is_known_less(
    apart: float, most_told: float
) -> None:
    """A pin of one pixel against one of many; deviations are stated too large, as those of results are."""
    nm, wrong, told = np.arange(430.0, 661.0, 5.0), 0.0, 0.0
    root = np.linalg.cholesky(np.exp(-0.5 * ((nm[:, None] - nm) / 8.0) ** 2) + 1e-6 * np.eye(len(nm)))
    material = np.broadcast_to(np.arange(60) // 30, (40, 60))
    spectra = (np.full(len(nm), 0.2), 0.2 + apart * np.cos(nm / 25))
    flags = np.zeros(material.shape, np.uint16)
    for seed in range(4):
        rng = np.random.default_rng(seed)
        noise = np.tensordot(root, rng.standard_normal((len(nm), *material.shape)), axes=1)
        values = (np.moveaxis(np.stack(spectra)[material], -1, 0) + 0.0075 * noise).astype(np.float32)
        classes = []
        for name, mean, std in zip("ab", spectra, (0.009, 0.005), strict=True):
            off = 0.5 * std * (root @ rng.standard_normal(len(nm)))
            classes.append(SpectralClass(name, (Member.of(mean + off, np.full(len(nm), std)),)))
        scores = score(values, np.full_like(values, 0.01), None, flags, classes, bands_nm=nm)
        is_told = scores.margin >= 0.95
        told += float(is_told.mean()) / 4
        wrong += float(((scores.best != material) & is_told).mean()) / 4
    assert told <= most_told
    if apart:
        assert told > 0.5
        assert wrong <= 0.05 * told


def test_shades_of_grey_share_no_correlation_though_their_shapes_are_confused() -> None:
    cube = chart_cube(count=2)
    spectra = np.stack([np.full(len(cube.reflectance), level) for level in (0.9, 0.1, 0.1005)])
    nearest = np.arange(cube.flags.size) % 3
    values = np.moveaxis(spectra[nearest.reshape(cube.flags.shape)], -1, 0)
    classes = [SpectralClass(n, (Member.of(s),)) for n, s in zip("abc", spectra, strict=True)]
    good, together = np.ones(nearest.size, bool), np.eye(len(values))
    group = groups_alike(values, np.full_like(values, 0.005), nearest, good, classes, together)
    assert [len(np.unique(group[nearest == index])) for index in range(3)] == [1, 1, 1]
    assert group[0] != group[1]
    assert group[1] == group[2]
