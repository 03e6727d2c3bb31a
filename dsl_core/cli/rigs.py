"""Commands about rigs: which there are, and whether the devices of one work."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from dsl_core.cli.options import Json
from dsl_core.cli.output import Output

#: Exit code when a device does not work, as for other wrong input.
_BROKEN = 2

rigs = typer.Typer(invoke_without_command=True)


@rigs.callback()
def list_all(context: typer.Context, json: Json = False) -> None:
    """List the installed rigs and their options; 'rigs doctor' tries their devices."""
    from dsl_core.devices.registry import list_rigs

    if context.invoked_subcommand is not None:
        return
    output, entries = Output(json), list_rigs()
    output.table(
        ("rig", "package", "what it is"),
        [(e.name, f"{e.package} {e.version}".strip(), e.error or e.description) for e in entries],
    )
    output.table(
        ("rig", "option", "default", "meaning"),
        [(e.name, option.name, option.default, option.meaning) for e in entries for option in e.options],
    )
    output.put(rigs=[asdict(entry) for entry in entries])
    output.finish()


@rigs.command()
def drivers(json: Json = False) -> None:
    """List the drivers that a rig profile can name, with their settings and what they need."""
    from dsl_core.devices.driver_table import list_drivers

    output, entries = Output(json), list_drivers()
    output.table(
        ("device", "driver", "what it is", "needs"),
        [
            (e.kind, e.name, e.driver.summary if e.driver else e.error, e.driver.brings if e.driver else "")
            for e in entries
        ],
    )
    settings = [
        (f"{e.kind} {e.name}", name, field)
        for e in entries
        if e.driver is not None
        for name, field in e.driver.settings.model_fields.items()
    ]
    output.table(
        ("driver", "setting", "default", "meaning"),
        [
            (
                owner,
                name,
                "" if field.is_required() else field.get_default(call_default_factory=True),
                field.description,
            )
            for owner, name, field in settings
        ],
    )
    output.put(
        drivers=[
            {"kind": e.kind, "name": e.name, "error": e.error}
            | (
                {"settings": e.driver.settings.model_json_schema(), "needs": e.driver.brings}
                if e.driver
                else {}
            )
            for e in entries
        ]
    )
    output.finish()


@rigs.command()
def doctor(
    profile: Annotated[
        str,
        typer.Argument(
            metavar="[PROFILE]", help="A rig profile: its path, or its name. Without one, look for devices."
        ),
    ] = "",
    json: Json = False,
) -> None:
    """Try every device of a rig profile, and say all that is wrong and what to do; nothing is moved."""
    from dsl_core.devices.doctor import Grade, survey
    from dsl_core.devices.registry import rig_names
    from dsl_core.errors import DeviceError
    from dsl_core.io.rig_profile import examine_profile, profile_names, profile_path

    output = Output(json)
    if profile:
        path = profile_path(profile)
        if path is None:
            known = ", ".join(profile_names()) or "none"
            if profile in rig_names():
                raise DeviceError(
                    f"{profile} is a rig that is opened by code of its own, not by a profile. Try its devices"
                    f" with 'dsl-scan selftest --rig {profile}', or by the tests that came with it."
                )
            if Path(profile).exists():
                raise DeviceError(
                    f"{profile} is not a rig profile: their names end in .json. Give the path of one."
                )
            raise DeviceError(
                f"There is no rig profile {profile!r}; there are: {known}. Give the path of one (NAME.json),"
                " or one of these names."
            )
        found = examine_profile(path)
    else:
        found = survey()
    output.table(("device", "", "what was found"), [(f.device, f.grade.value, f.text) for f in found])
    broken = sum(f.grade is Grade.BAD for f in found)
    if profile:
        prevent = f"{broken} of {len(found)} findings {'prevents' if broken == 1 else 'prevent'} a scan."
        output.say(prevent if broken else "Every device works.")
    output.put(findings=[{"device": f.device, "grade": f.grade.value, "text": f.text} for f in found])
    output.put(broken=broken)
    output.finish()
    if broken:
        raise typer.Exit(_BROKEN)


@rigs.command()
def new(
    name: Annotated[str, typer.Argument(metavar="NAME", help="Name of the rig, such as my-lab.")],
    folder: Annotated[
        Path | None, typer.Argument(metavar="[FOLDER]", help="New folder for it; NAME where none is given.")
    ] = None,
    json: Json = False,
) -> None:
    """Write a package for a rig of one's own, with tests, to put one's devices into."""
    from dsl_core.devices.registry import rig_names
    from dsl_core.workflows.new_rig import write_new_rig

    output, target = Output(json), folder or Path(name)
    files = write_new_rig(name, target, rig_names())
    output.say(f"{target} contains {', '.join(path.name for path in files)}.")
    output.say(f"Next: pip install -e {target}, then pytest {target}; replace one device after the other.")
    output.put(rig=name, files=[str(path) for path in files])
    output.finish()
