"""Step by step: which pictures are asked for, with which wait, and what is written, noted or withdrawn."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from dsl_core.capture.diagnosis import Explanation
from dsl_core.capture.proof.code.code_sum import CodeSum
from dsl_core.capture.proof.finding import Finding, Light, Verdict
from dsl_core.capture.proven.lateness import CURED_OFTEN, LATE_OFTEN, LATE_WITHIN, ON_END
from dsl_core.capture.proven.shots import SETTLE_MS, ProvenShots
from dsl_core.capture.proven.wrong_pictures import PictureError
from dsl_core.errors import Cancelled, DeviceError
from dsl_core.model.frames import Frame
from dsl_core.model.plan import CapturePlan, GrayCode, LineComb, Shot
from dsl_core.progress import CancelToken

PLAN = CapturePlan(
    camera_size_px=(32, 18),
    projector_size_px=(32, 18),
    code=GrayCode(rows=False),
    spectral=LineComb(width_px=2, step_px=2, period_px=8),
)
SHOTS = tuple(PLAN.shots())
CODE, LINE = SHOTS[3], SHOTS[13]
Tell = Callable[[Shot], Finding]


class Bench:
    """Parts of a scan that note what they are asked; ``tell`` says what each picture shows."""

    def __init__(self, *tell: Tell, is_as_before: bool = True, differs: bool = False) -> None:
        self.taken: list[tuple[int, int, float, bool]] = []
        self.written: dict[int, str] = {}
        self.kept: list[int] = []
        self.withdrawn: list[int] = []
        self._tell, self._same, self._differs = list(tell), is_as_before, differs
        self.believed: list[int] = []
        self.first_setting, self.token = 0, CancelToken()
        self.cause, self.is_quite_the_same, self.is_mirrored = "", True, False
        self.displaced: list[bool] = []
        self.first: tuple[Shot, ...] = (SHOTS[0],)
        self.alone = self.fine = False
        #: The colour that the first of two pictures of a shot has of the one before.
        self.colour = ""
        self.past: tuple[str, ...] = ()
        self.unproven = ""
        #: How often white at half its level is compared, and what that says.
        self.whites_seen, self.levels = list[bool](), ""
        self.mixed = self.coarse = ""
        self.recalled: dict[int, str] = {}
        self.chosen: tuple[Shot, ...] = (SHOTS[0], SHOTS[4])
        #: So many of the next controls are wrong, whatever is the matter.
        self.odd_controls = 0
        #: How white is taken again to see if it settles.
        self.settling: tuple[bool, ...] = ()
        self.of_code: CodeSum | None = None
        self.of_ends: list[str] = []
        self.is_steady = False
        self.passed: Finding | None = None
        self.has_gone = False
        self.scene = self.whole = self
        parts: Any = self
        self.shots = ProvenShots(parts, parts, parts, parts, self.token)

    def take(self, shot: Shot, attempt: int = 0, settle_ms: float = 0.0, *, twice: bool = False) -> Frame:
        self.taken.append((shot.index, attempt, settle_ms, twice))
        return Frame(np.zeros((2, 2), np.uint16), 1.0, 0.0, len(self.taken))

    def judge(self, shot: Shot, pixels: object) -> Finding:
        return (self._tell.pop(0) if len(self._tell) > 1 else self._tell[0])(shot)

    def differ(self, one: object, other: object) -> bool:
        return self._differs

    def code_sum(self) -> CodeSum | None:
        return self.of_code

    def coarse_values(self) -> str:
        return self.coarse

    def lasting(self, with_colours: bool = True) -> list[str]:
        # Colours are left out: a filter of a calibration may take them away.
        return ["No colour at all."] if with_colours else self.of_ends

    def controls(self) -> tuple[Shot, ...]:
        return self.chosen

    def is_as_before(self, control: Shot, pixels: object) -> bool:
        if self.odd_controls > 0:
            self.odd_controls -= 1
            return False
        return self._same or control.index == 0

    def repeats(self, shots: Sequence[Shot], before: dict[Shot, Any], now: dict[Shot, Any]) -> bool:
        return self.is_steady and set(shots) <= before.keys() & now.keys()

    def shows_mirrored(self, control: Shot, pixels: object) -> bool:
        return self.is_mirrored

    def is_unchanged(self, control: Shot, pixels: object) -> bool:
        return self.is_quite_the_same

    def write(self, shot: Shot, frame: Frame) -> None:
        self.written[shot.index] = frame.corrected

    def lines_before(self, shot: Shot) -> tuple[Shot, ...]:
        return SHOTS[12 : shot.index]

    def believe_light(self, shot: Shot) -> None:
        self.believed.append(shot.index)

    def recall(self, shot: Shot, why: str) -> None:
        self.recalled[shot.index] = why

    def withdraw(self, shots: list[Shot]) -> None:
        self.withdrawn = [shot.index for shot in shots]

    def keep(self, shot: Shot, pixels: object) -> None:
        self.kept.append(shot.index)

    def is_past(self, pixels: object) -> bool:
        return self.has_gone

    def late_colour(self, shot: Shot, one: object, other: object) -> str:
        return self.colour

    def is_alone(self, found: Finding) -> bool:
        return self.alone

    def differ_at_first(self, shot: Shot, one: object, other: object) -> bool:
        return self._differs

    def is_at_first_level(self, shot: Shot) -> bool:
        return shot.level == CODE.level

    def are_finest(self, shots: tuple[Shot, ...]) -> bool:
        return self.fine

    def first_pictures(self) -> tuple[Shot, ...]:
        return self.first if self.displaced else ()

    def is_displaced(self, first: Shot, pixels: object) -> bool:
        return self.displaced.pop(0)

    def see_settled(self, white: Shot, pixels: object, take: Callable[[Shot, bool], object]) -> None:
        for is_longer in self.settling:
            take(white, is_longer)

    def see_mixed(self, take: Callable[[Shot, bool], object]) -> str:
        return self.mixed

    def whites(self) -> tuple[Shot, Shot, Shot] | None:
        return (SHOTS[10], replace(SHOTS[10], level=0.5), SHOTS[11]) if self.whites_seen else None

    def compare_whites(self, dim: object, now: object = None) -> bool:
        return self.whites_seen.pop(0)

    def code_after(self, first: Shot) -> tuple[Shot, ...]:
        return SHOTS[first.index + 1 : 12]

    def explain(self, snap: Callable[[Shot], object]) -> Explanation:
        if self.cause == "The lamp fails.":
            snap(SHOTS[10])
        if self.cause == "unplugged":
            raise DeviceError("no camera")
        return Explanation(self.cause, self.cause == "It moved.", self.cause == "", self.cause == "Turned.")

    def explain_picture(self, pixels: object) -> Explanation:
        return Explanation()


def is_right(shot: Shot) -> Finding:
    return Finding(shot, Verdict.RIGHT, light=Light.USUAL)


def of_unknown_light(shot: Shot) -> Finding:
    return Finding(shot, Verdict.RIGHT)


def untold(shot: Shot) -> Finding:
    return Finding(shot, Verdict.UNTOLD)


def late(shot: Shot) -> Finding:
    return Finding(shot, Verdict.LATE, (shot,))


def doubtful(shot: Shot) -> Finding:
    return Finding(shot, Verdict.UNTOLD, is_doubtful=True)


def frayed(shot: Shot) -> Finding:
    return Finding(shot, Verdict.RIGHT, detail="a few rows of it showed another pattern", is_doubtful=True)


def beside(shot: Shot) -> Finding:
    return Finding(shot, Verdict.UNTOLD, detail="its line was next to its place", is_doubtful=True)


def torn(shot: Shot) -> Finding:
    return Finding(shot, Verdict.TORN, (shot,))


def stepped(shot: Shot) -> Finding:
    return Finding(shot, Verdict.RIGHT, is_doubtful=True, light=Light.STEP)


def take_all(bench: Bench, shots: Sequence[Shot]) -> None:
    for shot in shots:
        bench.shots.take(shot)


CONTROLS = [(0, 1, 100.0, True), (4, 1, 100.0, True)]


def test_a_right_picture_is_taken_once_and_kept() -> None:
    bench = Bench(is_right)
    bench.shots.take(LINE)
    assert bench.taken == [(13, 0, 0.0, False)]
    assert (bench.written, bench.kept, bench.shots.note) == ({13: ""}, [13], "")


def test_wrong_ones_are_taken_again_with_longer_waits() -> None:
    bench = Bench(late, late, late, is_right)
    bench.shots.take(LINE)
    assert bench.taken == [
        (13, 0, 0.0, False),
        (13, 1, 100.0, True),
        (13, 2, 300.0, True),
        (13, 3, 900.0, True),
    ]
    assert bench.written == {13: "it still shows the pattern before"}
    assert bench.shots.corrected == 1
    assert bench.shots.note == " 1 was captured again, because a picture did not show its pattern."


def test_why_frames_of_an_earlier_run_were_taken_again_is_looked_at() -> None:
    bench, stored = Bench(is_right), Stored()
    stored.corrected = lambda shot: f"why {shot.index}"  # type: ignore[attr-defined]
    bench.shots.learn(stored, stored.plan, range(2, len(SHOTS)))  # type: ignore[arg-type]
    assert bench.recalled == {0: "why 0", 1: "why 1"}


def test_light_of_the_code_that_does_not_add_up_is_said_at_the_end() -> None:
    bench = Bench(is_right)
    bench.displaced = [False]
    bench.of_code, bench.past = CodeSum(1.3, 0.01, 0.03, 0.0, 0.01), ("The light has settled.",)
    bench.shots.take(LINE)
    assert bench.shots.note.startswith(" Patterns and their inverses together have 1.30 ± 0.01 times")
    assert bench.shots.note.endswith(" The light has settled.")


def test_that_no_picture_could_be_judged_is_said_at_the_end() -> None:
    bench = Bench(is_right)
    bench.unproven = "The code is dark."
    bench.shots.take(LINE)
    assert bench.shots.note == " The code is dark."


def test_values_of_few_bits_are_said_before_what_they_make_of_light() -> None:
    bench = Bench(is_right)
    bench.displaced, bench.coarse, bench.of_ends = [False], "Values come in steps.", ["Black is grey."]
    bench.shots.take(LINE)
    assert bench.shots.note == " Values come in steps. Black is grey."


def test_what_was_wrong_from_the_first_picture_on_is_said_at_the_end() -> None:
    bench = Bench(is_right, late)
    bench.displaced, bench.of_ends = [False], ["Black is grey.", "Rows alternate."]
    bench.shots.take(LINE)
    assert bench.shots.note == " Black is grey. Rows alternate."
    # Why a later picture stays wrong may be the same.
    with pytest.raises(PictureError, match=r"after 4 exposures: .*") as caught:
        bench.shots.take(SHOTS[14])
    assert str(caught.value).count("Black is grey. Rows alternate. Frames before it are saved.") == 1
    assert "Then resume" not in str(caught.value)


@pytest.mark.parametrize(
    ("seen", "taken"),
    [
        ([True], [(0, 0), (10, 0), (13, 0)]),
        ([False, True], [(0, 0), (10, 0), (10, 1), (10, 1), (11, 1), (13, 0)]),
        ([False, False], [(0, 0), (10, 0), (10, 1), (10, 1), (11, 1), (13, 0)]),
    ],
)
def test_white_at_half_its_level_is_compared_before_the_first_line_twice_if_it_is_wrong(
    seen: list[bool], taken: list[tuple[int, int]]
) -> None:
    bench = Bench(is_right)
    bench.displaced, bench.whites_seen = [False], seen
    bench.shots.take(LINE)
    assert [each[:2] for each in bench.taken] == taken
    assert bench.whites_seen == []


@pytest.mark.parametrize(
    ("is_there", "is_proven", "asked"), [(True, False, [(10, 0)]), (True, True, []), (False, False, [])]
)
def test_levels_are_looked_at_where_an_earlier_run_took_all_lines(
    is_there: bool, is_proven: bool, asked: list[tuple[int, int]]
) -> None:
    # What that run said of them ended with it.
    bench = Bench(is_right)
    bench.displaced, bench.whites_seen = [False] if is_there else [], [True]
    bench.shots.conclude(is_proven)
    assert [each[:2] for each in bench.taken] == asked


def test_pictures_mixed_with_those_before_them_are_the_reason_whatever_the_first_ones_say() -> None:
    bench = Bench(late)
    bench.mixed, bench.of_ends = "Exposures begin early.", ["Black is grey."]
    bench.displaced, bench.whites_seen = [True], [False]
    bench.cause = "The light of the room has changed."
    with pytest.raises(PictureError, match=r"after 4 exposures: .* Exposures begin early\.") as caught:
        bench.shots.take(LINE)
    assert "Black is grey" not in str(caught.value)
    assert "room" not in str(caught.value)
    assert bench.whites_seen == [False]


def test_a_rig_that_only_repeats_is_not_asked_for_other_levels() -> None:
    bench = Bench(is_right)
    bench.displaced, bench.whites_seen = [False], [False]
    parts: Any = bench
    ProvenShots(parts, parts, parts, parts, bench.token, only_repeats=True).take(LINE)
    assert bench.whites_seen == [False]


@pytest.mark.parametrize(
    ("cause", "reason"),
    [
        ("The lamp fails.", "The lamp fails."),
        ("", "Let the projector settle"),
        ("unplugged", "Let the projector"),
    ],
)
def test_what_stays_wrong_is_an_error_with_its_cause_or_remedy(cause: str, reason: str) -> None:
    bench = Bench(late)
    bench.cause = cause
    with pytest.raises(PictureError, match=rf"after 4 exposures: it still shows.*{reason}"):
        bench.shots.take(LINE)
    assert bench.taken[4:] == ([(10, 1, 100.0, True)] if cause == "The lamp fails." else [])
    assert bench.written == {}


DARK_LINE = "the projector may give dark pictures less light"
LEVEL = "Repeat the self-test, which"
EXPOSURE = "Switch automatic"


@pytest.mark.parametrize(
    ("shot", "verdict", "reason"),
    [
        (LINE, Verdict.DARK, DARK_LINE),
        (LINE, Verdict.EXPOSURE, DARK_LINE),
        (CODE, Verdict.EXPOSURE, EXPOSURE),
        (replace(CODE, level=0.5 * CODE.level), Verdict.EXPOSURE, LEVEL),
    ],
)
def test_what_is_wrong_though_nothing_has_changed_is_told_by_what_it_shows(
    shot: Shot, verdict: Verdict, reason: str
) -> None:
    bench = Bench(lambda shot: Finding(shot, verdict, (shot,), "0.36 times what was expected"))
    bench.cause = ""
    with pytest.raises(PictureError, match=reason):
        bench.shots.take(shot)


def test_who_hides_a_part_is_asked_away_whatever_else_seems_changed() -> None:
    bench = Bench(lambda shot: Finding(shot, Verdict.HIDDEN, (shot,)))
    bench.cause = "It moved."
    with pytest.raises(
        PictureError, match=r"darker than the black picture.*\. Keep out of the way of camera"
    ):
        bench.shots.take(LINE)


@pytest.mark.parametrize(
    ("cause", "said"), [("", "Coarser stripes of the code are right"), ("It moved.", "It moved")]
)
def test_only_the_finest_stripes_are_wrong_where_pictures_are_scaled(cause: str, said: str) -> None:
    bench = Bench(lambda shot: Finding(shot, Verdict.TORN, (shot,)))
    bench.cause, bench.fine = cause, True
    with pytest.raises(PictureError, match=rf"the rest another one\. {said}"):
        bench.shots.take(CODE)


@pytest.mark.parametrize(
    ("is_steady", "cause", "said"),
    [
        (True, "", "It looks the same each time, .* Switch gamma, compression, .* Check that camera"),
        (True, "It moved.", "It moved"),
        (False, "", "Check that camera"),
    ],
)
def test_pairs_that_never_add_up_are_of_a_camera_that_alters_them(
    is_steady: bool, cause: str, said: str
) -> None:
    bench = Bench(lambda shot: Finding(shot, Verdict.OTHER, (shot,)))
    bench.cause, bench.is_steady = cause, is_steady
    with pytest.raises(PictureError, match=rf"it shows something else\. {said}"):
        bench.shots.take(CODE)


def test_nobody_hides_a_part_of_a_picture_of_which_all_has_changed() -> None:
    bench = Bench(lambda shot: Finding(shot, Verdict.HIDDEN, (shot,)))
    bench.cause = "Turned."
    with pytest.raises(
        PictureError, match=r"darker than the black picture.*\. Turned\. Then resume the scan\. Frames before"
    ):
        bench.shots.take(LINE)


@pytest.mark.parametrize("has_gone", [True, False])
def test_lines_are_taken_again_only_if_their_light_has_passed(has_gone: bool) -> None:
    bench = Bench(is_right)
    before = SHOTS[LINE.index - 1]
    bench.passed, bench.has_gone = Finding(LINE, Verdict.PASSING, (before,)), has_gone
    bench.shots.take(LINE)
    asked = [index for index, *_ in bench.taken]
    assert asked == [LINE.index, before.index, *[before.index] * has_gone]
    assert bench.shots.corrected == has_gone
    assert ("other light than in the lines before" in bench.written.get(before.index, "")) == has_gone


def test_nothing_is_taken_again_after_a_cancel() -> None:
    bench = Bench(late)
    bench.token.cancel()
    with pytest.raises(Cancelled, match="Cancelled: "):
        bench.shots.take(LINE)
    assert len(bench.taken) == 1


def test_a_second_wrong_one_makes_everything_late() -> None:
    # Each is right the second time, which does not say that the next will be.
    bench = Bench(late, is_right, late, is_right, is_right)
    bench.shots.take(LINE)
    assert "captured twice" not in bench.shots.note
    bench.shots.take(SHOTS[14])
    assert "captured twice" in bench.shots.note
    assert bench.taken[4:] == CONTROLS


@pytest.mark.parametrize(("apart", "is_late"), [(ON_END, True), (ON_END + 1, False)])
def test_pictures_that_nothing_tells_are_late_only_if_they_differ_on_end(apart: int, is_late: bool) -> None:
    bench = Bench(doubtful, untold, doubtful, untold, untold, untold, untold, differs=True)
    bench.shots.take(LINE)
    bench.shots.take(SHOTS[LINE.index + apart])
    assert ("captured twice" in bench.shots.note) == is_late
    assert bench.shots.corrected == (4 if is_late else 2)  # both are taken again, now that all are late


def test_what_could_not_be_told_before_devices_were_late_is_taken_again_after_a_control() -> None:
    bench = Bench(untold, late, is_right, is_right)
    bench.shots._lateness.failures = 1
    bench.shots.take(SHOTS[12])
    bench.shots.take(LINE)
    # The control, and then the untold one.
    assert bench.taken[3:] == [*CONTROLS, (12, 1, 100.0, True)]
    assert bench.written == {12: "it may be late", 13: "it still shows the pattern before"}
    assert bench.shots.corrected == 2
    assert bench.shots.note.endswith("2 were captured again, because a picture did not show its pattern."
        " Everything was captured twice, since pictures came one late.")  # fmt: skip
    bench.shots.take(SHOTS[14])
    assert bench.taken[-1] == (14, 0, 0.0, True)


@pytest.mark.parametrize(("first", "withdrawn"), [(torn, [12, 13, 14]), (late, [])])
def test_lines_before_those_that_are_late_in_part_are_taken_again_at_the_end(
    first: Tell, withdrawn: list[int]
) -> None:
    # Where a line lights the scene itself it may be right, and late where its orders are.
    bench = Bench(is_right, is_right, first, is_right, late, is_right)
    take_all(bench, SHOTS[12:16])
    assert bench.withdrawn == withdrawn
    assert bench.shots.corrected == 2 + len(withdrawn)


@pytest.mark.parametrize(("apart", "is_late"), [(1, True), (3, False)])
def test_pictures_that_a_second_one_cures_on_end_are_late_in_part(apart: int, is_late: bool) -> None:
    # A colour of a projector that is always one picture late is right the second time.
    bench = Bench(*[frayed, is_right] * CURED_OFTEN, is_right)
    shots = [replace(LINE, index=LINE.index + apart * n) for n in range(CURED_OFTEN)]
    take_all(bench, shots)
    assert ("captured twice" in bench.shots.note) == is_late
    assert bool(bench.withdrawn) == is_late


@pytest.mark.parametrize(
    ("told", "seen", "is_late"), [("blue", "", True), ("", "red", True), ("", "", False)]
)
def test_a_colour_that_is_late_now_and_then_casts_doubt_on_all_lines_before(
    told: str, seen: str, is_late: bool
) -> None:
    # Faint orders of other lines may have been late as well.
    doubt = [lambda shot: replace(frayed(shot), colour=told), is_right]
    bench = Bench(*doubt * LATE_OFTEN, is_right)
    bench.colour = seen
    take_all(bench, [replace(LINE, index=LINE.index + 4 * n) for n in range(LATE_OFTEN)])
    assert ("captured twice" in bench.shots.note) == is_late
    assert bool(bench.withdrawn) == is_late


@pytest.mark.parametrize(("before", "is_late"), [(LATE_WITHIN, True), (LATE_WITHIN + 1, False)])
def test_pictures_that_are_late_now_and_then_cast_doubt_on_untold_ones_before(
    before: int, is_late: bool
) -> None:
    # A display that drops some pictures shows right ones between, which say nothing of those before.
    bench = Bench(untold, is_right, late, is_right)
    bench.shots._lateness._late_at.extend([14 - before, 13])
    take_all(bench, SHOTS[12:15])
    assert ("captured twice" in bench.shots.note) == is_late
    assert bench.written[12] == ("it may be late" if is_late else "")


def test_a_right_picture_ends_a_run_of_wrong_ones() -> None:
    bench = Bench(is_right)
    bench.shots._lateness.failures, bench.shots._doubted.untold = 1, [SHOTS[12]]
    bench.shots.take(LINE)
    assert bench.shots._lateness.failures == 0
    assert bench.shots._doubted.untold == []


def test_a_right_picture_of_unknown_light_may_still_be_too_dark() -> None:
    bench = Bench(of_unknown_light)
    bench.shots._lateness.failures = 1
    for shot in (CODE, SHOTS[12], LINE):
        bench.shots.take(shot)
    assert bench.shots._lateness.failures == 0
    assert bench.shots._doubted.untold == [SHOTS[12], LINE]


def test_light_that_has_changed_is_believed_after_a_control_alone() -> None:
    bench = Bench(stepped)
    bench.shots._doubts = 3
    bench.shots.take(LINE)
    assert bench.taken == [(13, 0, 0.0, False), (13, 1, 100.0, True), *CONTROLS]
    assert (bench.written, bench.believed) == ({13: ""}, [13])
    changed = Bench(of_unknown_light, stepped, is_as_before=False)
    changed.shots.take(SHOTS[12])
    with pytest.raises(PictureError, match=r"Frame 13, captured just before"):
        changed.shots.take(LINE)
    assert (changed.withdrawn, changed.written) == ([12], {12: ""})


def test_only_pictures_that_are_judged_by_themselves_are_untold() -> None:
    bench = Bench(untold)
    for shot in (CODE, LINE, SHOTS[10]):
        bench.shots.take(shot)
    assert bench.shots._doubted.untold == [LINE]
    bench.first_setting = 1
    bench.shots.take(CODE)
    assert bench.shots._doubted.untold == [LINE, CODE]


def test_a_doubtful_picture_is_taken_a_second_time_and_every_eighth_with_a_control() -> None:
    bench = Bench(doubtful)
    for _ in range(9):
        bench.shots.take(LINE)
    second = [(13, 0, 0.0, False), (13, 1, 100.0, True)]
    assert bench.taken[:4] == [*second, *CONTROLS]
    assert bench.taken[4:18] == second * 7
    assert bench.taken[18:] == [*second, *CONTROLS]
    assert (bench.written, bench.shots.corrected) == ({13: ""}, 0)


@pytest.mark.parametrize(
    ("tell", "differs", "reason"),
    [
        ((doubtful, doubtful), True, "it was unlike those before it"),
        ((frayed, is_right), False, "a few rows of it showed another pattern"),
        ((frayed, frayed), False, ""),
        ((beside, untold), False, "its line was next to its place"),
        ((beside, beside), False, ""),
        ((stepped, is_right), False, "it was unlike those before it"),
        ((doubtful, untold), False, ""),
    ],
)
def test_the_second_picture_says_whether_the_first_was_wrong(
    tell: tuple[Tell, Tell], differs: bool, reason: str
) -> None:
    bench = Bench(*tell, differs=differs)
    bench.shots.take(LINE)
    assert bench.written == {13: reason}
    assert bench.shots.corrected == bool(reason)


def test_who_is_late_anyway_asks_for_another_picture_of_what_is_doubtful() -> None:
    bench = Bench(doubtful, is_right)
    bench.shots._is_late = True
    bench.shots.take(LINE)
    assert bench.taken == [(13, 0, 0.0, True), (13, 1, 100.0, True), *CONTROLS]
    bench.shots.take(LINE)
    assert bench.taken[4:] == [(13, 0, 0.0, True)]


def test_what_could_not_be_told_is_withdrawn_when_a_control_has_changed() -> None:
    bench = Bench(untold, is_as_before=False)
    for shot in SHOTS[12:14]:
        bench.shots.take(shot)
    with pytest.raises(
        PictureError, match=r"no longer shows its pattern.*2 frames between 13 and 14, captured just before"
    ):
        bench.shots.conclude()
    assert bench.withdrawn == [12, 13]
    one = Bench(untold, is_as_before=False)
    one.shots.take(LINE)
    with pytest.raises(PictureError, match=r"Frame 14, captured just before.* it will be captured again"):
        one.shots.conclude()
    calm = Bench(untold)
    calm.shots.take(LINE)
    calm.shots.conclude()
    assert calm.taken[1:] == CONTROLS
    calm.shots.conclude()
    assert len(calm.taken) == 3, "there is nothing left to doubt"


def test_only_a_sentinel_is_asked_whether_white_settles() -> None:
    bench = Bench(is_right)
    bench.settling = (True, False)
    bench.shots.take(LINE)
    assert len(bench.taken) == 1
    again = replace(SHOTS[10], index=20, role="sentinel", pattern=10)
    bench.shots.take(again)
    assert bench.taken[1:] == [(20, 0, 0.0, False), (20, 1, 100.0, True), (20, 0, 0.0, False)]


def test_a_control_that_is_wrong_once_is_taken_again() -> None:
    """A packet that is lost now and then spoils one picture like any other."""
    bench = Bench(untold)
    bench.shots.take(LINE)
    bench.odd_controls = 1
    bench.shots.conclude()
    assert bench.taken[1:] == [CONTROLS[0], (0, 2, 300.0, True), CONTROLS[1]]
    twice = Bench(untold)
    twice.shots.take(LINE)
    twice.odd_controls = 2
    with pytest.raises(PictureError, match="no longer shows its pattern"):
        twice.shots.conclude()


@pytest.mark.parametrize("cause", ["", "The lamp fails."])
def test_a_control_that_is_mirrored_names_the_projector(cause: str) -> None:
    """Unless white and black have changed as well."""
    bench = Bench(untold, is_as_before=False)
    bench.is_mirrored, bench.cause = True, cause
    bench.shots.take(LINE)
    with pytest.raises(PictureError, match=cause or "projector's picture is turned or mirrored"):
        bench.shots.conclude()


def test_the_eight_pictures_before_a_wrong_one_are_withdrawn_back_to_the_last_control() -> None:
    lines = tuple(PLAN.model_copy(update={"spectral": LineComb(width_px=1, step_px=1, period_px=40)}).shots())
    bench = Bench(*[is_right] * 10, late)
    with pytest.raises(PictureError, match=r"8 frames between 15 and 22, captured just before"):
        take_all(bench, lines[12:24])
    assert bench.withdrawn == list(range(14, 22))
    bench = Bench(*[is_right] * 8, stepped, stepped, is_right, late)
    with pytest.raises(PictureError, match=r"2 frames between 21 and 22"):
        take_all(bench, lines[12:24])
    assert bench.withdrawn == [20, 21], "from the picture after which all was well"
    bench = Bench(*[is_right] * 8, stepped, stepped, is_right, late)
    bench.chosen = ()
    with pytest.raises(PictureError, match=r"8 frames between 15 and 22"):
        take_all(bench, lines[12:24])


def test_everything_since_an_old_picture_last_looked_the_same_is_withdrawn_when_one_does_not() -> None:
    plan = PLAN.model_copy(update={"spectral": LineComb(width_px=1, step_px=1, period_px=40)})
    lines = tuple(plan.shots())[12:40]
    again = replace(lines[14], role="sentinel", pattern=4)
    for is_quite_the_same, first in ((True, 27), (False, 12)):
        bench = Bench(*[is_right] * 25, stepped, is_as_before=False)
        bench.is_quite_the_same = is_quite_the_same
        take_all(bench, [*lines[:14], again, *lines[15:25]])
        with pytest.raises(PictureError, match=f"frames between {first + 1} and 37, captured just before"):
            bench.shots.take(lines[26])
        assert bench.withdrawn == [at for at in range(first, 37) if at != again.index or first > again.index]


def test_lines_that_left_their_place_unseen_are_withdrawn_since_all_was_sound() -> None:
    """A projector that warms up moves its picture slowly: the first lines of it are hardly displaced."""
    lines = tuple(PLAN.model_copy(update={"spectral": LineComb(width_px=1, step_px=1, period_px=40)}).shots())
    bench = Bench(*[is_right] * 20, lambda shot: Finding(shot, Verdict.DISPLACED, (shot,)))
    bench.cause = ""
    with pytest.raises(PictureError, match="20 frames between 13 and 32, captured just before"):
        take_all(bench, lines[12:33])


def test_a_shot_found_wrong_on_the_way_is_taken_again_though_the_next_is_right() -> None:
    both = (SHOTS[12], LINE)
    bench = Bench(lambda shot: Finding(shot, Verdict.OTHER, both), late, is_right, is_right)
    bench.shots.take(LINE)
    assert [index for index, *_ in bench.taken] == [13, 12, 13, 12]
    assert bench.written == {13: "it shows something else", 12: "it still shows the pattern before"}


def test_saved_frames_that_turn_out_wrong_for_good_are_withdrawn() -> None:
    pair = (SHOTS[2], CODE)
    bench = Bench(lambda shot: Finding(shot, Verdict.MIRRORED, pair))
    with pytest.raises(PictureError, match=r"mirrored or upside down.*Frame 3, captured just before"):
        bench.shots.take(CODE)
    assert bench.withdrawn == [2], "the latest was not saved"


def test_a_picture_that_was_taken_again_is_withdrawn_with_those_around_it() -> None:
    bench = Bench(is_right, late, is_right, late)
    with pytest.raises(PictureError, match="2 frames between 13 and 14"):
        take_all(bench, SHOTS[12:15])
    assert bench.withdrawn == [12, 13]


def test_a_picture_that_was_saved_before_earlier_ones_turned_out_wrong_is_withdrawn_with_them() -> None:
    bench = Bench(lambda shot: Finding(shot, Verdict.SATURATED, SHOTS[:2]))
    with pytest.raises(PictureError, match="3 frames between 1 and 4"):
        bench.shots.take(CODE)
    assert bench.written == {3: ""}
    assert bench.withdrawn == [0, 1, 3]


def test_a_line_taken_again_that_cannot_be_told_is_followed_by_a_control_at_the_end() -> None:
    bench = Bench(late, untold)
    bench.shots.take(LINE)
    assert bench.taken == [(13, 0, 0.0, False), (13, 1, 100.0, True)]
    bench.shots.conclude()
    assert bench.taken[2:] == CONTROLS


def test_two_lines_that_agree_after_a_second_take_are_believed_after_a_control() -> None:
    both = (SHOTS[12], LINE)
    bench = Bench(lambda shot: Finding(shot, Verdict.LATE, both), is_right)
    bench.shots.take(LINE)
    assert bench.taken[1:] == [(12, 1, 100.0, True), (13, 1, 100.0, True), *CONTROLS]
    assert set(bench.written) == {12, 13}
    code = Bench(lambda shot: Finding(shot, Verdict.LATE, (SHOTS[2], CODE)), is_right)
    code.shots.take(CODE)
    assert code.taken[1:] == [(2, 1, 100.0, True), (3, 1, 100.0, True)]


class Stored:
    """Frames of an earlier run."""

    plan = PLAN

    def read(self, shot: Shot) -> object:
        return np.zeros((2, 2), np.uint16)


def test_frames_right_before_a_missing_one_are_taken_again_where_nothing_tells_of_them() -> None:
    bench = Bench(untold)
    stored: Any = Stored()
    bench.shots.learn(stored, stored.plan, {15})
    # Lines 12 to 14; the code is judged together.
    assert [index for index, *_ in bench.taken] == [12, 13, 14]
    calm = Bench(*[untold] * 13, is_right, untold)
    calm.shots.learn(stored, stored.plan, {15})
    assert [index for index, *_ in calm.taken] == [14], "from the last that was told on"
    whole = Bench(untold)
    whole.shots.learn(stored, stored.plan, ())
    assert whole.taken == []
    wrong = Bench(*[is_right] * 13, late, is_right)
    wrong.shots.learn(stored, stored.plan, ())
    assert wrong.taken == [(13, 1, 100.0, True)]
    assert sorted(wrong.kept) == list(range(len(SHOTS))), "a wrong one only once it is right"


def test_thirty_two_frames_before_a_missing_one_are_taken_again_at_most() -> None:
    bench, stored = Bench(untold), Stored()
    stored.plan = PLAN.model_copy(update={"spectral": LineComb(width_px=1, step_px=1, period_px=40)})
    count = len(tuple(stored.plan.shots()))
    bench.shots.learn(stored, stored.plan, {count - 1})  # type: ignore[arg-type]
    assert [index for index, *_ in bench.taken] == list(range(count - 33, count - 1))


@pytest.mark.parametrize(("seen", "moved"), [([False], False), ([True, False], False), ([True, True], True)])
def test_the_first_picture_is_looked_at_once_after_the_code(seen: list[bool], moved: bool) -> None:
    bench = Bench(is_right)
    bench.displaced = [*seen]
    if not moved:
        take_all(bench, SHOTS[11:15])
        first = [at for at, (index, *_) in enumerate(bench.taken) if index == 0]
        assert first == list(range(1, 1 + len(seen)))
        return
    with pytest.raises(PictureError, match=r"Frame 1 .* is displaced .* 11 frames between 2 and 12"):
        take_all(bench, SHOTS[11:15])
    assert bench.withdrawn == list(range(1, 12))


def test_later_pictures_of_the_code_may_show_what_the_first_does_not() -> None:
    bench = Bench(is_right)
    bench.first, bench.displaced = (SHOTS[0], SHOTS[2]), [False, True, True]
    with pytest.raises(PictureError, match=r"Frame 3 .* is displaced .* 9 frames between 4 and 12"):
        take_all(bench, SHOTS[11:15])
    assert bench.withdrawn == list(range(3, 12))


def test_all_since_the_last_control_is_withdrawn_where_something_moved() -> None:
    lines = tuple(PLAN.model_copy(update={"spectral": LineComb(width_px=1, step_px=1, period_px=40)}).shots())
    bench = Bench(*[is_right] * 10, late)
    bench.cause = "It moved."
    with pytest.raises(PictureError, match=r"It moved\..* 10 frames between 13 and 22"):
        take_all(bench, lines[12:24])


@pytest.mark.parametrize(
    ("verdict", "cause", "first"),
    [
        (Verdict.EXPOSURE, "", 12),
        (Verdict.EXPOSURE, "The lamp fails.", 12),
        (Verdict.LATE, "The room is brighter.", 12),
        (Verdict.HIDDEN, "The lamp fails.", 14),
        (Verdict.LATE, "", 14),
    ],
)
def test_all_since_the_last_control_is_withdrawn_where_nobody_knows_since_when_it_has_changed(
    verdict: Verdict, cause: str, first: int
) -> None:
    lines = tuple(PLAN.model_copy(update={"spectral": LineComb(width_px=1, step_px=1, period_px=40)}).shots())
    bench = Bench(*[is_right] * 10, lambda shot: Finding(shot, verdict, (shot,)))
    bench.cause = cause
    with pytest.raises(PictureError):
        take_all(bench, lines[12:24])
    assert bench.withdrawn == list(range(first, 22))


@pytest.mark.parametrize("differs", [False, True])
def test_a_line_that_nothing_tells_is_compared_with_another_picture_of_it(differs: bool) -> None:
    bench = Bench(untold, differs=differs)
    bench.alone = True
    bench.shots.take(LINE)
    third = [(13, 2, SETTLE_MS[1], True)]
    assert bench.taken == [(13, 0, 0.0, False), (13, 1, 0.0, False), *(third if differs else [])]
    assert bench.written == {13: "two pictures of it differed" if differs else ""}
    assert bench.shots.corrected == differs


@pytest.mark.parametrize(("cause", "first"), [("It moved.", 0), ("The exposure.", 0), ("", 2)])
def test_a_code_in_which_something_changed_is_captured_again_from_its_first_picture(
    cause: str, first: int
) -> None:
    bench = Bench(*10 * [is_right], lambda shot: Finding(shot, Verdict.TORN, (shot,)))
    bench.cause = cause
    for shot in SHOTS[:10]:
        bench.shots.take(shot)
    with pytest.raises(PictureError):
        bench.shots.take(SHOTS[10])
    assert bench.withdrawn == list(range(first, 10))


def test_a_code_that_was_whole_is_kept_when_something_moves_later() -> None:
    bench = Bench(*12 * [is_right], is_right, lambda shot: Finding(shot, Verdict.TORN, (shot,)))
    bench.cause = "It moved."
    for shot in (*SHOTS[:12], LINE):
        bench.shots.take(shot)
    with pytest.raises(PictureError):
        bench.shots.take(SHOTS[LINE.index + 1])
    assert 0 not in bench.withdrawn
