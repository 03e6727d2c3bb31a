"""What white and black have of their first light; nothing where white saturates or is dark."""

from __future__ import annotations

import numpy as np
import pytest

from dsl_core.capture.proof.lasting.settled_light import change_of_light, unsettled_sentence


def counts(value: int) -> np.ndarray:
    return np.full(64, value, np.uint16)


@pytest.mark.parametrize(
    ("role", "seen", "white", "change"),
    [
        ("white", 1330, 1300, 0.03),
        ("black", 310, 1300, 0.01),
        ("white", 4095, 4095, 0.0),
        ("white", 330, 300, 0.0),
        ("black", 330, 4095, 0.0),
    ],
    ids=["white", "black", "saturated", "dark", "black of white that saturates"],
)
def test_the_change_is_a_share_of_the_light_of_white(role: str, seen: int, white: int, change: float) -> None:
    ends = counts(white), counts(300)
    assert change_of_light(counts(seen), ends, role, 4095) == pytest.approx(change)


def test_light_that_went_out_once_and_did_not_come_back_is_no_habit() -> None:
    assert unsettled_sentence("white", -0.9, -0.9, -0.9) == ""
    assert unsettled_sentence("white", -0.9, 0.0, 0.0) == ""
    assert "has 0.10 times" in unsettled_sentence("white", -0.9, 0.0, -0.9)


def test_a_black_level_that_jitters_is_no_afterglow() -> None:
    """Brighter pixels keep more of white; a level is one for all pixels."""
    white = np.linspace(400, 3000, 64).astype(np.uint16)
    ends = white, counts(300)
    glow = np.rint(300 + 0.02 * (white.astype(float) - 300)).astype(np.uint16)
    assert change_of_light(glow, ends, "black", 4095) == pytest.approx(0.02, rel=0.02)
    assert change_of_light(counts(320), ends, "black", 4095) == pytest.approx(0.0, abs=1e-9)
    assert unsettled_sentence("black", -0.02, 0.0, -0.02) == ""
    assert "holds 2.0% of the light of white" in unsettled_sentence("black", 0.02, 0.0, 0.02)


def test_a_camera_of_eight_bits_is_asked_as_well() -> None:
    ends = counts(90), counts(10)
    assert change_of_light(counts(98), ends, "white", 255) == pytest.approx(0.1)
    assert change_of_light(counts(13), (counts(14), counts(10)), "white", 255) == 0.0
