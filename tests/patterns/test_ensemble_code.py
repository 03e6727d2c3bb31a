"""Two codes as one: certain where they agree, in dispute where they do not."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from dsl_core.errors import DecodeError, PlanError
from dsl_core.model.plan import BinaryCode, CapturePlan, EnsembleCode, GrayCode, NoCode, XorCode
from dsl_core.model.presets import CODE_CHOICES, CodeChoice, code_of, name_of
from dsl_core.patterns.binary_code import binary_image, decoder_of
from dsl_core.patterns.gray_code import DecodedCode
from dsl_core.patterns.images import pattern_image

SIZE = (640, 360)
BOTH = EnsembleCode(rows=False)


def frames_of(code: BinaryCode, size: tuple[int, int] = SIZE) -> NDArray[np.float64]:
    """All pairs of a code, (frames, height, width)."""
    count = CapturePlan(projector_size_px=size, code=code).code_count
    return np.stack([binary_image(code, size, i) for i in range(count)]).astype(float)


def decode(
    frames: NDArray[np.float64], code: BinaryCode, std: float | None = None, size: tuple[int, int] = SIZE
) -> DecodedCode:
    decoder = decoder_of(code, size)
    for one, other in zip(frames[::2], frames[1::2], strict=True):
        decoder.add(one, other, None if std is None else np.full(one.shape, std))
    return decoder.finish()


@pytest.mark.parametrize("choice", CODE_CHOICES, ids=lambda choice: choice.name)
def test_every_code_on_offer_is_shown_and_read_back(choice: CodeChoice) -> None:
    code = choice.code
    size = (37, 20)
    found = decode(frames_of(code, size), code, size=size)
    rows, columns = np.indices(size[::-1])
    np.testing.assert_array_equal(found.column, columns)
    np.testing.assert_array_equal(found.likely_column, columns)
    assert not found.undecided.any()
    if code.rows:
        np.testing.assert_array_equal(found.row, rows)
    assert code_of(name_of(code) or "") == code
    assert CapturePlan.model_validate_json(CapturePlan(code=code).model_dump_json()).code == code


def test_names_of_codes_are_unique_and_none_is_no_code() -> None:
    assert len({choice.name for choice in CODE_CHOICES}) == len(CODE_CHOICES)
    assert len({choice.title for choice in CODE_CHOICES}) == len(CODE_CHOICES)
    assert name_of(NoCode()) is None
    assert code_of("gray") is None


def test_an_ensemble_takes_both_codes_and_white_and_black_once() -> None:
    plan = CapturePlan(code=BOTH)
    gray = CapturePlan(code=GrayCode(rows=False))
    assert (gray.code_count, plan.code_count) == (20, 40)
    assert CapturePlan(code=XorCode(rows=False)).code_count == 20
    assert CapturePlan(code=EnsembleCode()).code_count == 2 * CapturePlan().code_count
    # Two settings of 1/6 and 1/3 s.
    assert plan.duration_s() - gray.duration_s() == pytest.approx(20 * 0.5)
    shots = [shot for shot in plan.shots() if shot.role == "code" and shot.setting == 1]
    assert [shot.pattern for shot in shots] == list(range(40))
    first, second = (pattern_image(plan, shots[i])[0, :, 0] for i in (0, 20))
    assert np.count_nonzero(np.diff(first.astype(int))) == 1
    assert np.count_nonzero(np.diff(second.astype(int))) > 100
    with pytest.raises(PlanError, match="Frame 22"):
        binary_image(BOTH, SIZE, 42)


def test_missing_pairs_are_told() -> None:
    with pytest.raises(DecodeError, match="incomplete"):
        decode(frames_of(BOTH)[:38], BOTH)


def test_agreement_is_straight_and_neighbours_lie_at_the_edge_between() -> None:
    frames = frames_of(BOTH)[:, :1]
    # The finest bit of the Gray code is read as that of column 0, as happens at the edge between.
    frames[18:20, 0, 1] = frames[18:20, 0, 0]
    found = decode(frames, BOTH, std=1.0)
    assert found.at_edge is not None
    assert found.straight is not None
    assert found.rival_column is not None
    assert np.flatnonzero(found.at_edge[0]).tolist() == [1]
    assert found.likely_column[0, :3].tolist() == [0, 0, 2]
    assert found.straight.all()
    assert (found.rival_column == -1).all()


def test_light_by_another_way_is_disputed_and_the_fine_stripes_believed() -> None:
    columns = slice(50, 400)
    straight = frames_of(BOTH)[:, 0]
    smear = np.ones(41) / 41
    far = np.stack([np.convolve(np.roll(line, -200), smear, "same") for line in straight])
    found = decode((0.4 * straight + 0.6 * far)[:, columns], BOTH, std=1.0)
    alone = decode((0.4 * straight + 0.6 * far)[:20, columns], GrayCode(rows=False), std=1.0)
    truth = np.arange(50, 400)
    wrong = np.abs(alone.likely_column - truth) > 1
    assert found.rival_column is not None
    assert wrong.mean() > 0.3
    np.testing.assert_array_equal(found.likely_column, truth)
    np.testing.assert_array_equal(found.rival_column, np.where(wrong, alone.likely_column, -1))


def test_where_fine_stripes_blur_the_gray_code_is_believed_but_disputed() -> None:
    frames = frames_of(BOTH)[:, 0]
    rng = np.random.default_rng(1)
    blurred = frames.copy()
    blurred[20:] = 127.5 + rng.normal(0, 2.0, frames[20:].shape)
    found = decode(blurred, BOTH, std=2.0**1.5)
    assert found.rival_column is not None
    assert found.straight is not None
    disputed = found.rival_column >= 0
    assert disputed.mean() > 0.95
    assert not found.straight[disputed].any()
    np.testing.assert_array_equal(found.likely_column[disputed], np.arange(640)[disputed])
