from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest
from numba import typeof

from dsl_core.devices.registry import open_rig
from dsl_core.model.plan import GrayCode
from dsl_core.patterns.gray_code import code_image
from dsl_core.patterns.trial_pictures import trial_picture
from dsl_core.simulation.rehearsal import rehearse
from dsl_core.simulation.rendering import kernels

LOOPS = ("add_zero_runs", "add_order_runs", "add_zero_table", "add_order_slices")


def test_first_pictures_of_a_live_view_and_of_a_scan_need_nothing_that_it_did_not_compile(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    used = set[tuple[Any, ...]]()

    def noted(name: str, loop: Callable[..., None]) -> Callable[..., None]:
        def call(*arguments: Any) -> None:
            used.add((name, *map(typeof, arguments)))
            loop(*arguments)

        return call

    for name in LOOPS:
        monkeypatch.setattr(kernels, name, noted(name, getattr(kernels, name)))
    rehearse()
    compiled = set(used)
    assert {name for name, *_ in compiled} == set(LOOPS)
    with open_rig("twin", {"size": "48x32", "scene": "sphere"}) as rig:
        size = rig.projector.info.width_px, rig.projector.info.height_px
        for image in (trial_picture("white", size, 0.8), code_image(GrayCode(), size, 12)):
            rig.projector.show(image)
            rig.camera.snap()
    assert used == compiled
