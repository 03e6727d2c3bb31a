"""What is taken off the frames of a scan for what they say of its light, on pictures made by hand."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from dsl_core.reconstruction.hdr import MergedFrame
from dsl_core.reconstruction.light import followed
from dsl_core.reconstruction.light.room_flicker import RoomFlicker
from dsl_core.reconstruction.light.setting_ratios import Ratio
from dsl_core.reconstruction.light.steady import SteadyLight
from dsl_core.reconstruction.merge import Exposed
from tests.cases.scan_light import COUNT, PLAN, course_of, levels_of, scan_of, shots_of


def test_shots_of_a_pattern_agree_with_that_of_its_last_setting() -> None:
    scan = scan_of()
    scan.ratios = {("spectral", k): (Ratio(0.03 + k, 0.01), Ratio(0, 0)) for k in range(COUNT)}
    scan.ratios["spectral", 2] = (None, Ratio(0, 0))
    apart = replace(course_of(), settings=(-0.2,))
    for course in (course_of(0.1), course_of(0.1, 0.05), apart):
        found = followed._between_settings(scan, course, None).levels
        wanted = np.ones(PLAN.shot_count)
        for k in range(COUNT):
            first, last = shots_of("spectral", k)
            drift = course.log[first.index] - course.log[last.index]
            drift += -0.2 if course.settings else 0.0
            wanted[first.index] = np.exp(0.03 + k if course.flickers and k != 2 else drift)
        assert found[[shot.index for shot in PLAN.shots() if shot.role == "spectral"]] == pytest.approx(
            wanted[[shot.index for shot in PLAN.shots() if shot.role == "spectral"]]
        )


def test_a_drift_is_taken_off_as_it_is() -> None:
    course = course_of(0.1)
    lasts = [shots_of("spectral", k)[-1].index for k in range(COUNT)]
    for lines in (None, levels_of()):
        light = followed._steady(scan_of(), course, lines)
        assert light.log == pytest.approx(course.log[lasts])
        assert light.std == pytest.approx(course.std[lasts])
        assert light.white == course.log[shots_of("white", 0)[-1].index]
        assert not light.flickers


def test_flicker_is_taken_off_as_far_as_lines_are_sure_of_it() -> None:
    course, lines = course_of(0.1, 0.05, 0.03), levels_of()
    light = followed._steady(scan_of(), course, lines)
    slope = np.linspace(-1 + 1 / COUNT, 1 - 1 / COUNT, COUNT)
    drift = course.log[[shots_of("spectral", k)[-1].index for k in range(COUNT)]]
    std = np.hypot(lines.std, 0.004)
    share = 0.05**2 / (0.05**2 + std**2)
    assert light.log == pytest.approx((1 - share) * drift + share * (lines.log + 0.02 - 0.03 * slope))
    assert light.std == pytest.approx(np.sqrt(share) * std)
    assert light.white == 0.02
    assert light.flickers
    # Without lines there is only the drift.
    assert not followed._steady(scan_of(), course, None).flickers


class Followed:
    """A scan whose light has a course, and what was asked of it."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, before: Any, course: Any, lines: Any) -> None:
        self.asked, self.light = list[str](), list[SteadyLight]()
        courses: Iterator[Any] = iter([before, course])
        shape = (3, 4)
        self.code: Any = SimpleNamespace(column=np.full(shape, 7))
        ones = np.ones(shape, np.float32)
        self.white = MergedFrame(ones, 0.01 * ones, np.zeros(shape, bool))
        monkeypatch.setattr(followed, "light_course", lambda *_: next(courses))
        monkeypatch.setattr(followed, "line_levels", lambda *given: lines)
        monkeypatch.setattr(followed, "room_flicker", lambda *given: self.room)
        self.room: RoomFlicker | None = None
        self.looked: list[int] = []
        self.ratios: dict[Any, Any] = {}

    def expose(self, exposed: Exposed) -> None:
        self.asked.append("expose")
        self.exposed = exposed

    def decode(self, progress: Any) -> tuple[Any, MergedFrame]:
        self.asked.append("decode")
        return self.code, self.white

    def run(self) -> tuple[Any, ...]:
        def look(pixels: Any, progress: Any) -> None:
            self.looked.append(len(pixels))
            scan.ratios = dict(self.ratios)

        scan = scan_of(
            source=SimpleNamespace(read=lambda shot: np.full((3, 4), 400, np.uint16)),
            expose=self.expose,
            follow=self.light.append,
            decode=self.decode,
            look=look,
            pick=lambda pixels, progress: None,
        )
        return followed.follow_light(scan, self.code, self.white, lambda code, white: np.array([3, 50]))


def test_steady_light_is_left_alone_and_looked_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    made = Followed(monkeypatch, course_of(), course_of(), levels_of())
    _, white, findings = made.run()
    assert white is made.white
    assert not made.asked
    assert not made.light
    assert made.looked == [13], "its own twelve pixels and one more of those that were asked for"
    assert len(findings) == 2


def test_frames_are_looked_at_again_without_what_the_room_adds(monkeypatch: pytest.MonkeyPatch) -> None:
    made = Followed(monkeypatch, course_of(), course_of(), levels_of())
    made.room = RoomFlicker({3: 1.5}, {}, 0.7, 0.05)
    _, _, findings = made.run()
    assert made.asked == ["expose", "decode"]
    assert made.looked == [13, 13]
    assert made.exposed.black_dn.tolist() == [1.5 if k == 3 else 0.0 for k in range(PLAN.shot_count)]
    assert findings[0].name == "flicker of the room"


@pytest.mark.parametrize(("misfit", "believed"), [(0.19, True), (0.21, False)])
def test_other_light_at_each_setting_is_taken_off_before_the_frames_are_looked_at_again(
    misfit: float, believed: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    made = Followed(monkeypatch, course_of(0.1), course_of(0.0, 0.05), levels_of(misfit))
    _, white, findings = made.run()
    assert made.asked == ["expose", "decode"]
    assert made.looked == [13, 13]
    assert made.light[0].flickers == believed
    assert white.radiance[0, 0] == pytest.approx(np.exp(-made.light[0].white))
    assert ("corrected" in findings[1].sentence) == believed


def test_too_few_witnesses_find_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    made = Followed(monkeypatch, None, None, None)
    assert made.run()[1:] == (made.white, ())
    assert not made.light


def test_settings_that_a_black_has_made_doubtful_stay_so_when_frames_are_read_again(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """What white says of the light between settings is taken off all the same."""
    asked: list[list[Any]] = []

    def course(witnesses: list[Any], *_: Any) -> Any:
        asked.append(list(witnesses))
        return course_of(0.1)

    made = Followed(monkeypatch, None, None, levels_of())
    monkeypatch.setattr(followed, "light_course", course)
    monkeypatch.setattr(followed, "of_whites", lambda _: iter(()))
    monkeypatch.setattr(followed, "colours_of_whites", lambda _: iter(()))
    monkeypatch.setattr(followed, "black_wander", lambda *_: SimpleNamespace(significant=True))
    made.ratios = {("spectral", k): (Ratio(0.5, 0.01), Ratio(0.0, 0.0)) for k in range(COUNT)}
    made.run()
    assert not any(each.setting is not None for witnesses in asked for each in witnesses)
    first, last = shots_of("spectral", 1)
    drift = course_of(0.1).log
    assert np.log(made.exposed.levels[first.index]) == pytest.approx(drift[first.index] - drift[last.index])
