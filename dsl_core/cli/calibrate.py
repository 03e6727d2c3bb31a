"""Commands that calibrate a rig step by step: ``selftest`` and ``calibrate ...``."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from dsl_core.cli.guidance import ConsoleGuide, figures_json, opened_campaign, resumed_by, run_guided
from dsl_core.cli.options import Force, Json, RigOptions, parse_options, tab_rigs
from dsl_core.cli.output import Output
from dsl_core.cli.pictures import board_of, calibrate_camera_pictures, calibrate_pictures
from dsl_core.errors import CalibrationError
from dsl_core.evaluation.cost import StageCost, StageTimer
from dsl_core.words import quoted

if TYPE_CHECKING:
    from dsl_core.devices.base import DeviceRig
    from dsl_core.io.campaign_folder import CampaignFolder

calibrate = typer.Typer(
    help="Calibrate a rig step by step; the folder of a campaign keeps all captures.", no_args_is_help=True
)

Campaign = Annotated[
    Path, typer.Argument(metavar="CAMPAIGN", help="Folder of the campaign, new or existing.")
]
CampaignRig = Annotated[
    str | None,
    typer.Option(
        "--rig",
        help="Name of a rig; the default is the campaign's, or the twin for a new campaign.",
        autocompletion=tab_rigs,
    ),
]
Set = Annotated[
    list[str], typer.Option("--set", help="Setting of the calibration as key=value; may be repeated.")
]
Redo = Annotated[list[str], typer.Option("--redo", help="A step to capture again; may be repeated.")]
Yes = Annotated[bool, typer.Option("--yes", help="Do not ask: every target is in place when it is needed.")]
AcceptFailed = Annotated[
    bool, typer.Option("--accept-failed", help="Continue although figures are outside their limits.")
]

_HELP = {
    "spectralon": "Measure LED emission, flat field and white scale on a Spectralon, film off.",
    "color-checker": "Refine camera response and LED emission on a Color Checker, film off.",
    "bandpass": "Measure the film's efficiency through bandpass filters, film on.",
    "depth-stage": "Find the film's pose and shape from a plane at several depths, film on.",
}


def selftest(
    campaign: Annotated[
        Path | None, typer.Argument(metavar="[CAMPAIGN]", help="Campaign to save the outcome in.")
    ] = None,
    rig: CampaignRig = None,
    option: RigOptions = [],  # noqa: B006 - typer reads it, nobody changes it
    set_: Set = [],  # noqa: B006
    yes: Yes = False,
    json: Json = False,
) -> None:
    """Test the camera and projector first: each figure passes or says what to do."""
    with tempfile.TemporaryDirectory(prefix="dsl-selftest-") as spare:
        folder = campaign or Path(spare) / "campaign"
        run_guided("selftest", folder, rig, option, set_, yes, json, again=True, kept=campaign is not None)


@calibrate.command()
def geometry(
    folder: Annotated[
        Path, typer.Argument(metavar="FOLDER", help="Folder of the campaign, or of pictures with --pictures.")
    ],
    board: Annotated[
        str | None, typer.Option(help="COLUMNSxROWS of inner corners, or of squares with --marker-mm.")
    ] = None,
    square_mm: Annotated[float | None, typer.Option(help="Measured side of a printed square.")] = None,
    marker_mm: Annotated[
        float | None, typer.Option(help="Side of a marker; makes the board a ChArUco board.")
    ] = None,
    dictionary: Annotated[str, typer.Option(help="Marker dictionary of a ChArUco board.")] = "DICT_5X5_100",
    rig: CampaignRig = None,
    option: RigOptions = [],  # noqa: B006
    set_: Set = [],  # noqa: B006
    redo: Redo = [],  # noqa: B006
    yes: Yes = False,
    accept_failed: AcceptFailed = False,
    pictures: Annotated[
        bool, typer.Option("--pictures", help="FOLDER contains a folder of numbered pictures for each pose.")
    ] = False,
    projector: Annotated[str, typer.Option(help="Pictures: WIDTHxHEIGHT of the projector, px.")] = "640x360",
    binning: Annotated[float, typer.Option(help="Pictures: sensor pixels per camera pixel.")] = 1.0,
    bayer: Annotated[str | None, typer.Option(help="Pictures: mosaic, RGGB, BGGR, GRBG, GBRG.")] = None,
    baseline_mm: Annotated[
        float | None,
        typer.Option(help="Pictures: distance from camera to projector, to check the printed size."),
    ] = None,
    guess: Annotated[
        bool, typer.Option("--guess", help="Pictures: find out what each shows; else graycode order.")
    ] = False,
    mapping: Annotated[
        Path | None,
        typer.Option(help="Pictures: what each shows, as 'dsl-scan import --guess' writes it."),
    ] = None,
    camera_only: Annotated[
        bool,
        typer.Option("--camera-only", help="Pictures: the camera's lens alone; no code needed."),
    ] = False,
    hold: Annotated[
        list[str],
        typer.Option(help="Pictures: distortion held at zero: k1, k2, k3, tangential; may be repeated."),
    ] = [],  # noqa: B006
    target: Annotated[
        Path | None, typer.Option("--output", "-o", help="Pictures: GEOMETRY.json to write.")
    ] = None,
    xml: Annotated[Path | None, typer.Option(help="Pictures: published XML or YAML to write.")] = None,
    force: Force = False,
    json: Json = False,
) -> None:
    """Find the lenses and the pose of camera and projector from a board under Gray code, film off."""
    if pictures:
        printed = board_of(board, square_mm, marker_mm, dictionary)
        if camera_only:
            if target is not None or xml is not None or guess or mapping is not None:
                raise CalibrationError("--camera-only prints a lens; leave out files, --guess and --mapping.")
            calibrate_camera_pictures(Output(json), folder, printed, bayer, hold)
            return
        files = (target, xml)
        layout = (guess, mapping)
        calibrate_pictures(
            Output(json), folder, printed, projector, binning, bayer, baseline_mm, files, layout, hold, force
        )
        return
    if target is not None or xml is not None or guess or mapping is not None or hold or camera_only:
        raise CalibrationError(
            "--output, --xml, --guess, --mapping, --hold and --camera-only need --pictures; 'calibrate all'"
            " writes the rig."
        )
    found = board_of(board, square_mm, marker_mm, dictionary)
    own = [] if found is None else [f"board={found.model_dump_json()}"]
    run_guided("geometry", folder, rig, option, [*own, *set_], yes, json, redo, accept_failed)


def _command(name: str) -> Callable[..., None]:
    """The command of a calibration that needs no options of its own."""

    def command(
        campaign: Campaign,
        rig: CampaignRig = None,
        option: RigOptions = [],  # noqa: B006
        set_: Set = [],  # noqa: B006
        redo: Redo = [],  # noqa: B006
        yes: Yes = False,
        accept_failed: AcceptFailed = False,
        json: Json = False,
    ) -> None:
        run_guided(name, campaign, rig, option, set_, yes, json, redo, accept_failed)

    return command


for _name, _help in _HELP.items():
    calibrate.command(_name, help=_help)(_command(_name))


@calibrate.command("all")
def all_(
    campaign: Campaign,
    rig: CampaignRig = None,
    option: RigOptions = [],  # noqa: B006
    set_: Annotated[
        list[str], typer.Option("--set", help="Setting as CALIBRATION.key=value; may be repeated.")
    ] = [],  # noqa: B006
    name: Annotated[
        str | None,
        typer.Option(help="Name in the library; the default is the name of the campaign's folder."),
    ] = None,
    library: Annotated[
        bool, typer.Option("--library/--no-library", help="Save the rig in the library.")
    ] = True,
    yes: Yes = False,
    accept_failed: AcceptFailed = False,
    json: Json = False,
) -> None:
    """Run every calibration in order: from an unknown rig to a calibrated one, with a report."""
    from dsl_core.campaign.guide import calibrate_all, omitted
    from dsl_core.campaign.products import write_products
    from dsl_core.campaign.recipes import campaign_recipes, load_recipe
    from dsl_core.io.calibration_library import check_name

    output, timer, settings = Output(json), StageTimer(), _settings_by_name(set_)
    name = name or campaign.absolute().name
    if library:
        check_name(name)  # reported before anything is captured
    for each, values in settings.items():
        load_recipe(each, values)  # wrong settings are reported before anything is written
    guide = ConsoleGuide(output, campaign, yes, accept_failed)
    with (
        # Before the devices are open there is nothing to resume.
        opened_campaign(campaign, rig, parse_options(option), settings) as (folder, devices),
        resumed_by(f"dsl-scan calibrate all {quoted(campaign)}"),
    ):
        for each, reason in omitted(campaign_recipes(folder), devices).items():
            output.say(f"{each} is left out: {reason}")
        with output.progress() as progress:
            try:
                calibrated = calibrate_all(
                    folder,
                    devices,
                    guide,
                    progress,
                    name,
                    stage=timer.stage,
                )
            except CalibrationError:
                _save_so_far(folder, devices, output, timer.stages)
                raise
        made = write_products(folder, calibrated, calibrated.name if library else None, timer.stages)
    # This loads torch, which a refusal does not wait for.
    from dsl_core.reconstruction.spectral.rig_traits import measured_traits, traits_in_words

    output.costs(timer.stages)
    output.say(f"The calibrated rig is saved in {made.rig}, its report in {made.report}.")
    if traits := traits_in_words(calibrated):
        output.say(traits)
    if made.entry is not None:
        command = f"dsl-scan scan SCAN.dsl --calibration {quoted(made.entry)}"
        output.say(f"In the library: {made.entry}. Next: {command}")
    output.put(rig=made.rig, report=made.report, library=made.entry, traits=measured_traits(calibrated))
    output.put(figures={note.name: figures_json(note.figures) for note in calibrated.calibrations})
    output.finish()


def _save_so_far(
    campaign: CampaignFolder, devices: DeviceRig, output: Output, stages: Sequence[StageCost]
) -> None:
    """Save the rig as far as its calibrations were accepted, so that a late refusal leaves a usable one."""
    from dsl_core.campaign.guide import calibrated_rig
    from dsl_core.campaign.products import write_products

    try:
        made = write_products(campaign, calibrated_rig(campaign, devices), None, stages)
    except CalibrationError:
        return  # nothing was accepted
    output.say(f"The rig as calibrated so far is saved in {made.rig}, its report in {made.report}.")


def _settings_by_name(texts: list[str]) -> dict[str, dict[str, str]]:
    """Settings of each calibration from texts like ``bandpass.line_px=5``; raises `CalibrationError`."""
    found: dict[str, dict[str, str]] = {}
    for key, value in parse_options(texts).items():
        name, dot, setting = key.partition(".")
        if not dot:
            raise CalibrationError(
                "--set must start with a calibration's name here, like bandpass.line_px=5, not"
                f" {key}={value}."
            )
        found.setdefault(name, {})[setting] = value
    return found
