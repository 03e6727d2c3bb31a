"""The commands of ``dsl-scan``, and from a command line to an exit code.

An error becomes a sentence, and a traceback only on request.
"""

from __future__ import annotations

import contextlib
import json
import logging
import os
import re
import sys
import traceback
import warnings
from collections.abc import Callable
from functools import cache
from typing import Annotated

import typer

from dsl_core.cli import (
    answers,
    calibrate,
    calibrations,
    compare,
    demo,
    doctor,
    effects,
    files,
    gui,
    reconstruct,
    results,
    rigs,
    scans,
    tradeoff,
)
from dsl_core.errors import Cancelled, DslError, PlanError, TakenError
from dsl_core.extras import missing_package
from dsl_core.version import __version__

OK, BUG, WRONG_INPUT, STOPPED = 0, 1, 2, 130
#: Wrong use of a command line; typer gives this class no public name.
_WrongUse: type[BaseException] = typer.BadParameter.__mro__[2]

#: What the parser's checks say, and how this program says it.
_PLAIN = {
    # An option with a letter is called by its name alone, as the others are.
    r"'(--[\w-]+)' / '-\w'": r"'\1'",
    r"Invalid value for '(\S+)': Input should be a valid number.*": r"\1 must be a number.",
    r"Invalid value for '(\S+)': Input should be a valid integer.*": r"\1 must be a whole number.",
    r"Invalid value for '(\S+)': Input should be greater than or equal to (\S+)": r"\1 must be at least \2",
    r"Invalid value for '(\S+)': Input should be less than or equal to (\S+)": r"\1 must be at most \2",
    r"Invalid value for '(\S+)': Input should be": r"\1 must be",
    r"Invalid value for '(\S+)': Value error, (.*) is not one of (.*?)\.?$": r"\1 must be one of \3, not \2",
    r"Got unexpected extra argument(?:\(s\)|s)? \((.*)\)": r"Too many arguments: \1",
    r"Option '(\S+)' requires an argument": r"\1 needs a value",
    r"No such (command|option):? ": r"There is no \1 ",
    r" \(Possible options: (.*)\)": r". Did you mean \1?",
}

app = typer.Typer(
    name="dsl-scan",
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
for command in (
    demo.demo,
    scans.scenes,
    effects.effects,
    scans.plan,
    tradeoff.tradeoff,
    tradeoff.design,
    scans.scan,
    scans.resume,
    reconstruct.reconstruct,
    reconstruct.batch,
    results.evaluate,
    compare.compare,
    compare.depth_test,
    compare.sweep,
    results.export,
    results.mesh,
    answers.classify,
    answers.spectra,
    answers.colours,
    answers.report,
):
    app.command()(command)
app.command("import")(files.import_)
app.command()(files.info)
app.command()(gui.gui)
app.command()(doctor.doctor)
app.command()(calibrate.selftest)
app.add_typer(rigs.rigs, name="rigs")
app.add_typer(calibrate.calibrate, name="calibrate")
app.add_typer(calibrations.calibrations, name="calibrations")


def _print_version(requested: bool) -> None:
    if requested:
        typer.echo(f"dsl-scan {__version__}")
        raise typer.Exit


@app.callback()
def _globally(
    version: Annotated[
        bool,
        typer.Option("--version", is_eager=True, callback=_print_version, help="Print the version and exit."),
    ] = False,
    debug: Annotated[bool, typer.Option("--debug", help="Show the traceback of an error.")] = False,
) -> None:
    """Hyperspectral 3D scanning by Dispersed Structured Light."""


@cache
def _commands() -> Callable[..., int | None]:
    """All commands, which take longer to assemble than a short one to run."""
    return typer.main.get_command(app)


def run(arguments: list[str]) -> int:
    """Run one command and return its exit code."""
    debug = "--debug" in arguments
    # A global option may be anywhere, also after the command.
    arguments = [a for a in arguments if a != "--debug"]
    logging.basicConfig(level=logging.WARNING, format="%(message)s", stream=sys.stderr)
    if not debug:
        warnings.simplefilter("ignore")
    try:
        if "" in arguments:
            raise PlanError(
                "An argument is empty: perhaps a variable of the shell is not set. Name what is meant."
            )
        code = _commands()(arguments, prog_name="dsl-scan", standalone_mode=False)
        sys.stdout.flush()
    except BaseException as error:
        # Click turns a closed pipe into an exit of its own.
        if isinstance(error, BrokenPipeError) or isinstance(error.__context__, BrokenPipeError):
            return _leave_quietly()
        code, sentence = _judge(error, arguments)
        if debug:
            traceback.print_exc()
        return _complain(code, sentence, type(error).__name__, "--json" in arguments)
    if code == STOPPED:  # typer turns Ctrl-C into this code
        return _complain(
            code, "Stopped. What was finished before is kept.", "Cancelled", "--json" in arguments
        )
    return code or OK


def _judge(error: BaseException, arguments: list[str]) -> tuple[int, str]:
    """Exit code and sentence for anything that a command line raised."""
    if isinstance(error, Cancelled):
        return STOPPED, str(error)
    if isinstance(error, KeyboardInterrupt | typer.Abort):
        return STOPPED, "Stopped. What was finished before is kept."
    if isinstance(error, ModuleNotFoundError):
        error = missing_package(error) or error
    if isinstance(error, TakenError):
        return WRONG_INPUT, str(error).replace("allow it to be replaced", "add --force to replace it")
    if isinstance(error, DslError):
        return WRONG_INPUT, str(error)
    if isinstance(error, _WrongUse):
        return WRONG_INPUT, _usage(error, arguments)
    if isinstance(error, OSError):
        return WRONG_INPUT, _of_system(error)
    if isinstance(error, MemoryError):
        return (
            WRONG_INPUT,
            "There is not enough memory. Use a smaller image, fewer bands, or another machine.",
        )
    if isinstance(error, SystemExit):
        return (error.code if isinstance(error.code, int) else BUG), ""
    return BUG, (
        f"This is a bug in dsl-scan ({type(error).__name__}: {error})."
        " Run the command again with --debug and report what it prints."
    )


def _usage(error: BaseException, arguments: list[str]) -> str:
    """What was wrong with the command line, and which help to read."""
    message = " ".join(str(getattr(error, "format_message", error.__str__)()).split())
    for theirs, ours in _PLAIN.items():
        message = re.sub(theirs, ours, message)
    missing = re.fullmatch(r"Missing (?:argument|option) '(.+?)'\.?", message)
    if missing:
        meaning = getattr(getattr(error, "param", None), "help", None)
        message = f"{missing[1]} is missing" + (f": {meaning}" if meaning else "")
    if type(error).__name__ == "NoSuchOption" and getattr(error, "option_name", "") == "-o":
        message = "There is no option -o here; options of a rig are given with -O or --option"
    message = message or "A command of it is missing"
    ended = message if message.endswith("?") else f"{message.rstrip('.')}."
    return f"{ended} See '{_command_of(arguments)} --help'."


def _command_of(arguments: list[str]) -> str:
    """The command that a command line is for, also where the parser no longer says which it was in."""
    command, path = typer.main.get_command(app), "dsl-scan"
    for word in arguments:
        inner = getattr(command, "commands", {}).get(word)
        if inner is None:
            break
        command, path = inner, f"{path} {word}"
    return path


def _of_system(error: OSError) -> str:
    if isinstance(error, FileExistsError | NotADirectoryError) and error.filename:
        return f"{error.filename} cannot be made: a file is where a folder is needed. Choose another place."
    where = f"{error.filename}: " if error.filename else ""
    reason = error.strerror or str(error) or type(error).__name__
    return f"{where}{reason}. Check the path, its permissions and the space on its drive."


def _complain(code: int, sentence: str, kind: str, as_json: bool) -> int:
    if as_json:
        try:
            print(json.dumps({"error": {"kind": kind, "message": sentence}, "exit_code": code}), flush=True)
        except OSError:
            _leave_quietly()
    if sentence:
        # Where errors cannot be written either, the exit code tells.
        with contextlib.suppress(OSError):
            print(sentence, file=sys.stderr)
    return code


def _leave_quietly() -> int:
    """Nobody takes our output now, as after ``head`` has closed it: no error of its own."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    return OK
