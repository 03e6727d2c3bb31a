"""Plans and pattern sets as files. No Qt."""

from __future__ import annotations

from pathlib import Path

from dsl_app.shared.known_files import Kind, kind_of
from dsl_core.errors import PlanError
from dsl_core.model.plan import CapturePlan, GrayCode


def read_plan(path: Path, now: CapturePlan) -> CapturePlan:
    """The plan of a file; a pattern set is planned at the settings of the plan at hand.

    Raises `PlanError` or `StoreError` that says what is wrong with the file.
    """
    from dsl_core.io.plan_file import load_plan

    if kind_of(path) is not Kind.PATTERNS:
        return load_plan(path)
    from dsl_core.planning.design import columns_of
    from dsl_core.planning.designed import load_design

    made = load_design(path)
    width_px = now.projector_size_px[0]
    if made.width_px != width_px:
        raise PlanError(
            f"The patterns of {path.name} are {made.width_px} columns wide, the projector has {width_px}."
            " Design patterns for this rig by 'dsl-scan design'."
        )
    return now.model_copy(
        update={
            "name": made.name,
            "code": GrayCode(rows=False),
            "spectral": columns_of(made.array),
            "code_settings": tuple(range(len(now.settings))),
        }
    )
