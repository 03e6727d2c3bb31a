#!/usr/bin/env python3
"""Set up dsl-scan in a virtual environment and run it; needs only Python 3.11 to 3.14 and a network.

python3 packaging/run.py demo [...]       a scan on the digital twin, from patterns to a report
python3 packaging/run.py test [...]       all checks, and the tests but slow ones; what follows goes to pytest
python3 packaging/run.py test all         the same with the slow tests, as before a release
python3 packaging/run.py test quick       what breaks most often, in a minute and a half
python3 packaging/run.py dsl-scan [...]   the command line of the project
python3 packaging/run.py shell            a shell inside the environment
python3 packaging/run.py site             the site of the documentation, in build/site/html
python3 packaging/run.py bundle           the program with all it needs in build/bundle, and a Debian package
python3 packaging/run.py lock             write packaging/constraints.txt again (for maintainers)
"""

import argparse
import ast
import contextlib
import hashlib
import json
import os
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

# Before the first annotation that an old Python cannot read, so that this sentence is what the user sees.
if not (3, 11) <= sys.version_info[:2] <= (3, 14):  # a newer one lacks wheels of what we need
    sys.exit(
        "dsl-scan needs Python 3.11, 3.12, 3.13 or 3.14; this is {}.{}. Start the script with one of those, "
        "for example: python3.12 packaging/run.py demo".format(*sys.version_info[:2])
    )

ROOT = Path(__file__).resolve().parent.parent
CONSTRAINTS = ROOT / "packaging" / "constraints.txt"
STAMP = "dsl-scan-setup.json"
COMMANDS = ("demo", "test", "dsl-scan", "shell", "site", "bundle", "lock")

# Shared library or program -> Debian package. Qt and VTK load these at run time; their wheels lack them.
LIBRARIES = {
    "libglib-2.0.so.0": "libglib2.0-0",
    "libGL.so.1": "libgl1",
    "libEGL.so.1": "libegl1",
    "libfontconfig.so.1": "libfontconfig1",
    "libxkbcommon.so.0": "libxkbcommon0",
    "libdbus-1.so.3": "libdbus-1-3",
    "libxkbcommon-x11.so.0": "libxkbcommon-x11-0",
    "libxcb-cursor.so.0": "libxcb-cursor0",
    "libxcb-icccm.so.4": "libxcb-icccm4",
    "libxcb-keysyms.so.1": "libxcb-keysyms1",
    "libxcb-shape.so.0": "libxcb-shape0",
}
TEST_PROGRAMS = {"Xvfb": "xvfb", "xauth": "xauth", "xrandr": "x11-xserver-utils"}

CHECKS = (
    ("ruff check", ("ruff", "check", ".")),
    ("ruff format", ("ruff", "format", "--check", ".")),
    ("mypy", ("mypy",)),
    ("import contracts", ("lint-imports", "--no-cache")),
)
#: Each process gets its part in order, as tests of a file share what they prepare; one that is done takes
#: tests from another, so that all end together. More processes would cost too much memory.
SHARED = ("-n", "logical", "--maxprocesses", "4", "--dist", "worksteal")


#: Makes what a new environment lacks while mypy has one core to itself; all processes of the tests would.
FIRST_USE = ("-m", "tests.cases.first_use")
#: Compiles the loops that solve spectra while the first demo scans on another core: a third of its time.
SOLVER = (
    "-c",
    "from dsl_core.reconstruction.spectral.solving import lane_solver; lane_solver.compile_early()",
)

#: Tests that are quick and reach far, for a look between two changes; mypy keeps what it found.
QUICK = (
    *(
        "tests/architecture/test_dependencies.py",
        "tests/architecture/test_imports.py",
        "tests/api",
        "tests/install",
    ),
    *("tests/io", "tests/model", "tests/optics", "tests/packaging_script", "tests/patterns", "tests/solve"),
)
#: One test in ten takes two thirds of the time: whole scans and calibrations, and hours at the window.
NOT_SLOW = ("-m", "not slow")
#: Seconds on two cores, said before a computer's own first run is known.
USUAL_S = {"test": 720, "test all": 1600, "test quick": 90}
TIMES = "dsl-scan-times.json"
#: The longest that one check, or all tests, may take: what hangs must not keep a server for a day.
LIMIT_S = 3600.0


class SetupError(Exception):
    """The environment cannot be made; the message says what to do."""


def say(text: str) -> None:
    """Tell the person, on the error stream, so that the output of ``dsl-scan --json`` stays clean."""
    print(f"[run.py] {text}", file=sys.stderr, flush=True)


@contextlib.contextmanager
def timed(what: str) -> Iterator[None]:
    """Name a step before it starts and print its seconds when it is done."""
    say(f"{what} ...")
    start = time.monotonic()
    yield
    say(f"{what}: {time.monotonic() - start:.1f} s")


def missing_packages(
    listing: str, with_tests: bool, which: Callable[[str], str | None] = shutil.which
) -> list[str]:
    """Debian packages whose libraries ``ldconfig -p`` does not list or whose programs are not found."""
    listed = {line.split()[0] for line in listing.splitlines() if line.strip()}
    missing = [package for library, package in LIBRARIES.items() if library not in listed]
    if with_tests:
        missing += [package for program, package in TEST_PROGRAMS.items() if which(program) is None]
    return missing


def install_system_libraries(with_tests: bool) -> None:
    """Install what Qt and VTK need as root on Debian, otherwise print the command; never stops the setup."""
    ldconfig = shutil.which("ldconfig", path=os.environ.get("PATH", "") + ":/sbin:/usr/sbin")
    if ldconfig is None:  # Windows and macOS: the wheels bring everything
        return
    listing = subprocess.run([ldconfig, "-p"], capture_output=True, text=True, check=False).stdout
    missing = missing_packages(listing, with_tests)
    if not missing:
        return
    line = f"apt-get update && apt-get install -y --no-install-recommends {' '.join(missing)}"
    if shutil.which("apt-get") is None:
        say(f"Windows and 3D views need what Debian calls {' '.join(missing)}. Please install it.")
    elif os.geteuid() != 0:
        say(f"Windows and 3D views need system libraries. Install them with: sudo sh -c '{line}'")
    else:
        with timed(f"Installing system libraries: {' '.join(missing)}"):
            environment = {**os.environ, "DEBIAN_FRONTEND": "noninteractive"}
            done = subprocess.run(["sh", "-c", f"{{ {line}; }} >/dev/null"], env=environment, check=False)
        if done.returncode != 0:
            say(f"That failed; windows and 3D views may not work. Run it yourself: {line}")


def venv_program(venv: Path, name: str) -> Path:
    """Path of a program inside a virtual environment."""
    return venv / "Scripts" / f"{name}.exe" if os.name == "nt" else venv / "bin" / name


def venv_variables(venv: Path) -> dict[str, str]:
    """Environment variables of an activated virtual environment."""
    variables = {key: value for key, value in os.environ.items() if key != "PYTHONHOME"}
    variables["VIRTUAL_ENV"] = str(venv)
    variables["PATH"] = str(venv_program(venv, "python").parent) + os.pathsep + variables.get("PATH", "")
    variables.setdefault("QT_API", "pyside6")
    return variables


def pip_settings(listing: str) -> dict[str, list[str]]:
    """Values of ``pip config list`` that uv must be told, by name; later lines win as they do in pip.

    Values that are empty, such as a variable's that is set to nothing, count for pip as not given.
    """
    settings: dict[str, list[str]] = {}
    for line in listing.splitlines():
        key, _, value = line.partition("=")
        name = key.rpartition(".")[2].strip()
        if name in ("cert", "find-links", "index-url"):
            text = str(ast.literal_eval(value)).strip()
            if text:
                settings[name] = [text] if name == "cert" else text.split()
    return settings


def find_links(settings: dict[str, list[str]]) -> list[str]:
    """Folders and pages with wheels, from pip's settings and from UV_FIND_LINKS (comma-separated)."""
    from_uv = [link for link in os.environ.get("UV_FIND_LINKS", "").split(",") if link]
    return list(dict.fromkeys([*settings.get("find-links", []), *from_uv]))


def torch_options(choice: str, links: Sequence[str], platform: str = sys.platform) -> list[str]:
    """Options of ``uv pip install`` for a build of torch: cpu, cuda, or what the ``registry`` has.

    The registry has a CUDA build for Linux, of several gigabytes, and a CPU build for other systems. Raises
    `SetupError` for CUDA on macOS, which has none.
    """
    local = [option for link in links for option in ("--find-links", link)]
    if choice == "registry":
        return local
    linux = platform.startswith("linux")
    if choice == "cuda":
        if platform == "darwin":
            raise SetupError("There is no CUDA build of torch for macOS; leave out --torch cuda.")
        # Local wheels are left out: one of the CPU build would win over the registry's.
        return [] if linux else ["--torch-backend", "cu130"]
    has_local_cpu = any(list(Path(link).glob("torch-*+cpu-*.whl")) for link in links)
    backend = ["--torch-backend", "cpu"] if linux and not has_local_cpu else []
    return [*local, *backend]


def torch_choices(asked: str, links: Sequence[str], platform: str = sys.platform) -> list[list[str]]:
    """Options for torch to try one after the other; a build that was asked for has no substitute.

    Without a wish it is the CPU build, or the registry's where the CPU build's index cannot be reached.
    """
    if asked == "default":
        options = [torch_options(choice, links, platform) for choice in ("cpu", "registry")]
        return options if options[0] != options[1] else options[:1]
    # The other build has the same version and would be kept.
    return [["--reinstall-package", "torch", *torch_options(asked, links, platform)]]


def digest(torch: str) -> str:
    """Hash of everything that decides what is installed."""
    parts = [(ROOT / "pyproject.toml").read_bytes(), CONSTRAINTS.read_bytes()]
    parts += [str(part).encode() for part in (torch, sys.version_info[:2], ROOT)]
    return hashlib.sha256(b"\0".join(parts)).hexdigest()


def read_stamp(venv: Path) -> dict[str, str]:
    """What the last complete installation left; empty when there was none."""
    try:
        stamp = json.loads((venv / STAMP).read_text())
    except (OSError, ValueError):
        return {}
    return stamp if isinstance(stamp, dict) else {}


def make_venv(venv: Path) -> None:
    """Make the virtual environment; one made by another Python is replaced, anything else is left alone."""
    config = venv / "pyvenv.cfg"
    if venv.exists() and not config.exists() and (not venv.is_dir() or any(venv.iterdir())):
        raise SetupError(f"{venv} is not a virtual environment. Name another folder with --venv.")
    version = ".".join(map(str, sys.version_info[:2]))
    python = venv_program(venv, "python")
    command = [sys.executable, "-m", "venv", "--clear", str(venv)]
    if config.exists() and python.exists() and f" = {version}." in config.read_text():
        command = [str(python), "-m", "ensurepip"]  # does nothing, unless an earlier setup was interrupted
    with timed(f"Preparing the virtual environment in {venv}"):
        made = subprocess.run(command, capture_output=True, text=True, check=False)
    if made.returncode != 0:
        say((made.stdout + made.stderr).strip())
        raise SetupError(
            f"Python {version} could not make a virtual environment in {venv}. Is the folder writable? "
            "On Debian and Ubuntu the module is a package of its own: apt-get install python3-venv"
        )


def install(venv: Path, torch: str) -> None:
    """Install the project and its pinned dependencies; raises `SetupError` when that fails."""
    python = str(venv_program(venv, "python"))
    constraints = ["--constraint", str(CONSTRAINTS)]
    quiet = ["--quiet", "--disable-pip-version-check", "--retries", "2"]
    with timed("Installing uv"):
        done = subprocess.run([python, "-m", "pip", "install", *quiet, *constraints, "uv"], check=False)
    if done.returncode == 0:
        listing = subprocess.run(
            [python, "-m", "pip", "config", "list"], capture_output=True, text=True, check=False
        )
        settings = pip_settings(listing.stdout)
        index = []
        if "index-url" in settings and "UV_DEFAULT_INDEX" not in os.environ:
            index = ["--default-index", settings["index-url"][0]]
        variables = {key: value for key, value in os.environ.items() if key != "UV_FIND_LINKS"}
        if "cert" in settings:
            variables.setdefault("SSL_CERT_FILE", settings["cert"][0])
        command = [python, "-m", "uv", "pip", "install", "--python", python, *index, *constraints]
        command += ["--build-constraints", str(CONSTRAINTS), "--editable", f"{ROOT}[test]"]
        for options in torch_choices(torch, find_links(settings)):
            with timed("Installing dsl-scan and what it needs"):
                done = subprocess.run([*command, *options], env=variables, check=False)
            if done.returncode == 0:
                break
    if done.returncode != 0:
        raise SetupError(
            "The installation failed; the lines above say why. It needs a network, or PIP_FIND_LINKS with a "
            "folder of wheels; behind a proxy set HTTPS_PROXY. Then run the same command again."
        )


def prepare(venv: Path, torch: str | None, with_tests: bool) -> bool:
    """Bring the environment up to date, and say whether it is new; does nothing when it already is."""
    stamp = read_stamp(venv)
    torch = torch or stamp.get("torch", "default")
    current = {"digest": digest(torch), "torch": torch}
    fresh = stamp == current and venv_program(venv, "python").exists()
    if not fresh or with_tests:
        install_system_libraries(with_tests)
    if not fresh:
        make_venv(venv)
        (venv / STAMP).unlink(missing_ok=True)
        install(venv, torch)
        (venv / STAMP).write_text(json.dumps(current))
    return not fresh


def run(
    command: Sequence[str],
    variables: dict[str, str],
    folder: Path | None = None,
    limit_s: float | None = None,
) -> tuple[int, bool]:
    """Run a command; return its exit code and whether Ctrl-C was pressed meanwhile.

    The terminal sends Ctrl-C to the command too, which needs time to clean up. One that runs longer than
    ``limit_s`` is ended, and answers 124.
    """
    process = subprocess.Popen(list(command), env=variables, cwd=folder)
    interrupted = False
    while True:
        try:
            code = process.wait(limit_s)
        except KeyboardInterrupt:
            interrupted = True
        except subprocess.TimeoutExpired:
            say(f"{Path(command[0]).name} did not end within {limit_s:.0f} s and was stopped")
            process.kill()
            process.wait()
            return 124, interrupted
        else:
            return (code if code >= 0 else 128 - code), interrupted


@contextlib.contextmanager
def beside(command: Sequence[str], variables: dict[str, str], limit_s: float = LIMIT_S) -> Iterator[None]:
    """Run a command meanwhile, then wait ``limit_s`` for its end; what it fails in shows later as well."""
    quiet = subprocess.DEVNULL
    process = subprocess.Popen(list(command), env=variables, cwd=ROOT, stdout=quiet, stderr=quiet)
    try:
        yield
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(limit_s)
    finally:
        process.kill()
        process.wait()


def before_it_is_needed(venv: Path) -> contextlib.AbstractContextManager[None]:
    """Compile, meanwhile, what the first reconstruction in a new environment would wait for."""
    return beside([str(venv_program(venv, "python")), *SOLVER], venv_variables(venv), limit_s=0.0)


def expected_s(venv: Path, what: str) -> float:
    """How long tests took here the last time, or usually take on two cores."""
    try:
        return float(json.loads((venv / TIMES).read_text())[what])
    except (OSError, ValueError, KeyError, TypeError):
        return USUAL_S[what]


def remember_s(venv: Path, what: str, seconds: float) -> None:
    """Keep how long tests took, for `expected_s`; a folder that cannot be written is no reason to fail."""
    with contextlib.suppress(OSError):
        times = {name: expected_s(venv, name) for name in USUAL_S} | {what: round(seconds)}
        (venv / TIMES).write_text(json.dumps(times))


def chosen_tests(arguments: Sequence[str]) -> tuple[str, list[str]]:
    """Which set of tests is asked for, empty for one of the person's own, and what pytest is told of it."""
    sets = {"quick": (*NOT_SLOW, *QUICK), "all": ()}
    if not arguments:
        return "test", list(NOT_SLOW)
    if arguments[0] in sets:
        return f"test {arguments[0]}", [*sets[arguments[0]], *arguments[1:]]
    return "", list(arguments)


def test(venv: Path, arguments: Sequence[str]) -> int:
    """Run every check and the tests; the first exit code that is not zero is the answer."""
    # Tests start many processes. What they import is compiled once, and kept with the environment.
    variables = venv_variables(venv) | {"PYTHONPYCACHEPREFIX": str(venv / "bytecode")}
    variables.pop("PYTHONDONTWRITEBYTECODE", None)
    what, chosen = chosen_tests(arguments)
    if what:
        say(f"{what} takes about {max(1, round(expected_s(venv, what) / 60))} min on this computer")
    results: list[tuple[str, int, float]] = []

    def completes(name: str, program: str, *options: str) -> bool:
        start = time.monotonic()
        say(f"{name} ...")
        code, interrupted = run([str(venv_program(venv, program)), *options], variables, ROOT, LIMIT_S)
        results.append((name, code, time.monotonic() - start))
        return not interrupted

    with beside([str(venv_program(venv, "python")), *FIRST_USE], variables):
        if not all(completes(name, *command) for name, command in CHECKS):
            return 130
    if not completes("pytest", "pytest", *SHARED, "--durations=10", *chosen):
        return 130
    for name, code, seconds in results:
        say(f"{name:17s} {'passed' if code == 0 else f'FAILED ({code})':11s} {seconds:6.1f} s")
    worst = next((code for _, code, _ in results if code != 0), 0)
    if worst == 0 and what:
        remember_s(venv, what, sum(seconds for _, _, seconds in results))
    return worst


def install_group(venv: Path, group: str) -> None:
    """Install the tools of a dependency group, pinned; raises `SetupError`."""
    python = str(venv_program(venv, "python"))
    command = [python, "-m", "uv", "pip", "install", "--quiet", "--python", python, "--group", group]
    command += ["--constraint", str(CONSTRAINTS)]
    with timed(f"Installing what {group} needs"):
        done = subprocess.run(command, cwd=ROOT, check=False)
    if done.returncode != 0:
        raise SetupError("That failed; the lines above say why. It needs a network.")


def build(venv: Path, what: str, arguments: Sequence[str]) -> int:
    """Make the site or the bundle with the script of that name."""
    install_group(venv, what)
    script = ROOT / "packaging" / what / "make.py"
    return run([str(venv_program(venv, "python")), str(script), *arguments], venv_variables(venv), ROOT)[0]


def lock(venv: Path) -> int:
    """Write the constraints again: one set of versions for all Pythons and systems."""
    command = [str(venv_program(venv, "python")), "-m", "uv", "pip", "compile", "--universal", "--upgrade"]
    command += ["--fork-strategy", "fewest", "--python-version", "3.11", "--no-annotate", "--quiet"]
    command += ["--custom-compile-command", "python3 packaging/run.py lock"]
    command += [
        "--all-extras",
        "--group",
        "lock",
        "--group",
        "site",
        "--group",
        "bundle",
        "--output-file",
        str(CONSTRAINTS),
        "pyproject.toml",
    ]
    hidden = ("UV_FIND_LINKS", "PIP_FIND_LINKS")  # local builds must not get into the file
    variables = {key: value for key, value in os.environ.items() if key not in hidden}
    return run(command, variables, ROOT)[0]


def parse(arguments: Sequence[str] | None) -> argparse.Namespace:
    """Read the command line; wrong use ends with exit code 2."""
    parser = argparse.ArgumentParser(
        prog="run.py", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--venv", type=Path, default=ROOT / ".venv", help="virtual environment (default .venv)"
    )
    parser.add_argument("--torch", choices=("cpu", "cuda"), help="build of torch (default: CPU)")
    parser.add_argument("command", choices=COMMANDS)
    parser.add_argument("arguments", nargs=argparse.REMAINDER, help="passed on to the command")
    return parser.parse_args(arguments)


def dispatch(command: str, venv: Path, arguments: Sequence[str]) -> int:
    """Run the requested command inside the environment."""
    if command == "test":
        return test(venv, arguments)
    if command in ("site", "bundle"):
        return build(venv, command, arguments)
    if command == "lock":
        return lock(venv)
    if command == "shell":
        shell = (
            os.environ.get("COMSPEC", "cmd.exe") if os.name == "nt" else os.environ.get("SHELL", "/bin/sh")
        )
        return run([shell, *arguments], venv_variables(venv))[0]
    program = [str(venv_program(venv, "dsl-scan")), *(["demo"] if command == "demo" else []), *arguments]
    return run(program, venv_variables(venv))[0]


def main(arguments: Sequence[str] | None = None) -> int:
    """Prepare the environment, run the command and return its exit code."""
    asked = parse(arguments)
    venv = Path(os.path.abspath(asked.venv))
    try:
        is_new = prepare(venv, asked.torch, with_tests=asked.command == "test")
        start = time.monotonic()
        with before_it_is_needed(venv) if is_new and asked.command == "demo" else contextlib.nullcontext():
            code = dispatch(asked.command, venv, asked.arguments)
    except (SetupError, OSError) as error:
        say(str(error))
        return 2
    except KeyboardInterrupt:
        say("Stopped. Run the same command again to continue.")
        return 130
    if asked.command in ("demo", "test"):
        say(f"{asked.command} took {time.monotonic() - start:.1f} s, exit code {code}")
    return code


if __name__ == "__main__":
    sys.exit(main())
