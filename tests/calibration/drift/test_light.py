"""Light and film that changed are told apart, on signals that are summed up wavelength by wavelength."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import torch
from scipy.ndimage import gaussian_filter1d

from dsl_core.calibration.drift import light
from dsl_core.calibration.drift.light import PlaneSignals, _film_figures, _shift, film_drift, light_drift
from dsl_core.errors import CalibrationError
from dsl_core.model.figure import Figure
from dsl_core.model.spectral import SpectralCurve
from dsl_core.optics.correspondence import GratingModel, zero_order
from dsl_core.optics.sensor import bayer_channels
from dsl_core.optics.shading import Plane, plane_shading
from dsl_core.optics.spectra import chain_response
from dsl_core.simulation.published_rig import published_rig

REFLECTANCE, NOISE = 0.99, 2e-3
WHITE = SpectralCurve.of([400.0, 700.0], [REFLECTANCE] * 2)
NM = np.arange(400.0, 701.0)
RIG = published_rig()
RIG = RIG.model_copy(
    update={
        "camera": RIG.camera.resized(160, 104),
        "projector_response": RIG.projector_response.model_copy(update={"halo_peak_per_px": 0.0}),
        "efficiency": {order: RIG.efficiency[order] for order in (1, -1)},
    }
)
PLANE = Plane(np.array([0.03, -0.05, 1.0]) / 700.0)
#: Some pixels, at random, so that all colours of the mosaic are among them.
CHOSEN = np.sort(np.random.default_rng(0).permutation(160 * 104)[:3000])
COLOURS = bayer_channels(RIG.sensor.bayer, 104, 160).ravel()[CHOSEN]
DEPTH_MM, SHADING = (each.ravel()[CHOSEN] for each in (PLANE.depth_mm(RIG), plane_shading(RIG, PLANE)))


def lines() -> np.ndarray:
    """A line of five columns in each frame, forty apart."""
    profiles = np.zeros((16, 640))
    for k in range(16):
        profiles[k, 40 * k : 40 * k + 5] = 1.0
    return profiles


@cache
def light_of(order: int, shift_px: float, white: bool) -> np.ndarray:
    """What the pixels see of one order, (frames, pixels), at unit efficiency."""
    profiles = np.ones((1, 640)) if white else lines()
    pixels, depth = torch.as_tensor(CHOSEN), torch.as_tensor(DEPTH_MM)
    if order == 0:
        columns, rows = (part.numpy()[None] for part in zero_order(RIG, pixels, depth))
    else:
        seen = GratingModel(RIG).trace(pixels, depth, order, NM)
        columns, rows = seen.columns.numpy() + shift_px, seen.rows.numpy()
    # Eight samples a column; beyond the frame there is no light.
    fine = np.pad(np.repeat(profiles, 8, 1), ((0, 0), (400, 400)))
    fine = gaussian_filter1d(fine, 8 * RIG.projector_response.blur_px, axis=1)
    at = (columns + 0.5) * 8 - 0.5 + 400
    at = np.where((rows > -0.5) & (rows < 359.5), at, -1.0)
    response = chain_response(RIG, order, NM).sum(1)
    total = np.zeros((len(profiles), len(CHOSEN)))
    for k, profile in enumerate(fine):
        lit = np.interp(at, np.arange(len(profile)), profile, 0.0, 0.0)
        total[k] = lit[0] * response.sum(1)[COLOURS] if order == 0 else (lit * response[COLOURS].T).sum(0)
    return np.asarray(total * SHADING * REFLECTANCE)


def signals(
    gains: dict[int, float] | None = None, shifts: dict[int, float] | None = None, white: bool = False
) -> PlaneSignals:
    """The pixels of the plane; ``gains`` and ``shifts`` (px) of orders are what changed."""
    gains, shifts = gains or {}, shifts or {}
    rng = np.random.default_rng(0)
    radiance = np.asarray(sum(gains.get(m, 1.0) * light_of(m, shifts.get(m, 0.0), white) for m in (0, 1, -1)))
    return PlaneSignals(
        pixels=CHOSEN,
        colours=COLOURS,
        depth_mm=DEPTH_MM,
        shading=SHADING,
        profiles=np.ones((1, 640)) if white else lines(),
        radiance=radiance + NOISE * rng.standard_normal(radiance.shape),
        std=np.full(radiance.shape, NOISE),
    )


def by_name(figures: list[Figure]) -> dict[str, Figure]:
    return {figure.name.split(",")[0]: figure for figure in figures}


@pytest.mark.slow
def test_a_film_as_it_was_has_not_moved() -> None:
    figures = film_drift(RIG, signals(), WHITE)
    assert all(figure.passed for figure in figures)
    for order in ("+1", "-1"):
        found = by_name(figures)
        assert found[f"displacement of order {order}"].value == pytest.approx(0.0, abs=0.05)
        assert found[f"brightness of order {order}"].value == pytest.approx(1.0, abs=0.01)


@pytest.mark.slow
def test_a_displaced_order_and_a_dim_one_are_each_told() -> None:
    found = by_name(film_drift(RIG, signals({-1: 0.9}, {1: 0.5}), WHITE))
    assert found["displacement of order +1"].value == pytest.approx(0.5, abs=0.06)
    assert found["displacement of order -1"].value == pytest.approx(0.0, abs=0.05)
    assert found["brightness of order +1"].value == pytest.approx(1.0, abs=0.02)
    assert found["brightness of order -1"].value == pytest.approx(0.9, abs=0.01)
    assert [name for name, figure in found.items() if not figure.passed] == [
        "displacement of order +1",
        "brightness of order -1",
    ]


@pytest.mark.slow
def test_brightness_of_all_orders_alike_is_not_the_films() -> None:
    dim = {0: 0.8, 1: 0.8, -1: 0.8}
    found = by_name(film_drift(RIG, signals(dim), WHITE))
    assert found["brightness of order +1"].value == pytest.approx(1.0, abs=0.01)


def test_wrong_pixels_do_no_harm_and_widen_no_shift() -> None:
    seen = signals()
    dust = np.random.default_rng(1).random(seen.pixels.size) < 0.05
    radiance = np.where(dust, 1.5 * seen.radiance, seen.radiance)
    found = by_name(film_drift(RIG, replace(seen, radiance=radiance), WHITE))
    assert found["displacement of order +1"].value == pytest.approx(0.0, abs=0.08)
    assert found["brightness of order +1"].value == pytest.approx(1.0, abs=0.02)


@pytest.mark.parametrize("level", [1.0, 0.9])
def test_white_is_compared_colour_by_colour(level: float) -> None:
    seen = signals(white=True)
    dim = np.where(seen.colours == 2, level, 1.0)
    figures = light_drift(RIG, replace(seen, radiance=seen.radiance * dim), WHITE)
    red, green, blue = (figure.value for figure in figures)
    assert (red, green) == pytest.approx((1.0, 1.0), abs=0.01)
    assert blue == pytest.approx(level, abs=0.01)
    assert [figure.passed for figure in figures] == [True, True, level == 1.0]


def test_saturated_pixels_do_not_count_and_too_few_are_told() -> None:
    seen = signals(white=True)
    half = np.arange(seen.pixels.size) % 2 == 0
    spoilt = replace(
        seen, radiance=np.where(half, 3.0, 1.0) * seen.radiance, std=np.where(half, np.inf, seen.std)
    )
    assert all(figure.passed for figure in light_drift(RIG, spoilt, WHITE))
    with pytest.raises(CalibrationError, match="Only 0 red pixels"):
        light_drift(RIG, replace(seen, std=np.full(seen.std.shape, np.inf)), WHITE)
    with pytest.raises(CalibrationError, match="light only 0 of the chosen pixels directly"):
        film_drift(RIG, replace(signals(), std=np.full((16, 3000), np.inf)), WHITE)


def shifted(shift_px: float, gain: float, noise: float, seed: int) -> tuple[np.ndarray, ...]:
    """Signals of a peak that is displaced and brighter, their model, its slope and their deviations."""
    x = np.linspace(-4, 4, 400)
    model, slope = 5 * np.exp(-(x**2) / 2), 5 * x * np.exp(-(x**2) / 2)
    data = gain * (model + shift_px * slope) + noise * np.random.default_rng(seed).standard_normal(400)
    return data, model, slope, np.full(400, noise)


def test_displacement_and_gain_are_told_apart() -> None:
    data, model, slope, std = shifted(0.2, 1.5, 1e-9, 0)
    shift, gain, *_ = _shift(data, model, slope, std + 1e-3)
    assert shift == pytest.approx(0.2)
    assert gain == pytest.approx(1.5)
    # A few signals that are far off count for little.
    data[::40] += 5.0
    shift, gain, *_ = _shift(data, model, slope, np.full(400, 0.05))
    assert shift == pytest.approx(0.2, abs=0.02)
    assert gain == pytest.approx(1.5, abs=0.03)


def test_displacement_and_gain_scatter_by_what_is_stated() -> None:
    found = np.array([_shift(*shifted(0.1, 1.5, 0.3, seed)) for seed in range(150)])
    assert found[:, 0].mean() == pytest.approx(0.1, abs=3 * found[:, 0].std() / 150**0.5)
    assert found[:, 1].mean() == pytest.approx(1.5, abs=3 * found[:, 1].std() / 150**0.5)
    assert found[:, 0].std() == pytest.approx(found[:, 2].mean(), rel=0.2)
    assert found[:, 1].std() == pytest.approx(found[:, 3].mean(), rel=0.2)


def test_bright_and_faint_signals_that_are_off_by_the_same_share_count_alike() -> None:
    model = np.repeat([5.0, 0.5], 100)
    slope = np.tile([1e-3, -1e-3], 100)
    data = model * np.repeat([1.02, 0.98], 100)
    shift, gain, *_ = _shift(data, model, slope, np.full(200, 1e-9))
    assert gain == pytest.approx(1.0, abs=1e-6)
    assert shift == pytest.approx(0.0, abs=1e-6)
    # Noise of a tenth is far more than three percent of either.
    _, by_noise, *_ = _shift(data, model, slope, np.full(200, 10.0))
    assert by_noise == pytest.approx((25 * 1.02 + 0.25 * 0.98) / 25.25, abs=1e-4)


def test_figures_have_limits_on_both_sides() -> None:
    shift, gain = _film_figures(-1, 0.05, 0.01, 0.98, 0.02)
    assert (shift.low, shift.high, shift.unit) == (-0.2, 0.2, "px")
    assert (gain.low, gain.high) == (0.95, 1.05)
    assert (shift.value, shift.std, gain.value, gain.std) == (0.05, 0.01, 0.98, 0.02)
    assert "order -1" in shift.name


class Expected:
    """What the calibration expects, as given: the zero order, one first order, and another beside it."""

    def __init__(self, zero: np.ndarray, here: np.ndarray, other: np.ndarray, share: float = 1.0) -> None:
        self.zero, self.here, self.other, self.share = zero, here, other, share

    def inside(self, order: int) -> np.ndarray:
        return np.full(self.here.shape[1], self.share)

    def signals(self, orders: tuple[int, ...] = (), shift_px: float = 0.0) -> np.ndarray:
        if orders == (0,) or not orders:
            return self.zero
        return self.other if 0 in orders else self.here * (1 + 0.2 * shift_px)


def even_signals(radiance: np.ndarray, std: float = 0.1) -> PlaneSignals:
    count = radiance.shape[1]
    none = np.zeros(count)
    return PlaneSignals(
        np.arange(count), np.arange(count) % 3, none, none, none[None], radiance, np.full(radiance.shape, std)
    )


def test_the_deviation_of_white_is_that_of_a_median_beside_that_of_the_scale(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    expected = np.full((1, 600), 2.0)
    # Below a fifth of the usual light, and a little above it.
    expected[0, :96], expected[0, 96:132] = 0.39, 0.41
    monkeypatch.setattr(light, "_Plane", lambda *_: Expected(expected, expected, expected))
    ratio = np.tile(np.repeat([0.9, 1.0, 1.1, 1.3], 3), 50)
    rig = RIG.model_copy(update={"white_scale_rel_std": 0.003})
    for figure in light_drift(rig, even_signals(ratio * expected), WHITE):
        assert figure.value == pytest.approx(1.05)
        # Half of the deviations from the median are within 0.05, the others 0.15 and 0.25.
        spread = 1.4826022185 * (0.05 + 0.15) / 2
        assert figure.std == pytest.approx(np.hypot(1.253314 * spread / np.sqrt(168), 0.003))
        assert (figure.low, figure.high) == (0.97, 1.03)


@pytest.mark.parametrize(("count", "enough"), [(150, True), (147, False)])
def test_fifty_pixels_of_a_colour_are_needed(
    count: int, enough: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    expected = np.ones((1, count))
    monkeypatch.setattr(light, "_Plane", lambda *_: Expected(expected, expected, expected))
    if enough:
        assert len(light_drift(RIG, even_signals(expected), WHITE)) == 3
    else:
        with pytest.raises(CalibrationError, match="Only 49 red pixels"):
            light_drift(RIG, even_signals(expected), WHITE)


def test_first_orders_are_judged_where_they_are_nearly_all_there_is(monkeypatch: pytest.MonkeyPatch) -> None:
    """Signals of an order over its largest, and what else is there over the order, at both limits."""
    count = 1500
    zero, here, other = np.full((1, count), 4.0), np.zeros((1, count)), np.full((1, count), 1e-4)
    here[0, :500] = 1.0
    here[0, 500:550], here[0, 550:600] = 0.019, 0.021
    other[0, :50], other[0, 50:100] = 0.021, 0.019
    monkeypatch.setattr(light, "_Plane", lambda *_: Expected(zero, here, other))
    asked: list[tuple[np.ndarray, ...]] = []

    def noted(*parts: np.ndarray) -> tuple[float, float, float, float]:
        asked.append(parts)
        return 0.01, 1.0, 0.001, 0.002

    monkeypatch.setattr(light, "_shift", noted)
    lines = even_signals(8.0 + np.arange(count)[None] * 1e-3)
    film_drift(RIG, lines, WHITE)
    scale = float(np.median(lines.radiance / zero))
    chosen = np.r_[50:500, 550:600]
    for data, model, slope, std in asked:
        assert len(data) == len(chosen)
        assert model == pytest.approx(here[0, chosen])
        assert data == pytest.approx(lines.radiance[0, chosen] / scale - other[0, chosen])
        assert slope == pytest.approx(0.2 * here[0, chosen])
        assert std == pytest.approx(np.full(len(chosen), 0.1 / scale))


def test_signals_far_off_pull_as_those_at_the_limit() -> None:
    """At the solution the clipped deviations add up to nothing (Huber 1981)."""
    rng = np.random.default_rng(2)
    data = 1 + 0.1 * rng.standard_normal(300)
    data[:60] += 0.5
    slope = np.tile([1e-3, -1e-3], 150)
    _, gain, *_ = _shift(data, np.ones(300), slope, np.full(300, 1e-6))
    off = data - gain
    scale = 1.4826022185 * float(np.median(np.abs(off)))
    pulls = [abs(float(np.clip(off / scale, -limit, limit).mean())) for limit in (1.345, 2.0, 0.9)]
    assert pulls[0] < 5e-3
    assert min(pulls[1:]) > 0.02


@pytest.mark.parametrize(
    ("count", "share", "figures"),
    [
        (200, 0.61, ["displacement of order", "brightness of order"]),
        (200, 0.59, ["light of order", "brightness of order"]),
        (200, 0.41, ["light of order", "brightness of order"]),
        (200, 0.39, ["light of order"]),
        (199, 0.61, ["signals of order"]),
        (199, 0.39, ["signals of order"]),
    ],
)
def test_an_order_of_which_too_little_is_seen_is_not_judged(
    count: int, share: float, figures: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    zero, here = np.full((1, 600), 4.0), np.zeros((1, 600))
    here[0, :count] = 1.0
    expected = Expected(zero, here, 1e-6 * here, share)
    monkeypatch.setattr(light, "_Plane", lambda *_: expected)
    monkeypatch.setattr(light, "_shift", lambda *_: (9.0, 1.0, 0.1, 0.1))
    found = film_drift(RIG, even_signals(zero + 1e-3), WHITE)
    assert [figure.name[: len(name)] for figure, name in zip(found, 2 * figures, strict=True)] == 2 * figures
    assert [figure.passed for figure in found] == [not f.name.startswith("displacement") for f in found]
    told = [figure for figure in found if "too" in figure.name]
    value = pytest.approx(100 * share) if count == 200 else count
    assert all(figure.value == value and figure.advice for figure in told)
    # Pixels that are spoilt are no fault of the film.
    spoilt = even_signals(zero + 1e-3)
    spoilt.std[0, :10] = np.inf
    if count == 200 and share > 0.4:
        with pytest.raises(CalibrationError, match="lights only 190 of the chosen pixels"):
            film_drift(RIG, spoilt, WHITE)


def test_light_from_outside_the_picture_is_none_of_an_orders_share() -> None:
    """Of a film with more lines per mm, orders are farther away and wider."""
    shares = []
    for lines_per_mm in (300.0, 500.0, 1000.0, 1600.0):
        film = RIG.film.model_copy(update={"lines_per_mm": lines_per_mm})
        plane = light._Plane(RIG.model_copy(update={"film": film}), signals(), WHITE)
        inside = plane.inside(1)
        assert inside.shape == (len(CHOSEN),)
        assert inside.min() >= 0.0
        assert inside.max() <= 1.0 + 1e-9
        shares.append(inside.mean())
    assert shares == sorted(shares, reverse=True)
    assert shares[0] > 0.7
    assert shares[-1] < 0.05
