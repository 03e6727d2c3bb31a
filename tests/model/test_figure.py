"""A figure passes at its limits and fails beyond them, and shows the digits that its deviation allows."""

from __future__ import annotations

import pytest

from dsl_core.model.figure import Figure, failures, with_std_in_places


@pytest.mark.parametrize(
    ("value", "passed"), [(1.8, True), (2.6, True), (1.7999, False), (2.6001, False), (2.2, True)]
)
def test_limits_are_part_of_what_passes(value: float, passed: bool) -> None:
    assert Figure(name="gamma", value=value, unit="1", low=1.8, high=2.6).passed == passed


def test_a_figure_without_limits_passes_and_says_none() -> None:
    figure = Figure(name="stage", value=-1e9, unit="mm")
    assert figure.passed
    assert figure.limits == ""
    assert Figure(name="stage", value=0, unit="mm", low=0.5).limits == "at least 0.5 mm"
    assert Figure(name="stage", value=0, unit="mm", high=1234.5).limits == "at most 1234 mm"


@pytest.mark.parametrize(
    ("value", "low", "high", "text"),
    [
        (0.0123456, None, 0.5, "0.012"),
        (0.0001234, None, 0.5, "0.000"),
        (-0.0001234, -0.5, 0.5, "0.00"),
        (32.7643, 8.0, None, "32.8"),
        (29.99765, 29.85, 30.15, "29.998"),
        (0.6789, None, 0.0, "0.679"),
        # Rounded they would be said to be within their limits, or outside.
        (0.50004, None, 0.5, "0.50004"),
        (30.1504, 29.85, 30.15, "30.1504"),
        (0.9996, None, 0.9997, "0.9996"),
    ],
)
def test_without_deviation_digits_follow_the_limits(
    value: float, low: float | None, high: float | None, text: str
) -> None:
    figure = Figure(name="error", value=value, unit="px", low=low, high=high)
    assert str(figure) == f"error {text} px"
    assert Figure(name="", value=float(text), unit="", low=low, high=high).passed == figure.passed


@pytest.mark.parametrize(
    ("figure", "text"),
    [
        (Figure(name="gamma", value=2.21, std=0.004, unit="1"), "gamma 2.2100 ± 0.0040"),
        (Figure(name="shift", value=-1.25, std=0.3, unit="px"), "shift -1.25 ± 0.30 px"),
        (Figure(name="black", value=0.000258974, std=4.4e-7, unit="1", high=0.01), "black 0.00026 ± 0.00001"),
        (Figure(name="gamma", value=2.065826, std=2.4e-5, unit="1", low=1, high=3.5), "gamma 2.066 ± 0.001"),
        (Figure(name="side", value=30, std=0.044, unit="mm", low=29.8, high=30.2), "side 30.000 ± 0.044 mm"),
        (Figure(name="frames", value=4000, unit=""), "frames 4000"),
        (Figure(name="frames", value=400, unit=""), "frames 400"),
        (Figure(name="tilt", value=12.3456, unit="degrees"), "tilt 12.3 degrees"),
        (Figure(name="nothing", value=0.0, std=0.0, unit="px"), "nothing 0 px"),
    ],
)
def test_digits_follow_the_deviation(figure: Figure, text: str) -> None:
    assert str(figure) == text


def test_failures_are_the_figures_outside_their_limits() -> None:
    good, bad = (Figure(name="x", value=value, unit="", high=1) for value in (0, 2))
    assert failures((good, bad, good)) == (bad,)


def test_two_digits_of_a_deviation_are_shown() -> None:
    assert with_std_in_places(2.4363, 0.0571, ".3f") == "2.436 ± 0.057"
    assert with_std_in_places(0.15013, 0.00029, ".3f") == "0.15013 ± 0.00029"
    assert with_std_in_places(-0.041, 12.0, "+.3f") == "-0.041 ± 12.000"
    assert (with_std_in_places(0.5, None, ".4f"), with_std_in_places(0.5, 0.0, ".1f")) == (
        "0.5000",
        "0.5 ± 0.0",
    )
    assert with_std_in_places(0.5, float("nan"), ".1f") == "0.5 ± unknown"
