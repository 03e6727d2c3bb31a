"""Shots that show their pattern: taken, judged, taken again if need be, and only then believed."""

from __future__ import annotations

import logging
from collections.abc import Collection
from dataclasses import replace
from typing import NoReturn

import numpy as np
from numpy.typing import NDArray

from dsl_core.capture.again import Again
from dsl_core.capture.diagnosis import Diagnosis, Explanation
from dsl_core.capture.exposure import ShotTaker
from dsl_core.capture.proof.finding import Finding, Light, Verdict, last_wrong
from dsl_core.capture.proof.light_sums import light_sentence
from dsl_core.capture.proof.verifier import FrameProof
from dsl_core.capture.proven.doubted import MOST_UNTOLD, DoubtedShots
from dsl_core.capture.proven.lateness import Lateness
from dsl_core.capture.proven.wrong_pictures import (
    PictureError,
    displaced,
    has_begun_before,
    said_of_corrected,
    what_to_do,
    why_control_differs,
)
from dsl_core.capture.put_back import ADVICE
from dsl_core.errors import Cancelled, DeviceError
from dsl_core.model.frames import Frame, FrameSink, FrameSource, NotedSource
from dsl_core.model.plan import CapturePlan, Shot, describe_shot
from dsl_core.progress import CancelToken

#: How often a shot is taken again before the scan stops, and how long the pattern may settle before that, ms.
SETTLE_MS = (100.0, 300.0, 900.0)
#: Of doubtful pictures that come out the same again, every so many are followed by a control.
CONTROL_EVERY = 8
_log = logging.getLogger(__name__)


class ProvenShots:
    """Takes shots into a sink; without a proof, any picture is believed."""

    def __init__(
        self,
        taker: ShotTaker,
        proof: FrameProof | None,
        diagnosis: Diagnosis,
        sink: FrameSink,
        token: CancelToken,
        only_repeats: bool = False,
        again: Again = Again.SCAN,
    ) -> None:
        """Keep the parts; the ``diagnosis`` says why pictures are wrong that stay so.

        Rigs that ``only_repeats`` cannot show what the plan has not. Errors advise ``again``.
        """
        self._taker, self._proof, self._sink, self._token = taker, proof, sink, token
        self._diagnosis, self._only_repeats, self._next_step = diagnosis, only_repeats, again
        self._is_late, self._lateness = False, Lateness()
        self._doubted = DoubtedShots()
        self._doubts = 0
        self._has_seen_first = False
        #: What is wrong with light and places of the first code, as soon as that is known.
        self._light = ""
        #: That pictures hold something of those before them: the first ones say nothing of later ones then.
        self._mixed = ""
        #: Shots that were taken again because a picture did not show their pattern.
        self.corrected = 0

    @property
    def note(self) -> str:
        """What a person should know at the end, as sentences with a space before them; empty if nothing."""
        found = said_of_corrected(self.corrected, self._is_late)
        found += [] if self._proof is None or not self._proof.unproven else [self._proof.unproven]
        return "".join(f" {each}" for each in (*found, *self._known_wrong))

    @property
    def _known_wrong(self) -> list[str]:
        """Sentences on what is wrong with the light and places of the first code."""
        past = () if self._proof is None else self._proof.past
        return [each for each in (self._light, *past) if each]

    def learn(self, stored: FrameSource, plan: CapturePlan, missing: Collection[int]) -> None:
        """Judge the frames of earlier runs of a plan, all but those ``missing``; wrong ones are taken again.

        So are the last ones before a missing shot that cannot be told: what stopped the scan may have begun
        with them.
        """
        if self._proof is None:
            return
        tail: list[Shot] = []
        again: list[Shot] = []
        for shot in plan.shots():
            if shot.index in missing:
                again += tail[-MOST_UNTOLD:]
                tail = []
                continue
            pixels = stored.read(shot)
            found = self._proof.judge(shot, pixels)
            if isinstance(stored, NotedSource):
                self._proof.recall(shot, stored.corrected(shot))
            if not found.is_wrong:
                self._diagnosis.keep(shot, pixels)
                self._date(shot, pixels, self._proof)
            is_untold = found.verdict is Verdict.UNTOLD and self._is_alone(shot)
            tail = [*tail, shot] if is_untold else []
            self._correct(found, self._proof)
        for shot in again:
            self.take(shot)

    def take(self, shot: Shot) -> None:
        """Take a shot and save it.

        Raises `DeviceError` when it does not show its pattern however often it is taken, `StoreError` when it
        cannot be saved, `Cancelled` when someone requested the end. What could not be judged since a picture
        last showed its pattern, and the pictures just before, are then withdrawn: they may be wrong already.
        """
        try:
            self._take(shot)
        except PictureError as error:
            self._withdraw(error, shot)

    def conclude(self, is_proven: bool = False) -> None:
        """Where the last pictures could not be judged, see that devices and scene are as they were.

        Drive levels are looked at as well, unless this run has done so or, with the scan, what it shows is
        kept and nothing was taken since (``is_proven``): an earlier run that ended before that may have
        doubted them. Raises `DeviceError` if devices or scene have changed, after withdrawing those pictures.
        """
        if self._proof is None:
            return
        has_asked = self._has_seen_first or is_proven or self._only_repeats
        if not has_asked and self._proof.scene.first_pictures():
            self._see_levels(self._proof)
        if not self._doubted.untold:
            return
        try:
            self._require_control(self._proof)
        except PictureError as error:
            self._withdraw(error)
        self._doubted.untold.clear()

    def _take(self, shot: Shot) -> None:
        if self._proof is not None and self._is_alone(shot):
            self._see_first(self._proof)
        frame = self._taker.take(shot, twice=self._is_late)
        if self._proof is None:
            self._sink.write(shot, frame)
            return
        found = self._proof.judge(shot, frame.seen)
        if found.is_doubtful:
            frame, found = self._ask_again(found, frame, self._proof)
        elif self._proof.is_alone(found) and not self._is_late:
            frame, found = self._compare(found, frame, self._proof)
        if shot not in found.again:
            self._save(shot, frame, found)
        self._lateness.count(found)
        if found.is_sure:
            self._doubted.trust_untold()
        if found.verdict is Verdict.LATE or found.colour:
            self._lateness.count_late(found)
        passed = self._proof.passed
        if passed is not None and self._proof.is_past(self._again(passed.again[0]).seen):
            self._correct(passed, self._proof)
        self._correct(found, self._proof)
        if self._is_late:
            return
        if shot.role == "sentinel" and not found.is_wrong:
            self._proof.scene.see_settled(shot, frame.seen, self._pixels)
        if self._lateness.is_told(shot):
            if self._lateness.comes_and_goes(shot):
                self._doubted.doubt_passed()
            self._be_late(shot, self._proof)

    def _again(self, shot: Shot, earlier: int = 0) -> Frame:
        """Another picture of a shot, shown twice and for longer; ``earlier`` is how often that was done."""
        return self._taker.take(shot, earlier + 1, SETTLE_MS[earlier], twice=True)

    def _pixels(self, shot: Shot, is_longer: bool) -> NDArray[np.uint16]:
        return (self._again(shot) if is_longer else self._taker.take(shot)).seen

    def _save(self, shot: Shot, frame: Frame, found: Finding) -> None:
        """Save a picture that was not found wrong, and note if little is known of it."""
        self._sink.write(shot, frame)
        self._diagnosis.keep(shot, frame.seen)
        if self._proof is not None:
            self._date(shot, frame.seen, self._proof)
        self._doubted.add(shot, is_untold=not found.is_sure and self._is_alone(shot))

    def _date(self, shot: Shot, pixels: NDArray[np.uint16], proof: FrameProof) -> None:
        """Note since when nobody has seen that devices, light and scene are as they were."""
        if shot.role == "sentinel":
            if proof.scene.is_unchanged(replace(shot, index=shot.pattern), pixels):
                self._doubted.settle_all()
        elif self._is_alone(shot):
            self._doubted.add_alone(shot)
        else:
            self._doubted.add_code(shot)

    def _is_alone(self, shot: Shot) -> bool:
        """Whether a shot is judged by itself: those of the first code are by what they are together."""
        return shot.role == "spectral" or (
            self._proof is not None and shot.setting != self._proof.first_setting
        )

    def _ask_again(self, doubt: Finding, frame: Frame, proof: FrameProof) -> tuple[Frame, Finding]:
        """A second picture of a shot that may be wrong, and what it shows."""
        second = self._again(doubt.shot)
        differs = proof.differ(frame.seen, second.seen)
        found = proof.judge(doubt.shot, second.seen)
        has_mark = doubt.verdict is Verdict.RIGHT or bool(doubt.detail)
        if differs or (has_mark and not found.is_doubtful):
            colour = doubt.colour or proof.late_colour(doubt.shot, frame.seen, second.seen)
            if colour:
                self._lateness.count_late(replace(doubt, colour=colour))
            self._lateness.count_cured(found)
            self.corrected += 1
            return replace(second, corrected=doubt.detail or "it was unlike those before it"), found
        if found.light is Light.STEP or self._doubts % CONTROL_EVERY == 0:
            self._require_control(proof)
            proof.believe_light(doubt.shot)
        self._doubts += 1
        return second, found

    def _compare(self, alone: Finding, frame: Frame, proof: FrameProof) -> tuple[Frame, Finding]:
        """A picture that nothing tells, if another one of its shot is the same; else a third."""
        second = self._taker.take(alone.shot, 1)
        if not proof.differ_at_first(alone.shot, frame.seen, second.seen):
            return frame, alone
        self.corrected += 1
        third = self._again(alone.shot, 1)
        return replace(third, corrected="two pictures of it differed"), proof.judge(alone.shot, third.seen)

    def _correct(self, found: Finding, proof: FrameProof) -> None:
        before, now = dict[Shot, NDArray[np.uint16]](), dict[Shot, NDArray[np.uint16]]()
        for earlier in range(len(SETTLE_MS)):
            if not found.is_wrong:
                return
            if self._token.is_cancelled:
                raise Cancelled(
                    f"Cancelled: {found.sentence} Frames that do are saved. {self._next_step.sentence}"
                )
            _log.warning("%s It is captured again.", found.sentence)
            reason, wrong = found.seen, found.again
            taken: list[tuple[Shot, Frame, Finding]] = []
            for shot in wrong:
                frame = replace(self._again(shot, earlier), corrected=reason)
                taken.append((shot, frame, proof.judge(shot, frame.seen)))
            before, now = now, {shot: frame.seen for shot, frame, _ in taken}
            found = last_wrong([each for *_, each in taken])
            if len(wrong) > 1 and wrong[-1].role == "spectral" and not found.is_wrong:
                # They agree now; but so do two wrong ones, and the earlier one may have been right.
                self._require_control(proof)
            for shot, frame, shown in taken:
                if shot not in found.again:
                    self._save(shot, frame, shown)
                    self.corrected += 1
        if found.is_wrong:
            change = self._explain()
            if not change.sentence:
                of_picture = self._diagnosis.explain_picture(frame.seen)
                change = of_picture if of_picture.sentence else change
            is_steady = proof.scene.repeats(found.again, before, now)
            advice = f"{what_to_do(found, change, proof, is_steady)} {self._next_step.then}"
            if self._known_wrong and not change.sentence:
                advice = " ".join(self._known_wrong)
            raise PictureError(
                f"{found.names.capitalize()} does not show its pattern after {len(SETTLE_MS) + 1} exposures:"
                f" {change.seen or found.seen}. {advice} Frames before it are saved."
                f" {self._next_step.unchecked}".rstrip(),
                found.again,
                has_changed=has_begun_before(found, change),
            )

    def _be_late(self, shot: Shot, proof: FrameProof) -> None:
        """Expect every picture to be late from now on, and so of those before that could not be told."""
        self._require_control(proof)
        self._is_late = True
        _log.warning(
            "Pictures are wrong one after the other, or again and again, as if projector or camera were one"
            " picture late. From %s on, everything is shown and captured twice, and the second picture is"
            " kept.",
            describe_shot(shot),
        )
        for each in tuple(self._doubted.untold):
            frame = replace(self._again(each), corrected="it may be late")
            found = proof.judge(each, frame.seen)
            if each not in found.again:
                self._save(each, frame, found)
                self.corrected += 1
            self._correct(found, proof)
        self._doubted.untold.clear()
        if self._lateness.is_in_part or self._lateness.has_late_colour:
            # A line says that it is right where it lights the scene itself. Its orders, too faint to tell,
            # may have been late elsewhere.
            lines = proof.lines_before(shot)
            self._sink.withdraw(lines)
            self.corrected += len(lines)

    def _require_control(self, proof: FrameProof) -> None:
        """Raise `DeviceError` unless a picture of the first code still looks as it did at first.

        Without such a picture, nothing is said of any other.
        """
        controls = proof.scene.controls()
        if not controls:
            return
        is_sound = True
        for control in controls:
            frame = self._again(control)
            if not proof.scene.is_as_before(control, frame.seen):
                # It may be wrong for once, as any other.
                frame = self._again(control, 1)
            if proof.scene.is_as_before(control, frame.seen):
                is_sound &= proof.scene.is_unchanged(control, frame.seen)
                continue
            reason = self._explain().sentence
            reason = reason or why_control_differs(proof.scene.shows_mirrored(control, frame.seen))
            raise PictureError(
                f"{describe_shot(control).capitalize()}, captured once more as a control, no longer shows its"
                f" pattern. {reason} {self._next_step.then} Frames before are saved.",
                has_changed=True,
            )
        self._doubted.settle_recent()
        if is_sound:
            self._doubted.settle_all()

    def _see_first(self, proof: FrameProof) -> None:
        """Once in a run, after the first code, see that its very first pictures are where they were.

        A code that moved after its first pictures names columns that fit each other nearly everywhere, and
        everything after it fits the code. Raises `PictureError` if it moved, for all of the code since then.
        """
        pictures = proof.scene.first_pictures()
        if not pictures or self._has_seen_first:
            return
        self._has_seen_first = True
        self._doubted.end_code()
        found = [proof.whole.coarse_values(), light_sentence(proof.whole.code_sum(), None)]
        found += proof.whole.lasting(with_colours=False)  # calibrations scan through filters
        self._light = " ".join(each for each in found if each)
        if self._light and self._sees_mixed():
            self._light = ""  # what else is odd comes of that
        for each in self._known_wrong:
            _log.warning("%s", each)
        for first in () if self._mixed else pictures:
            self._require_place(first, proof)
        if not self._only_repeats and not self._mixed:
            self._see_levels(proof)

    def _sees_mixed(self) -> bool:
        """Whether pictures hold something of those before them, as black, captured again, shows."""
        if not self._mixed and self._proof is not None and not self._only_repeats:
            self._mixed = self._proof.scene.see_mixed(self._pixels)
        return bool(self._mixed)

    def _see_levels(self, proof: FrameProof) -> None:
        """See that white at half its level is as bright as the calibration says, or keep what is wrong.

        A scan at one level would be brighter or darker throughout, as of another scene.
        """
        shots = proof.scene.whites()
        if shots is None:
            return
        white, dim, black = shots
        if proof.scene.compare_whites(self._taker.take(dim, twice=self._is_late).seen):
            return
        # The picture may be late, and the light of lamp and room may have changed since white.
        if not proof.scene.compare_whites(
            self._again(dim).seen, (self._again(white).seen, self._again(black).seen)
        ):
            _log.warning("%s", proof.scene.levels)

    def _require_place(self, first: Shot, proof: FrameProof) -> None:
        """See that a picture of the code, captured once more, is where it was."""
        if not proof.scene.is_displaced(first, self._taker.take(first, twice=self._is_late).seen):
            return
        if not proof.scene.is_displaced(first, self._again(first).seen):
            return
        reason = f"{self._explain().sentence or ADVICE} {self._next_step.then}"
        raise displaced(first, reason, proof.scene.code_after(first))

    def _explain(self) -> Explanation:
        """What has changed since the scan began; nothing where that does not show."""
        try:
            if self._sees_mixed():
                return Explanation(self._mixed, is_of_all=True)
            return self._diagnosis.explain(lambda shot: self._again(shot).seen)
        except DeviceError as error:
            _log.warning("No pictures could be taken to see what has changed: %s", error)
            return Explanation()

    def _withdraw(self, error: PictureError, latest: Shot | None = None) -> NoReturn:
        """Remove the pictures that may be wrong for the same reason, and say so.

        The ``latest`` is among them if it was saved, because others were wrong. What was wrong with the first
        code may be why, and is said as well.
        """
        wrong = [shot for shot in error.wrong if shot != latest]
        withdrawn = self._doubted.withdraw(wrong, error.has_changed)
        known = "".join(f" {each}" for each in self._known_wrong if each not in str(error))
        if not withdrawn:
            raise PictureError(f"{error}{known}", error.wrong) from error
        self._sink.withdraw(withdrawn)
        first, last = withdrawn[0].number, withdrawn[-1].number
        which, they = f"{len(withdrawn)} frames between {first} and {last}", "they"
        if len(withdrawn) == 1:
            which, they = f"Frame {first}", "it"
        raise PictureError(
            f"{error} {which}, captured just before or not judged in full, may be wrong too: {they} will be"
            f" captured again.{known}",
            error.wrong,
        ) from error
