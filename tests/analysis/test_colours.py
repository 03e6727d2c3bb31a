import math

import numpy as np
import pytest

import dsl_core as dsl
from dsl_core.analysis.colours import ILLUMINANTS, colours_of, lab_of, lights_for, xyz_weights
from dsl_core.analysis.session_report import colour_table
from dsl_core.errors import DecodeError
from dsl_core.optics.charts import chart_reflectance
from dsl_core.optics.colour import delta_e_2000, hold_colour
from tests.cases.chart_cube import NM as CHART_NM
from tests.cases.chart_cube import chart_cube, chart_result
from tests.cases.colour_science import colour_library

NM = np.arange(430.0, 661.0, 5.0)


@pytest.mark.parametrize("light", list(ILLUMINANTS))
def test_colours_are_those_of_colour_science(light: str) -> None:
    colour = colour_library()
    chart, fine = chart_reflectance(NM), np.arange(360.0, 831.0)
    observer = colour.MSDS_CMFS["CIE 1931 2 Degree Standard Observer"]
    power = colour.SDS_ILLUMINANTS[light].copy().align(observer.shape)
    weights, labs = xyz_weights(NM, light), []
    for values in (chart["foliage"], chart["magenta"], np.ones(len(NM))):
        sd = colour.SpectralDistribution(np.interp(fine, NM, values), fine)
        xyz = colour.sd_to_XYZ(sd, observer, power, method="Integration") / 100
        white = colour.sd_to_XYZ(
            colour.SpectralDistribution(np.ones(471), fine), observer, power, method="Integration"
        )
        labs.append(colour.XYZ_to_Lab(xyz, colour.XYZ_to_xy(white / 100)))
        assert np.abs(lab_of(values, weights) - labs[-1]).max() < 1e-6
    expected = colour.delta_E(labs[0], labs[1], method="CIE 2000")
    assert delta_e_2000(*(np.asarray(lab) for lab in labs[:2])) == pytest.approx(expected, abs=1e-6)


def test_deviations_are_those_of_repeated_measurements() -> None:
    rng, chart = np.random.default_rng(2), chart_reflectance(NM)
    names = ("foliage", "blue sky")
    std = {name: 0.02 * chart[name] for name in names}
    spectra = {name: (chart[name], std[name]) for name in names}
    found = {c.name: c for c in colours_of(spectra, NM, ("A",), "blue sky", correlation=np.eye(len(NM)))}
    weights, shots = xyz_weights(NM, "A"), {}
    for name in names:
        noise = rng.standard_normal((len(NM), 4000)) * std[name][:, None]
        shots[name] = lab_of(chart[name][:, None] + noise, weights)
    assert found["foliage"].lab_std == pytest.approx(shots["foliage"].std(1), rel=0.05)
    distances = delta_e_2000(shots["foliage"], shots["blue sky"])
    assert found["foliage"].delta_e == pytest.approx(distances.mean(), rel=0.01)
    assert found["foliage"].delta_e_std == pytest.approx(distances.std(), rel=0.1)
    assert found["blue sky"].delta_e is None


def test_bands_that_err_together_make_a_colour_less_sure() -> None:
    chart = chart_reflectance(NM)
    spectra = {"x": (chart["neutral 5 (.70 D)"], np.full(len(NM), 0.004))}
    lone, together = (
        colours_of(spectra, NM, ("D65",), correlation=c)[0]
        for c in (np.eye(len(NM)), np.ones((len(NM),) * 2))
    )
    assert together.lab_std[0] > 3 * lone.lab_std[0]


@pytest.mark.parametrize("smooth", [0.0, 1.2, 3.0])
def test_the_band_of_a_lightness_holds_it_however_bands_err_together(smooth: float) -> None:
    """Noisy scans are smoothed over more bands than the usual ones; a result tells by how many."""
    cube = chart_cube(count=2, smooth=smooth)
    result = chart_result(count=2)
    result["reflectance"].values[:, :-1] = cube.reflectance[:, :-1]
    places = [(x, y) for y in (3, 7, 11, 19, 23, 27) for x in range(2, 58, 5)]
    found = dsl.colours(result, {f"{x} {y}": (x, y) for x, y in places}, "D65")
    weights = xyz_weights(CHART_NM, "D65")
    inside = []
    for x, y in places:
        true = lab_of(cube.spectra[cube.material[y, x]], weights)
        one = found.sel(place=f"{x} {y}", light="D65")
        inside.append(abs(one["lab"][0] - true[0]) < 1.96 * one["lab_std"][0])
    assert 0.9 < np.mean(inside) <= 1


def test_a_difference_of_colours_without_deviations_has_none() -> None:
    chart, unknown = chart_reflectance(NM), np.full(len(NM), np.nan)
    spectra = {
        "foliage": (chart["foliage"], unknown),
        "magenta": (chart["magenta"], unknown),
        "cyan": (chart["cyan"], np.full(len(NM), 0.01)),
    }
    alone, _, sure = colours_of(spectra, NM, ("D65",), "magenta")
    assert alone.delta_e_std is not None
    assert math.isnan(alone.delta_e_std)
    assert alone.cells[-1] is None
    assert sure.delta_e_std is not None
    assert sure.delta_e_std > 0.1, "that of the one which is known"
    table = colour_table([alone, sure])
    assert "±" not in "".join(table.rows[0])
    assert "nan" not in "".join(table.rows[0])
    assert table.rows[1][-1].endswith(f"± {sure.delta_e_std:.2f}")


def test_a_colour_is_not_sure_to_less_than_bands_of_unknown_deviation_make_it() -> None:
    values, std = chart_reflectance(NM)["foliage"], np.where(NM < 600, np.nan, 0.01)
    found = colours_of({"x": (values, std), "y": (np.where(NM < 440, np.nan, values), std)}, NM, ("D65",))
    assert all(math.isnan(each) for colour in found for each in colour.lab_std)
    masked = np.where(NM == 500, np.nan, 0.01)
    sure = colours_of({"x": (np.where(NM == 500, np.nan, values), masked)}, NM, ("D65",))[0]
    assert all(each > 0.1 for each in sure.lab_std)


def test_unknown_lights_and_names_are_told() -> None:
    spectra = {"x": (np.ones(len(NM)), np.zeros(len(NM)))}
    with pytest.raises(DecodeError, match="no light 'candle'"):
        colours_of(spectra, NM, ("candle",))
    with pytest.raises(DecodeError, match="no spectrum 'y'"):
        colours_of(spectra, NM, reference="y")


@pytest.mark.parametrize(
    ("start_nm", "stop_nm", "light", "held"),
    [(430, 660, "FL11", True), (440, 650, "FL11", True), (450, 650, "FL11", False), (430, 600, "A", False),
     (500, 560, "D65", False), (480, 480, "D65", False)],
)  # fmt: skip
def test_bands_that_hold_too_little_of_a_colour_have_none(
    start_nm: float, stop_nm: float, light: str, held: bool
) -> None:
    bands = np.arange(start_nm, stop_nm + 1.0, 5.0)
    spectra = {"x": (np.full(len(bands), 0.4), np.full(len(bands), 0.01))}
    assert (light in lights_for(bands)) == held
    if held:
        assert len(colours_of(spectra, bands, (light,))) == 1
    else:
        with pytest.raises(
            DecodeError, match=f"{start_nm} to {stop_nm} nm, hold .* under {light}: too little"
        ):
            colours_of(spectra, bands, (light,))


def test_a_missing_band_leaves_a_colour() -> None:
    values = chart_reflectance(NM)["foliage"]
    missing, std = values.copy(), np.full(NM.size, 0.01)
    missing[23] = np.nan
    whole, part, alone = colours_of(
        {"a": (values, std), "b": (missing, std), "c": (values, std)}, NM, ("D65",), "a"
    )
    assert np.abs(np.subtract(whole.lab, part.lab)).max() < 0.1
    assert part.delta_e is not None
    assert part.delta_e < 0.1
    assert part.lab_std == pytest.approx(whole.lab_std, rel=0.1)
    assert alone.lab == whole.lab


@pytest.mark.parametrize("kept_nm", [(450, 550, 650), tuple(nm for nm in NM if nm < 490 or nm > 600)])
def test_a_line_across_a_wide_gap_makes_no_colour(kept_nm: tuple[float, ...]) -> None:
    kept, green = np.isin(NM, kept_nm), 0.1 + 0.5 * np.exp(-(((NM - 545) / 25) ** 2))
    masked, std = np.where(kept, green, np.nan), np.full(NM.size, 0.005)
    with pytest.raises(DecodeError, match=r"The bands of 'x', 4\d0 to 6\d0 nm, hold .*mask none"):
        colours_of({"whole": (green, std), "x": (masked, std)}, NM, ("D65",))
    with pytest.raises(DecodeError, match=r"The bands, 4.* hold"):
        colours_of({"x": (green[kept], std[kept])}, NM[kept], ("D65",))
    assert not hold_colour(NM[kept])


def test_what_is_advised_for_bands_that_are_too_wide_holds_a_colour_under_any_light() -> None:
    wide = NM[::9]
    with pytest.raises(DecodeError, match=r"Reconstruct bands of 30 nm or finer from about 430 to 660 nm"):
        colours_of({"x": (np.full(wide.size, 0.5), np.full(wide.size, 0.01))}, wide, ("D65",))
    assert lights_for(NM[::6]) == tuple(ILLUMINANTS)


@pytest.mark.parametrize("step", [2, 4, 6])
def test_bands_far_apart_hold_a_colour_as_long_as_it_hardly_changes(step: int) -> None:
    std, chart = np.full(NM.size, 0.005), chart_reflectance(NM)
    for values in chart.values():
        whole = colours_of({"x": (values, std)}, NM, ("D65",))[0]
        coarse = colours_of({"x": (values[::step], std[::step])}, NM[::step], ("D65",))[0]
        assert float(delta_e_2000(np.array(whole.lab), np.array(coarse.lab))) < 2
