"""The parts of packaging/run.py that decide something; nothing is installed here."""

from __future__ import annotations

import contextlib
import importlib.util
import json
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from types import ModuleType

import pytest

from dsl_core.reconstruction.spectral.solving import lane_solver

SCRIPT = Path(__file__).resolve().parents[2] / "packaging" / "run.py"


def load() -> ModuleType:
    spec = importlib.util.spec_from_file_location("packaging_run", SCRIPT)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


run = load()


def start(*arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, str(SCRIPT), *arguments], capture_output=True, text=True, check=False
    )


def ready_environment(folder: Path, program: str, lines: str) -> Path:
    """A folder that passes for a finished environment, with one program in it."""
    file = run.venv_program(folder, program)
    file.parent.mkdir(parents=True)
    file.write_text(f"#!{sys.executable}\n{lines}")
    file.chmod(0o755)
    run.venv_program(folder, "python").symlink_to(sys.executable)
    (folder / run.STAMP).write_text(json.dumps({"digest": run.digest("default"), "torch": "default"}))
    return folder


def test_the_script_needs_only_the_standard_library() -> None:
    command = [sys.executable, "-I", "-S", str(SCRIPT), "--help"]
    assert "demo" in subprocess.run(command, capture_output=True, text=True, check=True).stdout


@pytest.mark.parametrize("arguments", [(), ("dance",), ("--torch", "tpu", "demo")])
def test_wrong_arguments_end_with_code_2_and_the_usage(arguments: tuple[str, ...]) -> None:
    answer = start(*arguments)
    assert answer.returncode == 2
    assert "usage: run.py" in answer.stderr


@pytest.mark.parametrize("version", [(3, 8), (3, 15)])
def test_a_python_that_does_not_fit_is_told_so(version: tuple[int, int]) -> None:
    code = f"import sys, runpy; sys.version_info = {(*version, 0)}; runpy.run_path({str(SCRIPT)!r})"
    answer = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert answer.returncode == 1
    assert f"this is {version[0]}.{version[1]}" in answer.stderr
    assert "Traceback" not in answer.stderr


def test_options_after_the_command_belong_to_the_command() -> None:
    asked = run.parse(["--torch", "cpu", "demo", "--json", "--venv", "x"])
    assert (asked.command, asked.torch, asked.arguments) == ("demo", "cpu", ["--json", "--venv", "x"])


def test_tests_say_how_long_they_take_here(tmp_path: Path) -> None:
    assert run.expected_s(tmp_path, "test quick") == run.USUAL_S["test quick"]
    run.remember_s(tmp_path, "test", 1234.4)
    assert run.expected_s(tmp_path, "test") == 1234
    assert run.expected_s(tmp_path, "test quick") == run.USUAL_S["test quick"]
    (tmp_path / run.TIMES).write_text("[]")
    assert run.expected_s(tmp_path, "test") == run.USUAL_S["test"]


def test_slow_tests_are_left_out_unless_all_are_asked_for() -> None:
    assert run.chosen_tests([]) == ("test", ["-m", "not slow"])
    assert run.chosen_tests(["all", "-x"]) == ("test all", ["-x"])
    assert run.chosen_tests(["quick"]) == ("test quick", ["-m", "not slow", *run.QUICK])
    assert run.chosen_tests(["tests/optics", "-n", "0"]) == ("", ["tests/optics", "-n", "0"])
    assert all(what in run.USUAL_S for what in ("test", "test all", "test quick"))


def test_what_is_quick_is_there() -> None:
    assert all((run.ROOT / path).exists() for path in run.QUICK)
    assert (run.ROOT / run.FIRST_USE[1].replace(".", "/")).with_suffix(".py").exists()


def test_what_runs_beside_the_checks_has_ended_before_the_tests(tmp_path: Path) -> None:
    made, late = tmp_path / "made", "import sys, time; time.sleep(0.2); open(sys.argv[1], 'w').close()"
    with run.beside([sys.executable, "-c", late, str(made)], dict(os.environ)):
        pass
    assert made.exists()


def test_what_runs_beside_the_checks_ends_when_they_are_broken_off() -> None:
    started, endless = time.monotonic(), [sys.executable, "-c", "import time; time.sleep(60)"]
    with pytest.raises(OSError, match="broken off"), run.beside(endless, dict(os.environ)):
        raise OSError("broken off")
    assert time.monotonic() - started < 50


def test_a_first_demo_compiles_the_solver_meanwhile_and_does_not_wait_for_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[object] = []

    @contextlib.contextmanager
    def noted(command: Sequence[str], variables: dict[str, str], limit_s: float) -> Iterator[None]:
        asked.append((command[1:], limit_s, variables["VIRTUAL_ENV"]))
        yield
        asked.append("ended")

    monkeypatch.setattr(run, "beside", noted)

    def dispatched(command: str, *_: object) -> int:
        asked.append(command)
        return 0

    monkeypatch.setattr(run, "dispatch", dispatched)
    for is_new, command in ((True, "demo"), (False, "demo"), (True, "dsl-scan")):
        monkeypatch.setattr(run, "prepare", lambda *_, new=is_new, **__: new)
        assert run.main(["--venv", str(tmp_path), command]) == 0
    assert asked == [(list(run.SOLVER), 0.0, str(tmp_path)), "demo", "ended", "demo", "dsl-scan"]
    monkeypatch.setattr(lane_solver, "compile_early", lambda: asked.append("compiled"))
    exec(run.SOLVER[1], {})
    assert asked[-1] == "compiled"


def test_what_ldconfig_does_not_list_is_missing() -> None:
    present = [library for library in run.LIBRARIES if library != "libEGL.so.1"]
    listing = "2 libs found in cache\n" + "\n".join(
        f"\t{name} (libc6,x86-64) => /lib/{name}" for name in present
    )
    assert run.missing_packages(listing, with_tests=False) == ["libegl1"]
    absent = run.missing_packages(listing, with_tests=True, which=lambda program: None)
    assert absent == ["libegl1", "xvfb", "xauth", "x11-xserver-utils"]


def test_a_later_setting_of_pip_wins_and_others_are_left_out() -> None:
    listing = "global.find-links='a'\nglobal.timeout='9'\n:env:.find-links='b\\nb2'\nglobal.index-url='i'"
    assert run.pip_settings(listing) == {"find-links": ["b", "b2"], "index-url": ["i"]}


def test_a_setting_of_pip_that_is_empty_was_not_given() -> None:
    listing = "global.index-url='i'\n:env:.index-url=''\n:env:.find-links=' '\nglobal.cert='/my certs/ca.pem'"
    assert run.pip_settings(listing) == {"index-url": ["i"], "cert": ["/my certs/ca.pem"]}


def test_links_of_pip_and_uv_are_joined_once(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("UV_FIND_LINKS", "b,c")
    assert run.find_links({"find-links": ["a", "b"]}) == ["a", "b", "c"]


def test_torch_comes_from_a_local_folder_where_there_is_one(tmp_path: Path) -> None:
    links = [str(tmp_path)]
    local = ["--find-links", links[0]]
    assert run.torch_options("cpu", links, "linux") == [*local, "--torch-backend", "cpu"]
    assert run.torch_options("cpu", links, "win32") == local
    (tmp_path / "torch-2.13.0+cpu-cp311-cp311-manylinux_2_28_x86_64.whl").touch()
    assert run.torch_options("cpu", links, "linux") == local


def test_without_a_wish_torch_is_small_where_that_can_be_had() -> None:
    small, registry = ["--torch-backend", "cpu"], list[str]()
    assert run.torch_choices("default", [], "linux") == [small, registry]
    assert run.torch_choices("default", [], "darwin") == [registry]
    assert run.torch_choices("cpu", [], "linux") == [["--reinstall-package", "torch", *small]]


def test_cuda_is_never_taken_from_a_local_cpu_folder(tmp_path: Path) -> None:
    assert str(tmp_path) not in run.torch_options("cuda", [str(tmp_path)], "linux")
    assert run.torch_options("cuda", [], "win32")[-2:] == ["--torch-backend", "cu130"]
    with pytest.raises(run.SetupError, match="macOS"):
        run.torch_options("cuda", [], "darwin")


def test_a_folder_that_is_no_environment_is_left_alone(tmp_path: Path) -> None:
    precious = tmp_path / "thesis.txt"
    precious.write_text("years of work")
    with pytest.raises(run.SetupError, match="not a virtual environment"):
        run.make_venv(tmp_path)
    with pytest.raises(run.SetupError, match="not a virtual environment"):
        run.make_venv(precious)
    assert precious.read_text() == "years of work"


@pytest.mark.slow
def test_an_environment_whose_making_was_broken_off_gets_its_pip(tmp_path: Path) -> None:
    venv = tmp_path / "venv"
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", str(venv)], check=True)
    (venv / "kept.txt").touch()
    run.make_venv(venv)
    python = str(run.venv_program(venv, "python"))
    subprocess.run([python, "-m", "pip", "--version"], check=True, capture_output=True)
    assert (venv / "kept.txt").exists()


def test_a_change_of_the_pins_or_of_torch_asks_for_a_new_installation(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pins = tmp_path / "constraints.txt"
    pins.write_text("a==1")
    monkeypatch.setattr(run, "CONSTRAINTS", pins)
    before = run.digest("cpu")
    assert before == run.digest("cpu")
    assert before != run.digest("cuda")
    pins.write_text("a==2")
    assert before != run.digest("cpu")


@pytest.mark.parametrize("text", ["", "{", "[]"])
def test_a_damaged_stamp_counts_as_none(tmp_path: Path, text: str) -> None:
    (tmp_path / run.STAMP).write_text(text)
    assert run.read_stamp(tmp_path) == {}


@pytest.mark.skipif(os.name == "nt", reason="the stand-in for dsl-scan is a script with a shebang")
def test_output_arguments_and_exit_code_pass_through(tmp_path: Path) -> None:
    venv = ready_environment(tmp_path, "dsl-scan", "import sys; print(sys.argv[1:]); sys.exit(7)")
    answer = start("--venv", str(venv), "dsl-scan", "info", "--json")
    assert (answer.returncode, answer.stdout, answer.stderr) == (7, "['info', '--json']\n", "")


@pytest.mark.skipif(os.name == "nt", reason="signals of POSIX")
def test_ctrl_c_lets_the_command_put_things_in_order(tmp_path: Path) -> None:
    """The whole process group gets the signal, as from a terminal."""
    lines = (
        "import sys, time\n"
        "try:\n    print('ready', flush=True); time.sleep(60)\n"
        "except KeyboardInterrupt:\n    time.sleep(0.6); print('in order'); sys.exit(2)\n"
    )
    venv = ready_environment(tmp_path, "dsl-scan", lines)
    command = [sys.executable, str(SCRIPT), "--venv", str(venv), "dsl-scan"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, start_new_session=True)
    guard = threading.Timer(30, process.kill)
    guard.start()
    assert process.stdout is not None
    assert process.stdout.readline() == "ready\n"
    os.killpg(process.pid, signal.SIGINT)
    rest = process.communicate()[0]
    guard.cancel()
    assert (process.returncode, rest) == (2, "in order\n")


def test_a_command_that_hangs_is_ended(capsys: pytest.CaptureFixture[str]) -> None:
    hangs = [sys.executable, "-c", "import time; time.sleep(60)"]
    assert run.run(hangs, dict(os.environ), limit_s=0.2) == (124, False)
    assert f"{Path(sys.executable).name} did not end within 0 s and was stopped" in capsys.readouterr().err
