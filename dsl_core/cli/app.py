"""The commands of ``dsl-scan`` and its global options."""

from __future__ import annotations

from typing import Annotated

import typer

import dsl_core
from dsl_core.cli import (
    calibrate,
    calibrations,
    compare,
    demo,
    effects,
    files,
    gui,
    results,
    scans,
    tradeoff,
)

app = typer.Typer(
    name="dsl-scan",
    add_completion=False,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
for command in (
    demo.demo,
    scans.rigs,
    scans.scenes,
    effects.effects,
    scans.plan,
    tradeoff.tradeoff,
    tradeoff.design,
    scans.scan,
    scans.resume,
    results.reconstruct,
    results.evaluate,
    compare.compare,
    compare.depth_test,
    compare.sweep,
    results.export,
):
    app.command()(command)
app.command("import")(files.import_)
app.command()(files.info)
app.command()(gui.gui)
app.command()(calibrate.selftest)
app.add_typer(calibrate.calibrate, name="calibrate")
app.add_typer(calibrations.calibrations, name="calibrations")


def _print_version(requested: bool) -> None:
    if requested:
        typer.echo(f"dsl-scan {dsl_core.__version__}")
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
