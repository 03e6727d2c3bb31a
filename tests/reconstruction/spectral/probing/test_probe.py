"""Which pixels are probed, what they weigh, and whether they can tell where the orders are."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import torch

from dsl_core.model.plan import CapturePlan, GrayCode, ScanLines
from dsl_core.model.spectral import WavelengthGrid
from dsl_core.optics.correspondence import correspondence
from dsl_core.optics.spectra import ORDERS
from dsl_core.reconstruction.spectral.probing import probe as probe_module
from dsl_core.reconstruction.spectral.probing.cell_sums import CellSums
from dsl_core.reconstruction.spectral.probing.curve_probe import KNOTS_NM, variety
from dsl_core.reconstruction.spectral.probing.line_probe import LineProbe
from dsl_core.reconstruction.spectral.probing.probe import ONE_COLOUR, PRIOR_STD, Probe
from dsl_core.reconstruction.spectral.probing.probed_light import PARAMETERS
from dsl_core.reconstruction.spectral.probing.probed_pixels import samples_of
from dsl_core.reconstruction.spectral.spectra import SpectralReconstruction
from tests.cases.twin_scan import solver_input, twin_scan

RISING = np.linspace(0.2, 0.6, 24)
NM = np.arange(430.0, 661.0, 5.0)


def test_one_colour_at_many_levels_has_no_variety() -> None:
    levels = np.linspace(0.3, 1.0, 40)[:, None]
    assert variety(levels * RISING) == pytest.approx(0.0, abs=1e-12)
    noise = 0.01 * np.random.default_rng(0).standard_normal((40, 24))
    assert variety(levels * RISING + noise) < ONE_COLOUR


def test_a_few_pixels_of_another_colour_are_a_variety() -> None:
    spectra = np.tile(RISING, (40, 1))
    spectra[:4] = RISING[::-1]
    assert variety(spectra) > 2 * ONE_COLOUR


def test_neighbouring_residuals_that_go_together_count_until_they_first_do_not() -> None:
    # Two pixels; of the first one two samples. Autocorrelations of 1, 2/3, 1/3 and of 1, -1/2.
    rows = torch.tensor([[1, 1, 1, 0, 0, 0], [1, 1, 1, 0, 0, 0], [0, 1, -1, 0, 1, -1]], dtype=torch.float64)
    owner = torch.tensor([0, 0, 1])

    def gather(values: torch.Tensor) -> torch.Tensor:
        return torch.zeros(2, dtype=values.dtype).index_add_(0, owner, values)

    assert probe_module._correlation([rows], gather).tolist() == pytest.approx([1 + 2 * (2 / 3 + 1 / 3), 1.0])
    # The last line of one order is no neighbour of the first one of another.
    two = [torch.tensor([[0.0, 1.0]]), torch.tensor([[1.0, 0.0]])]
    assert probe_module._correlation(two, lambda values: values).tolist() == [1.0]
    # Nothing divides by nothing, and only eight lags count.
    long = torch.ones((1, 30), dtype=torch.float64)
    wanted = 1 + 2 * sum(1 - lag / 30 for lag in range(1, 9))
    assert probe_module._correlation([long], lambda values: values).tolist() == pytest.approx([wanted])
    assert probe_module._correlation([0 * long], lambda values: values).tolist() == [1.0]


@pytest.mark.slow
def test_pixels_ask_for_the_same_however_bright_surfaces_are_thought_to_be() -> None:
    plan = CapturePlan(code=GrayCode(rows=False), spectral=ScanLines(width_px=5, step_px=4))
    devices, scan = twin_scan(plan, size="64x48", scene="plane")
    assert devices.calibration is not None
    stack, pixels = solver_input(devices.calibration, scan)
    data = (devices.calibration, plan, WavelengthGrid(step_nm=10.0), correspondence(devices.calibration))
    whole = SpectralReconstruction(*data, stack.radiance, stack.std, pixels).probed
    asked = []
    for level in (0.1, 1.0):
        found = probe_module.probe(replace(whole, prior=replace(whole.prior, level=level)))
        assert found is not None
        sums = CellSums.of(found, np.tile(np.eye(len(PARAMETERS)), (len(found.score), 1, 1)))
        fit = sums.fit(np.array(PRIOR_STD))
        asked.append(fit.values / np.sqrt(np.diag(fit.covariance)))
    # With the pull of the prior they differ by two deviations.
    assert np.abs(asked[1] - asked[0]).max() < 0.3


def probe_of(**more: Any) -> Probe:
    """Four pixels that say little."""
    p = len(PARAMETERS)
    values: dict[str, Any] = {
        "normal": np.broadcast_to(np.eye(p), (4, p, p)).copy(), "score": np.zeros((4, p)),
        "bias": np.zeros((4, 1, p)), "reflectance": np.ones((4, 1)), "chi_square": np.ones(4),
        "correlation": np.ones(4), "place": np.zeros((4, 2)), "cell": np.zeros(4, np.int64),
        "pixel": np.arange(4), "lines": LineProbe(np.eye(2)[None], np.zeros((1, 2)), np.ones(1)),
        "nm_per_px": 2.0,
    }  # fmt: skip
    return Probe(**values | more)


def test_pixels_weigh_less_where_frames_fit_less_and_nothing_with_two_surfaces() -> None:
    chi_square, correlation = np.array([0.5, 2.0, 1.0, 40.0]), np.array([1.0, 1.5, 0.5, 1.0])
    found = probe_of(chi_square=chi_square, correlation=correlation)
    assert found.sound.tolist() == [True, True, True, False]
    assert found.weight == pytest.approx([1.0, 1 / 3, 1.0, 0.0])
    score = np.zeros((4, len(PARAMETERS)))
    score[1, 0] = np.nan
    assert probe_of(score=score).weight.tolist() == [1.0, 0.0, 1.0, 1.0]


@pytest.mark.parametrize(("pixels", "each"), [(6000 * 8, 8), (6000 * 10, 10), (6000 * 30, 12), (600, 8)])
def test_as_many_pixels_are_probed_as_the_picture_is_large(
    pixels: int, each: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked = list[int]()
    monkeypatch.setattr(probe_module, "sample_pixels", lambda valid, count: asked.append(count))
    valid = np.zeros((2, pixels), bool)
    valid[0] = True
    probe_module.probe_targets(valid)
    assert asked == [each]


def test_curves_say_nothing_where_nobody_asked() -> None:
    assert probe_of().curves is None


def test_what_is_read_for_a_probe_are_its_pixels_and_the_samples_around_them() -> None:
    valid = np.ones((40, 60), bool)
    targets = probe_module.probe_targets(valid)
    found = probe_module.probed_pixels(valid, "RGGB")
    assert (np.diff(found) > 0).all()
    assert set(targets) < set(found)
    assert set(found) == set(targets) | set(samples_of(targets, (40, 60), "RGGB")[0])
    assert set(probe_module.probed_pixels(valid, "MONO")) == set(targets)


def probed(monkeypatch: pytest.MonkeyPatch, share: float, varied: bool, **model: Any) -> Probe | None:
    """A probe of a hundred pixels of a camera that is wide by so much of a distance."""
    spectra = np.tile(RISING, (100, 1))
    if varied:
        spectra[:10] = RISING[::-1]
    asked, count = list[int](), len(PARAMETERS)

    def some(scan: Any, targets: np.ndarray) -> dict[str, np.ndarray]:
        asked.append(len(targets))
        number = np.arange(sum(asked) - len(targets), sum(asked))
        matrix = number[:, None, None] + np.arange(count + 3) / 100 + 0.5 * np.arange(count + 3)[:, None]
        names = ("chi_square", "correlation", "place", "cell", "pixel")
        return {
            "normal": matrix, "score": matrix[:, 0], "bias": matrix, "reflectance": spectra[number],
        } | dict.fromkeys(names, number)  # fmt: skip

    monkeypatch.setattr(probe_module, "_probe_some", some)
    monkeypatch.setattr(probe_module, "probe_targets", lambda valid: np.arange(int(valid.sum())))
    monkeypatch.setattr(probe_module, "widths_at", lambda *_: None)
    monkeypatch.setattr(probe_module, "_lines", lambda *_: "of lines")
    monkeypatch.setattr(probe_module, "_columns", lambda *_: dict.fromkeys(ORDERS, (None, None)))
    monkeypatch.setattr(probe_module, "_nm_per_px", lambda *_: 2.0)
    monkeypatch.setattr(probe_module, "_sideways", lambda *_: None)
    monkeypatch.setattr(probe_module, "_white", lambda *_: np.exp(0.1 * NM)[None, None])
    camera = SimpleNamespace(width_px=1000 * share, fx_px=1000.0)
    rig = SimpleNamespace(camera=camera, sensor=SimpleNamespace(bayer="RGGB"))
    given = {
        "single": True, "lines": (), "response": lambda _: None, "rig": rig,
        "bands": SimpleNamespace(step_nm=5.0, centres_nm=NM, reported=slice(None)),
    }  # fmt: skip
    size = model.pop("pixels", 100)
    scan: Any = SimpleNamespace(
        model=SimpleNamespace(**given | model),
        pixels=SimpleNamespace(
            valid=np.ones(size, bool), column_px=np.zeros(size), amplitude=np.ones((1, size)),
            column_std_px=np.zeros(size),
        ), radiance=None, std=None,
    )  # fmt: skip
    found = probe_module.probe(scan)
    assert found is None or asked == [48, 48, 4]
    return found


@pytest.mark.parametrize(
    ("share", "varied", "tells"),
    [(0.21, False, True), (0.19, False, False), (0.19, True, True), (0.5, True, True)],
)
def test_pixels_tell_where_orders_are_in_a_wide_picture_or_one_of_several_colours(
    share: float, varied: bool, tells: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    found = probed(monkeypatch, share, varied)
    assert found is not None
    assert found.places == tells


def test_the_parameters_come_first_and_curves_after_them(monkeypatch: pytest.MonkeyPatch) -> None:
    found, own = probed(monkeypatch, 1.0, True), len(PARAMETERS)
    assert found is not None
    assert found.with_curves is not None
    normal, score = found.with_curves
    assert (normal.shape, score.shape) == ((100, own + 3, own + 3), (100, own + 3))
    assert found.normal.tolist() == normal[:, :own, :own].tolist()
    assert found.score.tolist() == score[:, :own].tolist()
    assert found.pixel.tolist() == list(range(100))
    assert (found.nm_per_px, found.step_nm) == (2.0, 5.0)
    assert found.steepness == pytest.approx(0.1)
    # Light of a twentieth of the brightest is 30 nm away from the end of the bands.
    assert found.bright is not None
    assert found.bright.tolist() == (KNOTS_NM > 660 - 30).tolist()


def test_fewer_than_forty_pixels_say_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    assert probed(monkeypatch, 1.0, True, pixels=39) is None


@pytest.mark.parametrize("single", [True, False])
def test_only_single_lines_show_the_zero_order_alone(single: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    found = probed(monkeypatch, 1.0, True, single=single)
    assert found is not None
    assert (found.lines is None) is not single


def test_wavelengths_are_those_between_columns_whichever_way_they_run() -> None:
    columns = torch.tensor([[100.0, 300.0], [140.0, 260.0], [200.0, 250.0]])
    bands = SimpleNamespace(centres_nm=np.array([400.0, 500.0, 550.0]))
    scan: Any = SimpleNamespace(model=SimpleNamespace(bands=bands))
    # 150 nm over a hundred columns and over fifty, 75 in the mean.
    assert probe_module._nm_per_px(scan, columns) == pytest.approx(2.0)


def test_lines_to_the_sides_of_own_columns_are_those_that_arrive() -> None:
    columns = torch.tensor([[100.0, 300.0], [torch.nan, 260.0], [0.0, 250.0]])

    def trace(where: torch.Tensor, depth: torch.Tensor, orders: tuple[int, ...]) -> Any:
        assert depth.tolist() == [7.0, 5.0]
        return SimpleNamespace(orders={order: SimpleNamespace(columns=columns) for order in orders})

    def inside(seen: Any) -> torch.Tensor:
        return torch.as_tensor(seen.columns < 290)  # NaN is nowhere

    rig = SimpleNamespace(projector=SimpleNamespace(width_px=400))
    pixels = SimpleNamespace(depth_mm=np.array([[5.0, 6.0], [7.0, 8.0]]))
    scan: Any = SimpleNamespace(model=SimpleNamespace(trace=trace, inside=inside, rig=rig), pixels=pixels)
    # In half widths from the middle: -0.5 and -1 beside 0.5; 0.3 and 0.25 beside 0.
    own, other = (0.5**2 + 1) / 2 - 0.5**2, (0.3**2 + 0.25**2) / 2
    traced = probe_module._columns(scan, np.array([2, 0]))
    found = probe_module._sideways(scan, torch.tensor([300.0, 200.0]), traced)
    assert found == pytest.approx(np.array([[own, own], [other, other]]))


def test_the_usual_fit_is_that_of_pixels_in_even_light() -> None:
    count, few = 100, probe_module.FEWEST
    chi_square, uneven = np.full(count, 30.0), np.full(count, 0.9)
    chi_square[:few], uneven[:few] = 1.1, 0.1
    found = probe_of(chi_square=chi_square, pixel=np.arange(count), uneven=uneven)
    assert found.usual_chi_square == 1.1
    # Too few say nothing for all, and nobody may have looked.
    uneven = np.where(np.arange(count) == 0, 0.9, uneven)
    for other in (uneven, None):
        few_even = probe_of(chi_square=chi_square, pixel=np.arange(count), uneven=other)
        assert few_even.usual_chi_square == 30.0


def test_what_columns_explain_is_no_misfit_of_the_model() -> None:
    count = probe_module.FEWEST
    known = {"chi_square": np.full(count, 1.7), "pixel": np.arange(count)}
    assert probe_of(**known, by_columns=np.full(count, 0.5)).usual_chi_square == pytest.approx(1.2)


@pytest.mark.parametrize(("std_px", "share"), [(10.0, 1.0), (0.25, 0.5), (0.0, 0.0)])
def test_columns_explain_as_much_as_they_are_unsure(std_px: float, share: float) -> None:
    # Light that is displaced in both orders, of a weight by which a column is known to 0.25.
    changes = torch.zeros((1, 4, len(PARAMETERS)), dtype=torch.float64)
    changes[0, :2, 0], changes[0, 2:, 1] = torch.tensor([1.0, -1.0]), torch.tensor([-1.0, 1.0])
    weight, shift_px = torch.full((1, 4), 4.0, dtype=torch.float64), 0.3
    displaced = (changes[..., 0] + changes[..., 1]) * shift_px
    other = torch.tensor([[0.7, 0.7, 0.7, 0.7]], dtype=torch.float64)
    solved: Any = SimpleNamespace(light=SimpleNamespace(weight=weight), residual=displaced + other)
    found = probe_module.explained_by_columns(solved, changes, np.array([std_px], np.float32))
    assert found.tolist() == pytest.approx([share * float((weight * displaced**2).sum())], rel=1e-3, abs=1e-6)


def test_light_is_uneven_by_neighbours_of_the_same_colour() -> None:
    # A mosaic whose colours differ, with an edge between columns 5 and 6, and one pixel without light.
    light = np.tile(np.array([[1.0, 3.0], [3.0, 2.0]], np.float32), (5, 6))
    light[:, 6:] *= np.float32(0.25)
    light[9, 0] = np.nan
    places = ((4, 2), (4, 5), (0, 11), (1, 1), (8, 10), (9, 2))
    targets = np.array([np.ravel_multi_index(at, light.shape) for at in places])
    assert probe_module.unevenness(light, targets).tolist() == [0.0, 0.75, 0.0, 0.0, 0.0, 1.0]
    assert probe_module.unevenness(np.zeros_like(light), targets).tolist() == [0.0] * 6
