"""What a scan says of its light, on pictures made by hand, and what is taken off its frames for it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from dsl_core.model.plan import CapturePlan, GrayCode, ScanLines, Sentinels, Setting, Shot
from dsl_core.model.rig import ProjectorResponse
from dsl_core.reconstruction.hdr import MergedFrame
from dsl_core.reconstruction.light import followed
from dsl_core.reconstruction.light.course import LightCourse
from dsl_core.reconstruction.light.line_levels import LineLevels
from dsl_core.reconstruction.light.room_flicker import RoomFlicker
from dsl_core.reconstruction.light.setting_ratios import Ratio
from dsl_core.reconstruction.light.steady import SteadyLight
from dsl_core.reconstruction.merge import Exposed
from dsl_core.simulation.published_rig import published_rig

PLAN = CapturePlan(
    code=GrayCode(rows=False),
    spectral=ScanLines(width_px=5, step_px=10),
    projector_size_px=(60, 20),
    sentinels=Sentinels(every=8),
)
COUNT = PLAN.spectral_count


def shots_of(role: str, pattern: int) -> list[Shot]:
    return [shot for shot in PLAN.shots() if (shot.role, shot.pattern) == (role, pattern)]


def scan_of(**more: Any) -> Any:
    """A scan of the plan, as far as its light is concerned."""
    return SimpleNamespace(plan=PLAN, rig=published_rig(), ratios={}, shots_of=shots_of, **more)


def course_of(drift: float = 0.0, flicker: float = 0.0, slope: float = 0.0) -> LightCourse:
    time = np.arange(PLAN.shot_count) / (PLAN.shot_count - 1)
    return LightCourse(drift * time, np.full(len(time), 0.003), 0.02, slope, drift, 0.001, flicker, 0.001)


def levels_of(misfit: float = 0.05) -> LineLevels:
    rng = np.random.default_rng(1)
    return LineLevels(rng.normal(0, 0.05, COUNT), rng.uniform(0.004, 0.01, COUNT), misfit, 0.05)


def test_lines_witness_the_shot_of_their_last_setting_and_share_a_slope_over_the_picture() -> None:
    lines = levels_of()
    heard = list(followed._of_lines(scan_of(), lines))
    for k, (each, log, std) in enumerate(zip(heard, lines.log, lines.std, strict=True)):
        assert each.shot == shots_of("spectral", k)[-1].index
        assert (each.against, each.log, each.setting) == (None, log, None)
        assert each.std == pytest.approx(np.hypot(std, 0.004))
        assert each.slope == pytest.approx((k + 0.5) / (COUNT / 2) - 1)
    assert list(followed._of_lines(scan_of(), None)) == []


def test_settings_witness_each_other() -> None:
    scan = scan_of()
    scan.ratios = {
        ("spectral", 1): (Ratio(0.03, 0.01), Ratio(0.0, 0.0)),
        ("spectral", 0): (None, Ratio(0, 0)),
    }
    (heard,) = followed._of_settings(scan)
    first, last = shots_of("spectral", 1)
    assert (heard.shot, heard.against, heard.log, heard.std) == (first.index, last.index, 0.03, 0.01)
    assert heard.setting == 0


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


def test_settings_that_do_not_agree_are_told_with_the_one_that_is_farthest_off() -> None:
    apart = replace(course_of(), settings=(0.05, -0.2))
    told = next(each for each in followed.light_findings(apart, True) if each.part == "response")
    assert told.significant
    assert told.value == pytest.approx(np.expm1(-0.2))
    assert "Setting 2 is 18.1% darker than setting 3" in told.sentence
    assert "made to agree" in told.sentence
    either = next(iter(followed.light_findings(replace(apart, drift=0.3), True)))
    assert either.part == "light"
    assert any(
        "Or the light drifted" in each.sentence
        for each in followed.light_findings(replace(apart, drift=0.3), True)
    )
    assert all(each.part == "light" for each in followed.light_findings(course_of(), True))


def test_settings_that_do_not_agree_leave_the_level_unsure_as_a_wrong_gamma_does() -> None:
    """Light of levels 0.2 and 0.8 under a gamma of 2.4 instead of 2.2."""
    apart = (0.8 / 0.2) ** -0.2
    course = replace(course_of(), settings=(float(np.log(apart)),))
    two = PLAN.model_copy(update={"settings": CapturePlan().settings})
    # At equal light of both settings, it cannot be a camera that is not proportional to the light.
    alike = tuple(
        setting.model_copy(update={"exposure_ms": 100 / setting.level**2.2}) for setting in two.settings
    )
    two = two.model_copy(update={"settings": alike})
    exact = ProjectorResponse(gamma=2.2)
    unsure = followed.unsure_level(two, exact, followed.light_findings(course, True))
    assert unsure == pytest.approx(1 - 0.8**0.2, rel=0.03)
    assert followed.unsure_level(two, exact, followed.light_findings(course_of(), True)) == 0.0
    once = two.model_copy(update={"settings": (two.settings[1], two.settings[1])})
    assert followed.unsure_level(once, exact, followed.light_findings(course, True)) == 0.0


def test_settings_that_do_not_agree_leave_faint_light_unsure_as_a_camera_with_a_gamma_does() -> None:
    """Values that follow the light to the power 1.03, of exposures of which one is a tenth of the other."""
    level = CapturePlan().settings[1].level
    two = PLAN.model_copy(
        update={
            "settings": (Setting(exposure_ms=20, level=level), Setting(exposure_ms=200, level=level)),
        }
    )
    course = replace(course_of(), settings=(float(np.log(0.1**0.03)),))
    findings = tuple(followed.light_findings(course, True))
    unsure = followed.unsure_level(two, ProjectorResponse(), findings)
    # What is a tenth as bright as white reads so much less, compared with white.
    assert unsure == pytest.approx(-np.log(0.1**0.03), rel=1e-3)


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


def test_whites_are_compared_where_both_are_bright_and_neither_is_saturated() -> None:
    sensor, full = scan_of().rig.sensor, scan_of().rig.sensor.full_scale_dn
    shot, old = shots_of("white", 0)[0], shots_of("white", 0)[-1]
    rng = np.random.default_rng(3)
    first = rng.uniform(0.3, 0.5, (6, 10)) * full
    now = 1.04 * first
    used = np.ones(first.shape, bool)
    for place, (a, b) in {(0, 0): (0.91, 0.5), (0, 1): (0.5, 0.91), (0, 2): (0.1, 0.7)}.items():
        first[place], now[place], used[place] = a * full, b * full, False
    first[0, 3] = now[0, 3] = 0.26 * np.percentile(first, 95)
    first[0, 4] = now[0, 4] = 0.88 * full
    first[0, 5], used[0, 5] = 0.24 * np.percentile(first, 95), False
    found = followed._compared(scan_of(), shot, old, first, now)
    sums = now[used].sum(), first[used].sum()
    assert (found.shot, found.against) == (shot.index, old.index)
    assert found.log == pytest.approx(np.log(sums[0] / sums[1]))
    noise = [
        each / sensor.electrons_per_dn + used.sum() * (sensor.read_noise_dn**2 + 1 / 12) for each in sums
    ]
    assert found.std == pytest.approx(np.sqrt(noise[0] / sums[0] ** 2 + noise[1] / sums[1] ** 2))
    # Of the dark nothing is known, and nothing is divided by zero.
    dark = followed._compared(scan_of(), shot, old, 0 * first, 0 * now)
    assert (dark.log, dark.std) == (0.0, 0.0)


def test_white_is_compared_with_white_less_the_black_next_to_each(monkeypatch: pytest.MonkeyPatch) -> None:
    def read(shot: Shot) -> NDArray[np.uint16]:
        return np.full((2, 2), shot.index, np.uint16)

    heard = list[tuple[Shot, Shot, float, float]]()

    def compared(scan: Any, shot: Shot, old: Shot, first: NDArray[Any], now: NDArray[Any]) -> None:
        heard.append((shot, old, float(first[0, 0]), float(now[0, 0])))

    monkeypatch.setattr(followed, "_compared", compared)
    list(followed._of_whites(scan_of(source=SimpleNamespace(read=read))))
    again = [shot for shot in PLAN.shots() if shot.role == "sentinel"]
    whites = [shot for shot in again if PLAN.original(shot).role == "white"]
    assert [each[0] for each in heard] == whites
    assert whites
    for shot, old, first, now in heard:
        assert old == PLAN.original(shot)
        black = shots_of("black", 0)[old.setting]
        near = [b for b in again if PLAN.original(b).role == "black" and abs(b.index - shot.index) < 4]
        assert first == old.index - black.index
        assert now == shot.index - near[0].index


def test_light_that_changed_at_once_is_told_with_the_frame_from_which_on() -> None:
    told, _ = followed.light_findings(replace(course_of(-0.1), step_at=90), True)
    assert told.significant
    assert told.name == followed.DRIFT
    assert told.sentence.startswith("The light has changed by -9.5% (±0.1%) at once, from about frame 91 on.")
    assert "Which of both was as calibrated, no scan can tell" in told.sentence


def test_findings_say_what_was_corrected() -> None:
    drift, flicker = followed.light_findings(course_of(-0.1, 0.0), True)
    assert (drift.part, drift.limit, drift.significant) == ("light", 0.006, True)
    assert (drift.value, drift.std) == pytest.approx((np.expm1(-0.1), 0.001 * np.exp(-0.1)))
    assert (flicker.value, flicker.std, flicker.limit, flicker.significant) == (0.0, 0.001, 0.008, False)
    assert "-9.5% (±0.1%)" in drift.sentence
    drift, flicker = followed.light_findings(course_of(0.0, 0.05), False)
    assert not drift.significant
    assert flicker.significant
    assert "5.0% (rms). These patterns do not allow" in flicker.sentence


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

    def expose(self, exposed: Exposed) -> None:
        self.asked.append("expose")
        self.exposed = exposed

    def decode(self, progress: Any) -> tuple[Any, MergedFrame]:
        self.asked.append("decode")
        return self.code, self.white

    def run(self) -> tuple[Any, ...]:
        scan = scan_of(
            source=SimpleNamespace(read=lambda shot: np.full((3, 4), 400, np.uint16)),
            expose=self.expose,
            follow=self.light.append,
            decode=self.decode,
            look=lambda pixels, progress: self.looked.append(len(pixels)),
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


def test_what_a_change_of_the_light_is_off_by_is_common_to_all_frames() -> None:
    course = replace(course_of(-0.1), drift_std=0.02, step_at=90)
    unsure = followed.unsure_level(PLAN, ProjectorResponse(), followed.light_findings(course, True))
    assert unsure == pytest.approx(0.02 * np.exp(-0.1))
    steady = followed.light_findings(course_of(0.001), True)
    assert followed.unsure_level(PLAN, ProjectorResponse(), steady) == 0.0
