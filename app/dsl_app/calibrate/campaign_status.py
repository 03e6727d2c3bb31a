"""State of every calibration of a campaign, read from its folder. No Qt, no devices."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path

from dsl_app.calibrate.state import ABOUT, About, Row, RowState
from dsl_app.shared.paths import is_dir
from dsl_core.campaign.common.captures import read_note
from dsl_core.campaign.common.recipe import AnyRecipe
from dsl_core.campaign.recipes import campaign_recipes, recipe_names
from dsl_core.errors import DslError
from dsl_core.io.campaign_folder import CampaignFolder
from dsl_core.model.calibration.accepted import AcceptedCalibration
from dsl_core.model.conditions import CaptureConditions, differences
from dsl_core.model.figure import Figure, failures
from dsl_core.words import sentence

#: Calibrations older than this are ageing, days.
AGEING_DAYS = 90
#: What a person judges a calibration by: beginnings of names of its figures.
JUDGED_BY = {
    "selftest": ("linearity", "ramps, rms"),
    "geometry": ("camera error", "projector error"),
    "spectralon": ("deviation of white", "unevenness"),
    "color-checker": ("residual of patches held out",),
    "bandpass": ("efficiency of order",),
    "depth-stage": ("held-out error of first orders",),
}
#: Makes all recipes of a campaign, in order.
Recipes = Callable[[CampaignFolder], Sequence[AnyRecipe]]


def _utc_now() -> datetime:
    return datetime.now(UTC)


@dataclass(frozen=True)
class Kinds:
    """Which calibrations exist: their names in order, and how a campaign makes their recipes."""

    names: tuple[str, ...] = ()
    recipes: Recipes = campaign_recipes
    ageing_days: int = AGEING_DAYS
    clock: Callable[[], datetime] = _utc_now

    def rows(self, folder: Path, conditions: CaptureConditions | None = None) -> tuple[Row, ...]:
        """State of every calibration of a campaign, read from disk; raises `StoreError`.

        ``conditions`` are those of the connected rig, if any.
        """
        campaign = CampaignFolder.open(folder)
        now, ageing = self.clock(), timedelta(days=self.ageing_days)
        rows: list[Row] = []
        before: dict[str, str] = {}
        for name in self.names or recipe_names():
            row, accepted = _read(campaign, name, before, conditions, now, ageing)
            rows.append(row)
            if accepted:
                before[name] = accepted
        return tuple(rows)


def _read(
    campaign: CampaignFolder,
    name: str,
    before: Mapping[str, str],
    conditions: CaptureConditions | None,
    now: datetime,
    ageing: timedelta,
) -> tuple[Row, str]:
    """The row of a calibration, and when it was accepted (empty: never)."""
    about = ABOUT.get(name, About(name, ""))
    try:
        accepted, waits = campaign.accepted(name), campaign.candidate(name) is not None
        captured, steps = count_captured(campaign, name)
    except DslError as error:
        return Row(name, about, RowState.DAMAGED, str(error)), ""
    waiting = "A fit has not been judged yet." if waits else ""
    if accepted is None:
        begun = captured > 0 or waits
        count = f"{captured} of {steps}" if steps else str(captured)
        reason = waiting or (f"{count} captured" if captured else "")
        state = RowState.BEGUN if begun else RowState.MISSING
        return Row(name, about, state, reason, has_candidate=waits), ""
    state, reason = judge(accepted, before, conditions, now, ageing)
    reason = f"{reason} {waiting}".strip()
    row = Row(name, about, state, reason, key_figure(accepted.figures, name), accepted.accepted, waits)
    return row, accepted.accepted


def judge(
    accepted: AcceptedCalibration,
    before: Mapping[str, str],
    conditions: CaptureConditions | None,
    now: datetime,
    ageing: timedelta,
) -> tuple[RowState, str]:
    """The state of an accepted calibration, and why.

    ``before`` says when those it should be based on were accepted; older than ``ageing`` is ageing.
    """
    if conditions is not None and accepted.conditions is not None:
        found = differences(accepted.conditions, conditions)
        if found:
            return RowState.OTHER_RIG, f"{sentence('; '.join(found))} Set it back, or calibrate again."
    if accepted.based_on != dict(before):
        newer = [name for name in before if accepted.based_on.get(name) != before[name]]
        names = " and ".join(_title(name) for name in newer) or "what it was fitted on"
        return RowState.SUPERSEDED, f"Changed since: {names}. Fit again; its captures are kept."
    failed = failures(accepted.figures)
    if failed:
        return RowState.OUTSIDE, failed[0].advice
    age = now - datetime.fromisoformat(accepted.accepted) if accepted.accepted else timedelta(0)
    if age > ageing:
        return RowState.AGEING, f"{age.days} days old. Check it for drift, or calibrate again."
    return RowState.GOOD, ""


def key_figure(figures: tuple[Figure, ...], name: str = "") -> Figure | None:
    """The figure that is furthest beyond its limits, else the worst of those that a person judges by.

    For a calibration ``name`` that has none of these, it is the one nearest to its limits.
    """
    limited = [figure for figure in figures if figure.limits]
    judged = [figure for figure in limited if figure.name.startswith(JUDGED_BY.get(name, ()))]
    return max(failures(tuple(limited)) or judged or limited, key=_strain, default=None)


def _strain(figure: Figure) -> float:
    """How much of its room a figure uses: above one beyond its limits."""
    value, low, high = figure.value, figure.low, figure.high
    if low is not None and high is not None:
        half = (high - low) / 2
        return abs(value - (low + high) / 2) / half if half > 0 else float(not figure.passed)
    # One limit: how close the value comes to it, on the scale of the limit itself.
    ratio = value / high if high else (low / value if low and value else 0.0)
    return max(ratio, 1.001) if not figure.passed else min(max(ratio, 0.0), 1.0)


def count_captured(campaign: CampaignFolder, name: str) -> tuple[int, int]:
    """How many steps of a calibration were captured to their end, and of how many; raises `StoreError`.

    It had as many as when the last of them was captured; 0 is unknown.
    """
    home = campaign.home(name)
    if not is_dir(home):
        return 0, 0
    notes = (read_note(folder) for folder in home.iterdir() if is_dir(folder))
    done = [note for note in notes if note is not None and note.finished and not note.refused]
    last = max(done, key=lambda note: note.finished, default=None)
    return len(done), 0 if last is None else last.steps


def _title(name: str) -> str:
    return ABOUT[name].title if name in ABOUT else name
