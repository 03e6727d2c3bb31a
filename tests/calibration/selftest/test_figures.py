"""Each figure of the self-test fails beyond its own limit, and only there."""

from __future__ import annotations

from typing import Any

import pytest

from dsl_core.calibration.selftest.figures import (
    AMBIENT,
    BEAT_PERCENT,
    BLACK,
    BLUR_PX,
    GAMMA_SPREAD_PERCENT,
    HOT,
    LEAST_GAMMA,
    LINEARITY_PERCENT,
    RAMP_PERCENT,
    WAIT_MS,
    selftest_figures,
)
from dsl_core.model.calibration.selftest import (
    AmbientCheck,
    Beat,
    CameraCheck,
    CycleCheck,
    FocusCheck,
    LatencyCheck,
    Measured,
    ProjectorCheck,
    RampCheck,
    SelfTest,
)
from dsl_core.model.figure import Figure, failures


def of(value: float) -> Measured:
    return Measured(value=value, std=0.01)


def beat(exposure_ms: float, percent: float) -> Beat:
    return Beat(
        exposure_ms=exposure_ms,
        channels_percent=(of(0.0), of(percent), of(0.0)),
        ratio_percent=of(0.0),
        floor_percent=0.01,
    )


GOOD = SelfTest(
    camera=CameraCheck(
        bit_depth=12,
        black_level_dn=of(260.0),
        intercept_dn=of(260.0),
        linearity_percent=(of(0.1), of(0.2), of(0.1)),
        useful_dn=4000.0,
        saturation_dn=of(4095.0),
        electrons_per_dn=of(10.0),
        read_noise_dn=of(2.0),
        hot_share=of(1e-5),
    ),
    projector=ProjectorCheck(
        ramps=tuple(
            RampCheck(colour=colour, gamma=of(2.2), residual_percent=of(0.1), falls=0)
            for colour in ("white", "red", "green", "blue")
        ),
        gamma=of(2.2),
        black_fraction=of(0.001),
        black_has_ambient=False,
    ),
    latency=LatencyCheck(blocking_ms=of(25.0), wait_ms=of(0.0), claimed_ms=50.0, stale_frames=0, checked=30),
    cycle=CycleCheck(
        period_ms=of(1000 / 60),
        modulation=of(0.5),
        method="timestamps",
        shortest_ms=1000 / 60,
        wanted_ms=(160.0,),
        advised_ms=(500 / 3,),
        beats=(beat(160.0, 4.0), beat(500 / 3, 0.1)),
    ),
    focus=FocusCheck(camera_px=of(0.8), projector_px=of(0.6), worst_px=of(0.7)),
    ambient=AmbientCheck(rate_dn_per_ms=(of(0.1), of(0.1), of(0.1)), share_of_white=of(0.001)),
    frames=400,
    duration_s=60.0,
)


def with_(part: str, **fields: Any) -> SelfTest:
    return GOOD.model_copy(update={part: getattr(GOOD, part).model_copy(update=fields)})


def ramps(**fields: Any) -> tuple[RampCheck, ...]:
    first, *others = GOOD.projector.ramps
    return (first.model_copy(update=fields), *others)


def test_a_good_rig_passes_though_published_exposures_beat() -> None:
    figures = selftest_figures(GOOD)
    assert failures(figures) == ()
    by_name = {figure.name: figure for figure in figures}
    assert by_name["modulation of the light at 160.00 ms"].high is None
    assert "166.67 ms" in by_name["modulation of the light at 160.00 ms"].advice
    assert by_name["latency from show to light"].value == 25.0
    assert by_name["linearity, largest residual of full scale"].value == 0.2


@pytest.mark.parametrize(
    ("at", "beyond", "name"),
    [
        (
            with_("camera", linearity_percent=(of(LINEARITY_PERCENT),) * 3),
            with_("camera", linearity_percent=(of(0.1), of(0.1), of(LINEARITY_PERCENT + 0.01))),
            "linearity",
        ),
        (with_("camera", black_level_dn=of(10.0)), with_("camera", black_level_dn=of(9.9)), "black level"),
        (
            with_("camera", saturation_dn=of(0.9 * 4095)),
            with_("camera", saturation_dn=of(0.89 * 4095)),
            "saturation",
        ),
        (with_("camera", hot_share=of(HOT)), with_("camera", hot_share=of(2 * HOT)), "hot pixels"),
        (
            with_("camera", step_dn=4),
            with_("camera", step_dn=5),
            "distance of neighbouring values",
        ),
        (with_("projector", gamma=of(3.5)), with_("projector", gamma=of(3.6)), "gamma"),
        (
            with_("projector", ramps=ramps(gamma=of(2.2 * (1 + GAMMA_SPREAD_PERCENT / 101)))),
            with_("projector", ramps=ramps(gamma=of(2.2 * (1 + GAMMA_SPREAD_PERCENT / 99)))),
            "gamma, difference between colours",
        ),
        (
            with_("projector", ramps=ramps(residual_percent=of(RAMP_PERCENT))),
            with_("projector", ramps=ramps(residual_percent=of(RAMP_PERCENT + 0.1))),
            "ramps, rms distance from the power law",
        ),
        (GOOD, with_("projector", ramps=ramps(falls=1)), "ramps, steps that fall"),
        (
            with_("projector", black_fraction=of(BLACK)),
            with_("projector", black_fraction=of(1.1 * BLACK)),
            "projector black",
        ),
        (
            with_("latency", wait_ms=of(WAIT_MS)),
            with_("latency", wait_ms=of(WAIT_MS + 0.1)),
            "latency not waited for",
        ),
        (GOOD, with_("latency", stale_frames=1), "stale frames"),
        (
            with_("cycle", beats=(beat(500 / 3, BEAT_PERCENT + 0.029),)),
            with_("cycle", beats=(beat(500 / 3, BEAT_PERCENT + 0.031),)),
            "modulation of the light at 166.67 ms",
        ),
        (
            with_("focus", projector_px=of(0.0), worst_px=of(BLUR_PX)),
            with_("focus", projector_px=of(0.0), worst_px=of(BLUR_PX + 0.01)),
            "blur of edges, worst third",
        ),
        (
            # Pixels of the camera 4.6 times as wide as the projector's add 1.33 px that is no blur.
            with_("focus", camera_px=of(0.35), projector_px=of(1.61), worst_px=of(2.0)),
            with_("focus", camera_px=of(0.35), projector_px=of(1.61), worst_px=of(2.02)),
            "blur of edges, worst third",
        ),
        (
            with_("ambient", share_of_white=of(AMBIENT)),
            with_("ambient", share_of_white=of(1.1 * AMBIENT)),
            "light with the projector black",
        ),
    ],
)
def test_a_figure_fails_beyond_its_limit(at: SelfTest, beyond: SelfTest, name: str) -> None:
    assert failures(selftest_figures(at)) == ()
    (failed,) = failures(selftest_figures(beyond))
    assert failed.name.startswith(name)
    assert failed.advice


def named(selftest: SelfTest) -> dict[str, Figure]:
    return {figure.name: figure for figure in selftest_figures(selftest)}


def test_bounds_follow_from_the_camera_and_the_projector() -> None:
    found = named(GOOD)
    assert found["saturation"].low == pytest.approx(0.9 * 4095)
    assert found["black level"].low == pytest.approx(5 * 2.0)
    assert (found["gamma"].low, found["gamma"].high) == (LEAST_GAMMA, 3.5)
    assert found["modulation of the light at 166.67 ms"].high == pytest.approx(0.3 + 3 * 0.01)
    assert (LINEARITY_PERCENT, GAMMA_SPREAD_PERCENT, RAMP_PERCENT) == (0.5, 2.0, 1.0)
    assert (HOT, BLACK, AMBIENT, WAIT_MS, BLUR_PX) == (1e-3, 0.01, 0.01, 1.0, 1.5)


def test_a_linear_projector_passes_on_either_side_of_one() -> None:
    for gamma in (0.999996, 1.000004):
        assert failures(selftest_figures(with_("projector", gamma=of(gamma)))) == ()
    assert not named(with_("projector", gamma=of(0.7)))["gamma"].passed


def test_black_that_is_cut_off_blames_no_exposure() -> None:
    long = with_("camera", exposure_offset_ms=of(-0.12))
    assert [each.name for each in failures(selftest_figures(long))] == ["exposure, longer than stated by"]
    cut = with_("camera", exposure_offset_ms=of(-0.12), black_level_dn=of(0.0))
    assert [each.name for each in failures(selftest_figures(cut))] == ["black level"]


def test_the_difference_between_colours_is_a_share_of_gamma_with_its_deviation() -> None:
    uneven = ramps(gamma=Measured(value=2.222, std=0.02))
    found = named(with_("projector", ramps=uneven))["gamma, difference between colours"]
    assert found.value == pytest.approx(1.0)
    assert found.std == pytest.approx(100 * 2**0.5 * 0.02 / 2.2)


def test_latency_is_blocking_and_waiting_together() -> None:
    late = with_(
        "latency",
        blocking_ms=Measured(value=25.0, std=3.0),
        wait_ms=Measured(value=2.0, std=4.0),
        claimed_ms=50.0,
    )
    found = named(late)
    both = found["latency from show to light"]
    assert (both.value, both.std) == (27.0, 5.0)
    assert "from 50 to at least 56 ms" in found["latency not waited for"].advice


@pytest.mark.parametrize(
    ("exposure_ms", "advised_ms", "has_limit"),
    [(160.0, 500 / 3, False), (160.0, 160.0, True), (150.0, 500 / 3, True)],
)
def test_only_published_exposures_that_are_not_advised_may_beat(
    exposure_ms: float, advised_ms: float, has_limit: bool
) -> None:
    cycle = with_("cycle", advised_ms=(advised_ms,), beats=(beat(exposure_ms, 4.0),))
    assert (named(cycle)[f"modulation of the light at {exposure_ms:.2f} ms"].high is not None) == has_limit
