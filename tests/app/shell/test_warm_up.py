from __future__ import annotations

import gc
import importlib.util
import subprocess
import sys
import threading
import time
from types import SimpleNamespace

import pytest
from dsl_app.shell import warm_up as early
from dsl_app.shell.warm_up import STEPS, WarmUp


@pytest.mark.slow
def test_everything_that_is_imported_early_exists() -> None:
    # A name that went away would be no warning to anybody.
    modules = [step.partition(":")[0] for step in STEPS]
    code = f"import importlib.util as u; print([n for n in {modules!r} if u.find_spec(n) is None])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=100)
    assert done.stdout.strip() == "[]", done.stdout + done.stderr


def test_modules_are_there_afterwards_and_garbage_is_collected_again() -> None:
    sys.modules.pop("this_is_not_there", None)
    assert importlib.util.find_spec("colorsys") is not None
    sys.modules.pop("colorsys", None)
    gc.enable()
    warm_up = WarmUp(["this_is_not_there", "colorsys"])
    warm_up.start()
    warm_up._thread.join(30)
    assert warm_up.is_over
    assert "colorsys" in sys.modules
    assert gc.isenabled()


def test_a_step_may_call_a_function(monkeypatch: pytest.MonkeyPatch) -> None:
    called = list[str]()
    module = SimpleNamespace(rehearse=lambda: called.append(threading.current_thread().name))
    monkeypatch.setitem(sys.modules, "a_play", module)
    warm_up = WarmUp(["a_play:rehearse"])
    warm_up.start()
    warm_up._thread.join(30)
    assert called == ["warm-up"]


def test_it_stops_between_two_steps_and_before_it_began() -> None:
    WarmUp(["colorsys"]).stop()
    sys.modules.pop("colorsys", None)
    warm_up = WarmUp(["colorsys"] * 1000)
    warm_up._stop.set()
    warm_up.start()
    warm_up.stop()
    assert "colorsys" not in sys.modules


def test_it_gives_way_to_what_a_person_waits_for_but_not_for_ever(monkeypatch: pytest.MonkeyPatch) -> None:
    sys.modules.pop("colorsys", None)
    asked = []

    def is_awaited() -> bool:
        asked.append("colorsys" in sys.modules)
        return len(asked) < 3

    warm_up = WarmUp(["colorsys"], is_awaited)
    warm_up.start()
    warm_up._thread.join(30)
    assert asked == [False] * 3
    assert "colorsys" in sys.modules

    sys.modules.pop("colorsys", None)
    monkeypatch.setattr(early, "PATIENCE_S", 2 * early.REST_S)
    patient = WarmUp(["colorsys"], lambda: True)
    patient.start()
    patient._thread.join(30)
    assert "colorsys" in sys.modules


def test_it_ends_within_a_step_that_takes_long(monkeypatch: pytest.MonkeyPatch) -> None:
    begun, ended = threading.Event(), list[str]()

    def compile_for_ever() -> None:
        begun.set()
        for _ in range(3000):
            time.sleep(0.001)
        ended.append("compiled")

    monkeypatch.setitem(sys.modules, "a_play", SimpleNamespace(compile=compile_for_ever))
    warm_up = WarmUp(["a_play:compile"])
    warm_up.start()
    assert begun.wait(30)
    warm_up.stop()
    assert warm_up.is_over
    assert not ended
