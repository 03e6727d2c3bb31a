"""What there is on this computer, as text to send to whoever helps."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from dsl_core.cli.options import Json
from dsl_core.cli.output import Output


def doctor(
    devices: Annotated[
        bool, typer.Option("--devices/--no-devices", help="Also look for cameras, stages and others.")
    ] = True,
    json: Json = False,
) -> None:
    """Tell versions, memory, graphics, screens and devices; send it along with a question or a fault."""
    from dsl_core.workflows.diagnosis import diagnosis

    output = Output(json)
    found: dict[str, str] = {}
    for part, text in diagnosis(Path.cwd(), devices):
        found[part] = text
        output.say(f"{part:32s} {text}")
    output.put(found=found)
    output.finish()
