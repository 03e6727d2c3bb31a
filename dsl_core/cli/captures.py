"""The part of the import command for pictures of other programs, by a guess or a mapping."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dsl_core.cli.options import parse_size
from dsl_core.cli.output import Output
from dsl_core.errors import PlanError, StoreError
from dsl_core.words import quoted

if TYPE_CHECKING:
    from dsl_core.io.linearity import Linearity
    from dsl_core.io.pictures.mapping import Encoding, Mapping
    from dsl_core.model.rig import Rig

#: What is left out of a table between its first and its last lines.
HEAD_LINES, TAIL_LINES = 30, 10
#: A mapping that lets fewer of the lit pixels be decoded is likely wrong.
FAIR_SHARE = 0.5
#: Endings of files with lenses and pose.
STEREO_FILES = {".xml", ".yml", ".yaml", ".json"}


@dataclass(frozen=True)
class PictureOptions:
    """How the pictures of a folder are to be imported."""

    guess: bool
    mapping: Path | None
    projector: str | None
    chosen: str | None
    encoding: str | None
    force: bool

    @property
    def is_asked_for(self) -> bool:
        """Whether the folder is one of pictures by any mapping."""
        return self.guess or self.mapping is not None


def import_capture(
    output: Output, source: Path, target: Path | None, rig: Rig | None, options: PictureOptions
) -> None:
    """Say what every picture is; write the guessed mapping, and make a scan if there is a target."""
    from dsl_core.io.pictures.arrange import arrange
    from dsl_core.io.scan.folder import require_name
    from dsl_core.io.staging import check_targets
    from dsl_core.workflows import captures

    encoding = encoding_named(options.encoding)
    if options.guess:
        path = _mapping_path(source, options)
        # One that is there may be what is guessed: of the same command, which was interrupted.
        check_targets([path], overwrite=options.force or path.is_file())
    if target is not None:
        require_name(target)
    if target is not None and not target.is_dir():
        check_targets([target], overwrite=False)
    if options.guess:
        mapping = _guessed(output, source, rig, options)
    else:
        assert options.mapping is not None
        mapping = captures.load_mapping(options.mapping)
        if encoding is not None:
            mapping = mapping.model_copy(update={"encoding": encoding})
        _print(output, mapping, arrange(source, mapping).table)
        _print_doubts(output, source, mapping)
    _print_linearity(output, source, mapping)
    _print_decided(output, source, mapping, options)
    if target is not None:
        with output.progress() as progress:
            captures.import_pictures(source, target, mapping, rig, progress)
        output.say(f"Imported to {target}. Next: dsl-scan reconstruct {quoted(target)} --depth-only")
        output.put(imported=target)


@dataclass(frozen=True)
class StereoOptions:
    """What a calibration's file does not contain."""

    base: Path | None
    camera_size: str | None
    projector: str | None
    unit_mm: float | None
    from_projector: bool
    curves: tuple[Path | None, Path | None]
    force: bool


def import_stereo(output: Output, source: Path, target: Path | None, options: StereoOptions) -> None:
    """Say which lenses and pose a file contains; make a rig for depth if there is a target.

    ``curves`` of the options are the tables of the camera and of the LEDs.
    """
    from dsl_core.io.published.any_stereo import load_any_stereo
    from dsl_core.io.published.curves import load_curves
    from dsl_core.io.published.stereo_rig import lenses_on
    from dsl_core.io.published.stereo_words import placed, sizes
    from dsl_core.io.rig_file import load_rig, save_rig
    from dsl_core.simulation.published_rig import published_rig

    camera = parse_size("--camera-size", options.camera_size) if options.camera_size else None
    projector = parse_size("--projector", options.projector) if options.projector else None
    found = load_any_stereo(source, camera, projector, options.unit_mm, options.from_projector)
    output.table(("part", "called"), list(found.names.items()))
    for sentence in found.assumed:
        output.say(f"Assumed: {sentence}.")
    for sentence in found.taken:
        output.say(f"Understood: {sentence}.")
    output.say(f"Found: {sizes(found.stereo)}; {placed(found.stereo)}.")
    for sentence in found.doubts:
        output.say(f"Warning: {sentence}.")
    distance_mm = sum(value**2 for value in found.stereo.pose.translation_mm) ** 0.5
    said = {"assumed": found.assumed, "understood": found.taken, "warnings": found.doubts}
    output.put(names=found.names, baseline_mm=round(distance_mm, 3))
    output.put(**{name: list(sentences) for name, sentences in said.items()})
    curves = [
        None if path is None else load_curves(path, device)
        for path, device in zip(options.curves, ("camera", "LEDs"), strict=True)
    ]
    for each in curves:
        if each is not None:
            output.say(f"Understood: {each.words}.")
    if target is not None:
        base = load_rig(options.base) if options.base else published_rig()
        save_rig(lenses_on(base, found, source.name, *curves), target, overwrite=options.force)
        output.say(
            f"Imported to {target}: for depth; {_of_base(*options.curves)} are not those of your devices."
        )
        output.put(imported=target)


def _of_base(camera_curves: Path | None, led_curves: Path | None) -> str:
    """What a rig has of its base, given the tables that were imported."""
    if camera_curves is None and led_curves is None:
        return "its curves"
    if camera_curves is None:
        return "curves of the camera"
    return "curves of the LEDs" if led_curves is None else "film and scales"


def _guessed(output: Output, source: Path, rig: Rig | None, options: PictureOptions) -> Mapping:
    from dsl_core.io.pictures.guess import guess_mapping
    from dsl_core.io.records import write_record

    size = parse_size("--projector", options.projector) if options.projector else None
    if size is None and rig is not None:
        size = (rig.projector.width_px, rig.projector.height_px)
    with output.progress() as progress:
        guess = guess_mapping(source, size, options.chosen, progress, encoding_named(options.encoding))
    _print(output, guess.mapping, guess.table)
    path = _mapping_path(source, options)
    if not _is_saved(guess.mapping, path):
        write_record(path, guess.mapping, overwrite=options.force, sealed=False)
    output.say(f"The mapping is saved in {path}; correct it there and use it with --mapping.")
    output.put(mapping=path, others=list(guess.others))
    if guess.asks:
        raise StoreError(
            f"{guess.asks}, and nothing was imported. Correct {path} (unit_px of the stripes; fringes are the"
            " projector's length through the period), and use it with --mapping instead of --guess."
        )
    return guess.mapping


def _is_saved(mapping: Mapping, path: Path) -> bool:
    """Whether a file contains this mapping."""
    from dsl_core.workflows.captures import load_mapping

    try:
        return load_mapping(path) == mapping
    except StoreError:
        return False


def encoding_named(text: str | None) -> Encoding | None:
    """The encoding that an option names; raises `PlanError`."""
    match text:
        case None | "linear" | "srgb":
            return text
    raise PlanError(f"--encoding must be linear or srgb, not {text!r}. Leave it out to find it out.")


def _print_doubts(output: Output, source: Path, mapping: Mapping) -> None:
    """What the pictures show against a mapping; raises `StoreError` where it cannot be theirs."""
    from dsl_core.io.pictures.mapped_doubts import doubts_of_mapping
    from dsl_core.io.pictures.source import open_pictures

    doubts = doubts_of_mapping(open_pictures(source, mapping))
    for sentence in doubts:
        output.say(f"Unsure: {sentence}.")
    output.put(unsure=[*mapping.unsure, *doubts])


def _print_linearity(output: Output, source: Path, mapping: Mapping) -> None:
    """Whether values are linear in light, as they are read by the mapping."""
    from dsl_core.io.pictures.encoding import encoding_of
    from dsl_core.io.pictures.source import open_pictures

    found, advice = encoding_of(open_pictures(source, mapping))
    read = ", decoded from sRGB," if mapping.encoding == "srgb" else ""
    output.say(f"Values{read} are {found.sentence}." if found.figures else f"Values: {found.sentence}.")
    if found.is_wrong:
        output.say(f"Warning: {advice}.")
    output.put(encoding=mapping.encoding, linearity=linearity_facts(found))


def _print_decided(output: Output, source: Path, mapping: Mapping, options: PictureOptions) -> None:
    """How many lit pixels the mapping decodes; raises `StoreError` where a guess decodes few."""
    from math import isnan

    from dsl_core.io.pictures.source import open_pictures
    from dsl_core.workflows.thinned import decided_share

    with output.progress() as progress:
        share = decided_share(open_pictures(source, mapping), progress)
    told = "no pixel is lit" if isnan(share) else f"{100 * share:.0f} % of the lit pixels have a position"
    output.say(f"Decoded: {told}.")
    output.put(decided_share=None if isnan(share) else round(share, 4))
    if share >= FAIR_SHARE:
        return
    advice = "compare its code, order of digits, fringes and inverses with what was projected"
    if options.guess:
        path = _mapping_path(source, options)
        raise StoreError(
            f"With what was guessed, {told}: it is likely wrong, and nothing was imported. Correct {path}"
            f" ({advice}), and use it with --mapping instead of --guess."
        )
    output.say(f"Warning: the mapping is likely wrong; {advice}.")


def _mapping_path(source: Path, options: PictureOptions) -> Path:
    """Where a guessed mapping is saved."""
    return options.mapping or Path(f"{source.absolute().name}.mapping.json")


def linearity_facts(found: Linearity) -> dict[str, Any]:
    """A verdict and its figures, for one object of JSON."""
    from math import isfinite

    figures = found.figures
    if figures is None:
        return {"verdict": found.verdict}
    facts = {
        "excess_share": figures.excess,
        "excess_std_share": figures.excess_std,
        "exponent": figures.exponent,
        "exponent_std": figures.exponent_std,
    }
    rounded = {name: round(value, 4) if isfinite(value) else None for name, value in facts.items()}
    return {"verdict": found.verdict, **rounded, "pairs": figures.pairs, "pixels": figures.pixels}


def _print(output: Output, mapping: Mapping, table: tuple[tuple[str, str], ...]) -> None:
    lines = list(table)
    if len(lines) > HEAD_LINES + TAIL_LINES + 1:
        gap = [("...", f"{len(lines) - HEAD_LINES - TAIL_LINES} more")]
        lines = [*lines[:HEAD_LINES], *gap, *lines[-TAIL_LINES:]]
    output.table(("picture", "what it shows"), lines)
    width, height = mapping.projector_size_px
    output.say(f"{len(table)} pictures; projector {width} x {height} px.")
    for sentence in mapping.unsure:
        output.say(f"Unsure: {sentence}.")
    output.put(
        pictures=[{"file": name, "shows": words} for name, words in table],
        unsure=list(mapping.unsure),
        projector_px=[width, height],
    )
