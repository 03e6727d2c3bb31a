"""Commands for files, those of other programs and our own: import, info."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from dsl_core.cli.options import Json, parse_size
from dsl_core.cli.output import Output
from dsl_core.errors import StoreError

if TYPE_CHECKING:
    from dsl_core.io.published.layout import FileRecord
    from dsl_core.model.rig import Rig

#: Attributes of a result with more characters are left out for a person.
LONGEST = 120
#: Exit code where a scan that was to be verified is not in order, as for other wrong input.
_WRONG = 2


def import_(
    source: Annotated[
        Path,
        typer.Argument(metavar="SOURCE", help="A published dataset or calibration, pictures, a stereo file."),
    ],
    target: Annotated[
        Path | None,
        typer.Option(
            "--output", "-o", help="SCAN.dsl or RIG.json to write; if not given, the folder is only checked."
        ),
    ] = None,
    base: Annotated[
        Path | None,
        typer.Option(
            "--calibration", help="Rig with film, sensor and scales; the default is the published rig."
        ),
    ] = None,
    camera_size: Annotated[
        str | None,
        typer.Option("--camera-size", help="Image size of a calibration that does not contain it."),
    ] = None,
    unit_mm: Annotated[
        float | None,
        typer.Option("--unit-mm", min=1e-6, help="Unit of lengths of lenses and pose, mm: 1000 for metres."),
    ] = None,
    from_projector: Annotated[
        bool,
        typer.Option("--from-projector", help="The pose in a stereo file leads from projector to camera."),
    ] = False,
    camera_curves: Annotated[
        Path | None,
        typer.Option("--camera-curves", help="Table of the camera's curves R, G, B, for a stereo file."),
    ] = None,
    led_curves: Annotated[
        Path | None,
        typer.Option("--led-curves", help="Table of the LEDs' curves R, G, B, for a stereo file."),
    ] = None,
    guess: Annotated[
        bool,
        typer.Option("--guess", help="Find out what the pictures show; writes the mapping."),
    ] = False,
    mapping: Annotated[
        Path | None,
        typer.Option("--mapping", help="MAPPING.json that says what the pictures show; written by --guess."),
    ] = None,
    projector: Annotated[
        str | None, typer.Option("--projector", help="WIDTHxHEIGHT of the projector's picture.")
    ] = None,
    chosen: Annotated[
        str | None, typer.Option("--set", help="Which of several captures in the folder, for --guess.")
    ] = None,
    encoding: Annotated[
        str | None,
        typer.Option("--encoding", help="linear, or srgb for pictures for screens; found out by --guess."),
    ] = None,
    force: Annotated[
        bool, typer.Option("--force", help="Replace RIG.json or MAPPING.json; a scan is never replaced.")
    ] = False,
    json: Json = False,
) -> None:
    """Import a published dataset or calibration, or the pictures of any structured-light program.

    For the former, list what is missing or misnamed; for the latter, what each picture shows.
    """
    from dsl_core.cli.captures import (
        STEREO_FILES,
        PictureOptions,
        StereoOptions,
        import_capture,
        import_stereo,
    )
    from dsl_core.io.calibration_library import name_from
    from dsl_core.io.published.calibration import check_calibration, holds_calibration
    from dsl_core.io.rig_file import load_rig, save_rig
    from dsl_core.simulation.published_rig import published_rig
    from dsl_core.workflows import exchange

    output = Output(json)
    of_pictures = {"--guess": guess, "--mapping": mapping, "--set": chosen, "--encoding": encoding}
    of_stereo = {
        "--camera-curves": camera_curves,
        "--led-curves": led_curves,
        "--from-projector": from_projector,
    }
    of_lengths = {"--unit-mm": unit_mm is not None}
    if source.is_file() and source.suffix.lower() in STEREO_FILES:
        _refuse(f"{source} is a stereo file", of_pictures, "a folder of pictures. Name that folder")
        curves = camera_curves, led_curves
        stereo = StereoOptions(base, camera_size, projector, unit_mm, from_projector, curves, force)
        import_stereo(output, source, target, stereo)
        output.finish()
        return
    if not source.is_dir():
        raise StoreError(f"{source} is not a folder. Give the folder of a published dataset or calibration.")
    exchange.refuse_empty(source)
    _refuse(
        f"{source} is a folder", of_stereo, "a stereo file. Name the XML, YAML or JSON file with the lenses"
    )
    is_calibration = holds_calibration(source)
    if not is_calibration or guess or mapping:
        _refuse(f"{source} has no lengths", of_lengths, "a stereo file or a published calibration. Name one")
    options = PictureOptions(guess, mapping, projector, chosen, encoding, force)
    if encoding is not None and not options.is_asked_for:
        raise StoreError("--encoding needs --guess or --mapping: add one of them, or leave it out.")
    if options.is_asked_for:
        import_capture(output, source, target, load_rig(base) if base else None, options)
        output.finish()
        return
    rig = load_rig(base) if base else published_rig()
    if is_calibration:
        _print_files(output, "calibration", check_calibration(source))
        if target is not None:
            sizes = {"--camera-size": camera_size, "--projector": projector}
            camera, light = (parse_size(name, size) if size else None for name, size in sizes.items())
            imported, doubts = exchange.import_calibration(source, rig, camera, light, unit_mm or 1.0)
            for sentence in doubts:
                output.say(f"Warning: {sentence}.")
            name = name_from(target.stem) or imported.name
            save_rig(imported.model_copy(update={"name": name}), target, overwrite=force)
    else:
        _import_dataset(output, source, target, rig)
    if target is not None:
        output.say(f"Imported to {target}")
        output.put(imported=target)
    output.finish()


def _refuse(what: str, options: Mapping[str, object], instead: str) -> None:
    """Raise `StoreError` if options were given that a source has no use for; ``instead`` has one."""
    given = [name for name, value in options.items() if value]
    if given:
        belong, them = ("belongs", "it") if len(given) == 1 else ("belong", "them")
        raise StoreError(f"{what}; {', '.join(given)} {belong} to {instead}, or leave {them} out.")


def _import_dataset(output: Output, source: Path, target: Path | None, rig: Rig) -> None:
    """The table comes first, so that it is printed even when the import is refused."""
    from dsl_core.io.scan.folder import require_name
    from dsl_core.workflows import exchange

    if target is not None:
        require_name(target)
    try:
        records = exchange.import_scan(source, None, rig)
    except StoreError as error:
        raise StoreError(f"{error} Add --guess for pictures of another program.") from error
    _print_files(output, "dataset", records)
    if target is not None:
        with output.progress() as progress:
            exchange.import_scan(source, target, rig, progress)


def _print_files(output: Output, kind: str, records: Sequence[FileRecord]) -> None:
    """Every entry that is not as published, and how many are."""
    from dsl_core.io.published.layout import as_published

    told = [record for record in records if record.status != "ok"]
    good, total = as_published(records)
    output.say(f"A published {kind}: {good} of {total} entries are as published.")
    if told:
        output.table(
            ("expected", "found", "status", "what to do"),
            [(r.expected or "-", r.found or "-", r.status, r.advice) for r in told],
        )
    output.put(kind=kind, as_published=good == total, files=[vars(record) for record in records])


def info(
    path: Annotated[Path, typer.Argument(metavar="PATH", help="A scan, result, rig or plan.")],
    verify: Annotated[
        bool,
        typer.Option(
            "--verify",
            help="Also read every frame of a scan, and say which do not show their pattern; or every value of"
            " a result.",
        ),
    ] = False,
    json: Json = False,
) -> None:
    """Show what a folder or file contains and whether it is complete.

    With --verify, the exit code is 2 if anything is wrong with a scan or result.
    """
    from dsl_core.io.describe import describe
    from dsl_core.io.objects.rooms import brought

    output = Output(json)
    with ExitStack() as stack:
        with output.progress() as progress:
            folder = stack.enter_context(brought(path, progress))
        facts = describe(folder, verify)
        if verify and facts["kind"] == "scan":
            facts |= _proof_of(folder)
    is_wrong = verify and any(facts.get(name) for name in ("problems", "moved", "wrong_pictures"))
    for name, value in facts.items():
        output.say(f"{name.replace('_', ' '):18s} {_in_words(name, value)}")
    output.put(**facts)
    output.finish()
    if is_wrong:
        raise typer.Exit(_WRONG)


def _in_words(name: str, value: Any) -> str:
    """A fact for a person: what is too long for a line is left to ``--json``."""
    if isinstance(value, dict):
        return "; ".join(f"{key}: {_shortened(str(item))}" for key, item in value.items())
    if isinstance(value, list) and name == "depth_mm":
        low, middle, high = value
        return f"{low} to {high}, median {middle}"
    if isinstance(value, list):
        return ", ".join(map(str, value)) or "none"
    return str(value)


def _shortened(text: str) -> str:
    """A text of one line, or how long it is.

    >>> _shortened("twin"), _shortened("a" * 300)
    ('twin', '(300 characters; --json shows them)')
    """
    is_short = len(text) <= LONGEST and "\n" not in text
    return text if is_short else f"({len(text)} characters; --json shows them)"


def _proof_of(path: Path) -> dict[str, Any]:
    from dsl_core.workflows.scans import linearity_of_scan, prove_scan

    found = prove_scan(path)
    return {
        "values": linearity_of_scan(path).sentence,
        "moved": list(found.moved),
        "wrong_pictures": list(found.wrong),
        "pictures_not_judged": found.not_judged or "none",
    }
