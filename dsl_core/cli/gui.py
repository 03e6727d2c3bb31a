"""Open the window, which is another package: it is started by its entry point and never imported here."""

from __future__ import annotations

from enum import StrEnum
from importlib.metadata import EntryPoint
from pathlib import Path
from typing import Annotated

import typer

from dsl_core.cli.options import RigOptions, tab_rigs
from dsl_core.errors import DslError
from dsl_core.extras import missing_package, pip_command

#: The window of this package, so that it opens in a source tree without metadata too.
WINDOW = EntryPoint("dsl-scan-gui", "dsl_app.__main__:main", "gui_scripts")


class Colours(StrEnum):
    """Colours of the window."""

    SYSTEM = "system"
    LIGHT = "light"
    DARK = "dark"


def gui(
    path: Annotated[
        Path | None, typer.Argument(help="A scan, result, reference or calibration to open.")
    ] = None,
    rig: Annotated[
        str | None, typer.Option(help="Rig to connect instead of the last one used.", autocompletion=tab_rigs)
    ] = None,
    option: RigOptions = [],  # noqa: B006
    demo: Annotated[bool, typer.Option("--demo", help="Open a finished scan of the twin.")] = False,
    theme: Annotated[Colours | None, typer.Option(help="Colours to use instead of the last ones.")] = None,
) -> None:
    """Open the window: scan, calibrate and read spectra by hand."""
    if path is not None and not path.exists():
        raise DslError(f"{path} does not exist. Give a scan, result, reference or calibration, or nothing.")
    words = [] if path is None else [str(path)]
    if rig is not None:
        words += ["--rig", rig]
    for each in option:
        words += ["--option", each]
    if demo:
        words.append("--demo")
    if theme is not None:
        words += ["--theme", theme.value]
    try:
        main = WINDOW.load()
    except ImportError as error:
        missing = missing_package(error) if isinstance(error, ModuleNotFoundError) else None
        raise missing or DslError(
            f"The window cannot be opened here: {error}. Install dsl-scan with its desktop application:"
            f" {pip_command('gui')}."
        ) from error
    raise typer.Exit(main(words))
