"""A motion of the film is found in the columns of the orders; what no motion does, or noise, is none."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch

from dsl_core.model.plan import CapturePlan, ScanLines
from dsl_core.model.rig import Rig
from dsl_core.model.spectral import WavelengthGrid
from dsl_core.optics.correspondence import GratingModel
from dsl_core.optics.spectra import ORDERS
from dsl_core.reconstruction.spectral.film_motion import FIELDS, FilmMotion, fit_motion, with_film
from dsl_core.reconstruction.spectral.probing.curve_probe import KNOTS_NM
from dsl_core.reconstruction.spectral.probing.line_probe import LineProbe
from dsl_core.reconstruction.spectral.probing.probe import Probe
from dsl_core.reconstruction.spectral.probing.probed_light import PARAMETERS, ProbedScan
from dsl_core.reconstruction.spectral.probing.probed_pixels import CELLS, cell_of, sample_pixels
from dsl_core.reconstruction.spectral.solving.prior import Prior
from dsl_core.reconstruction.spectral.solving.tile_frames import Pixels
from dsl_core.reconstruction.spectral.spectra import model_of_plan
from dsl_core.simulation.published_rig import published_rig

SHAPE, DEPTH_MM = (72, 112), 700.0
#: What each pixel knows of its parameters, in deviations.
STD = np.where(np.char.startswith(PARAMETERS, "s"), 0.15, 0.05)


@pytest.fixture(scope="module")
def scan() -> ProbedScan:
    rig = published_rig()
    rig = rig.model_copy(update={"camera": rig.camera.resized(SHAPE[1], SHAPE[0])})
    plan = CapturePlan(spectral=ScanLines(width_px=5, step_px=4))
    model = model_of_plan(rig, plan, WavelengthGrid(step_nm=10.0), GratingModel(rig))
    none = np.zeros(SHAPE, np.float32)
    depth = np.full(SHAPE, DEPTH_MM, np.float32)
    pixels = Pixels(none, depth, none, none, none, none, none, none, none, np.ones(SHAPE, bool))
    return ProbedScan(model, pixels, none[None], none[None], Prior())


def probed(asked: dict[str, np.ndarray[tuple[int], np.dtype[np.float64]]], seed: int = 0) -> Probe:
    """A probe of pixels that ask for parameters (n,), with noise."""
    pixel = sample_pixels(np.ones(SHAPE, bool), 8)
    rows, columns = np.divmod(pixel, SHAPE[1])
    count, p = len(pixel), len(PARAMETERS)
    wanted = STD * np.random.default_rng(seed).standard_normal((count, p))
    for name, values in asked.items():
        wanted[:, PARAMETERS.index(name)] += values
    normal = np.broadcast_to(np.diag(STD**-2.0), (count, p, p)).copy()
    return Probe(
        normal=normal, score=wanted / STD**2, bias=np.zeros((count, 1, p)), reflectance=np.ones((count, 1)),
        chi_square=np.ones(count), correlation=np.ones(count),
        place=np.stack([2 * rows / SHAPE[0] - 1, 2 * columns / SHAPE[1] - 1], 1),
        cell=cell_of(rows, columns, SHAPE), pixel=pixel,
        lines=LineProbe(np.eye(2)[None], np.zeros((1, 2)), np.ones(1)), nm_per_px=2.0,
    )  # fmt: skip


def displaced(rig: Rig, changes: np.ndarray[tuple[int], np.dtype[np.float64]]) -> Probe:
    """What the pixels ask for when the film has moved: columns at three wavelengths, traced."""
    pixel = torch.as_tensor(sample_pixels(np.ones(SHAPE, bool), 8))
    depth = torch.full((len(pixel),), DEPTH_MM, dtype=torch.float64)
    nm = np.array([440.0, 550.0, 660.0])
    asked = {}
    for order in ORDERS:
        here, there = (
            GratingModel(each).exact(pixel, depth, order, nm).columns.numpy()
            for each in (rig, with_film(rig, changes))
        )
        first, middle, last = there - here
        asked[f"shift {order:+d}"] = (first + middle + last) / 3
        asked[f"stretch {order:+d}"] = (last - first) / 2
    return probed(asked)


@pytest.mark.parametrize(
    "changes",
    [[0.0, 0.1, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 0.0, 0.3], [0.0, 0.1, 0.2, 2e-4, 0.2]],
)
def test_a_motion_is_found_within_its_deviations(scan: ProbedScan, changes: list[float]) -> None:
    truth = np.array(changes)
    found = fit_motion(scan, displaced(scan.model.rig, truth))
    assert isinstance(found, FilmMotion)
    off = np.abs(found.values - truth)[found.values != 0] / found.std[found.values != 0]
    assert (off < 4).all(), dict(zip(FIELDS, found.values, strict=True))
    assert ((found.values != 0) | (truth < 5 * found.std)).all()
    assert found.shift_px > 5 * found.shift_std_px


def test_the_coarser_the_bands_the_more_a_film_must_have_moved(scan: ProbedScan) -> None:
    moved = displaced(scan.model.rig, np.array([0.0, 0.06, 0.0, 0.0, 0.0]))
    found = {nm: fit_motion(scan, replace(moved, step_nm=nm)) for nm in (5.0, 8.0, 10.0)}
    assert found[5.0] is not None
    assert 0.02 * (8 / 5) ** 2 < found[5.0].shift_px < 0.02 * (10 / 5) ** 2
    assert [nm for nm, each in found.items() if each is not None] == [5.0, 8.0]


def test_noise_is_no_motion(scan: ProbedScan) -> None:
    assert [fit_motion(scan, probed({}, seed)) for seed in range(8)] == [None] * 8


def test_lines_that_are_not_symmetric_are_no_motion(scan: ProbedScan) -> None:
    both = np.full(8 * 48, 0.04)
    assert fit_motion(scan, probed({"shift +1": both, "shift -1": both})) is None


def test_displacement_of_a_corner_is_no_motion_of_the_film(scan: ProbedScan) -> None:
    pixel = sample_pixels(np.ones(SHAPE, bool), 8)
    down, across = np.divmod(cell_of(*np.divmod(pixel, SHAPE[1]), SHAPE), CELLS[1])
    corner = np.where((down < 2) & (across < 2), 1.0, 0.0)
    assert fit_motion(scan, probed({"shift +1": corner, "shift -1": corner})) is None


def test_a_small_piece_of_one_colour_tells_nothing(scan: ProbedScan) -> None:
    slipped = displaced(scan.model.rig, np.array([0.0, 0.1, 0.0, 0.0, 0.0]))
    assert fit_motion(scan, replace(slipped, places=False)) is None


def with_curves_off(rig: Rig, moved_mm: float) -> Probe:
    """A film that has moved away by so much, and curves by whose errors it seems to have moved by 0.3 mm.

    What pixels see of the places of the orders is both together; colours see the curves alone.
    """
    pixels = displaced(rig, np.array([0.0, 0.0, 0.0, 0.0, 0.3]))
    count, own, knots = len(pixels.pixel), len(PARAMETERS), 3 * len(KNOTS_NM)
    random = np.random.default_rng(3)
    seen = np.array(
        [list(PARAMETERS).index(f"{kind} {order:+d}") for kind in ("shift", "stretch") for order in ORDERS]
    )
    alike = np.zeros((count, own))
    alike[:, seen] = ((pixels.score - probed({}).score) * STD**2)[:, seen]  # without its noise
    off = 0.05 * np.where(np.arange(knots) % 2, 1.0, -1.0)
    model = np.zeros((count, own + knots, own + knots))
    model[:] = np.eye(own + knots)
    model[:, :own, own:] = alike[..., None] * off / (off @ off)
    std = np.r_[STD, np.full(knots, 0.1)]
    truth = np.concatenate([alike * moved_mm / 0.3, np.tile(off, (count, 1))], 1)
    data = (model @ truth[..., None])[..., 0] + std * random.standard_normal(truth.shape)
    heavy = model.transpose(0, 2, 1) / std**2
    shapes = np.cos(np.arange(1, 5)[:, None] * np.linspace(0, np.pi, 40))
    normal, score = heavy @ model, (heavy @ data[..., None])[..., 0]
    return replace(
        pixels,
        normal=normal[:, :own, :own],
        score=score[:, :own],
        reflectance=0.5 + 0.2 * random.uniform(-1, 1, (count, 4)) @ shapes,
        with_curves=(normal, score),
    )


@pytest.mark.parametrize(("moved_mm", "found"), [(0.0, False), (0.5, True)])
def test_what_curves_do_that_are_off_is_no_motion(scan: ProbedScan, moved_mm: float, found: bool) -> None:
    probe = with_curves_off(scan.model.rig, moved_mm)
    assert probe.curves is not None
    assert probe.curves.rms > 0.02
    # Who does not look at the colours takes both for one motion.
    taken_in = fit_motion(scan, replace(probe, with_curves=None))
    assert taken_in is not None
    assert taken_in.values[4] > moved_mm + 0.2
    motion = fit_motion(scan, probe)
    assert (motion is not None) == found
    if motion is not None:
        assert abs(motion.values[4] - moved_mm) < 3 * motion.std[4]


def test_a_small_slip_of_one_kind_is_not_shared_out_among_all_kinds(scan: ProbedScan) -> None:
    slip = np.array([0.0, 0.0, 0.0, 0.0, 0.1])
    found = fit_motion(scan, displaced(scan.model.rig, slip))
    assert found is not None
    assert np.flatnonzero(found.values).tolist() == [4]
    assert abs(found.values[4] - 0.1) < 3 * found.std[4] < 0.1


@pytest.mark.parametrize("far_mm", [0.055, 0.065, 0.08])
def test_one_kind_of_motion_is_found_where_all_five_say_too_little(scan: ProbedScan, far_mm: float) -> None:
    found = fit_motion(scan, displaced(scan.model.rig, np.array([0.0, 0.0, 0.0, 0.0, far_mm])))
    assert found is not None
    assert abs(found.values[4] - far_mm) < 3 * found.std[4]


@pytest.mark.parametrize(("chi_square", "step_nm"), [(1.0, 5.0), (2.0, 5.0), (1.0, 6.0)])
def test_what_is_hardly_chance_and_explains_few_other_pixels_is_in_doubt_where_frames_fit(
    scan: ProbedScan, chi_square: float, step_nm: float
) -> None:
    slipped = displaced(scan.model.rig, np.array([0.0, 0.0, 0.0, 0.0, 0.05]))
    found = fit_motion(
        scan, replace(slipped, step_nm=step_nm, chi_square=0 * slipped.chi_square + chi_square)
    )
    if chi_square > 1 or step_nm > 5:
        assert found is None
        return
    assert found is not None
    assert not found.sure
