"""What a finished campaign produces: the rig's file, its report, a library entry, and entries as files."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal, get_args

from dsl_core.campaign.assembly import accepted_calibrations
from dsl_core.campaign.common.recipe import AnyRecipe
from dsl_core.campaign.recipes import campaign_recipes
from dsl_core.errors import StoreError
from dsl_core.io.calibration_library import CalibrationLibrary, LibraryEntry, read_entry
from dsl_core.io.campaign_folder import RIG_NAME, CampaignFolder
from dsl_core.io.records import write_record
from dsl_core.io.rig_file import load_rig, save_rig
from dsl_core.io.staging import write_text
from dsl_core.model.calibration.accepted import AcceptedCalibration
from dsl_core.model.rig import Rig

if TYPE_CHECKING:
    from dsl_core.evaluation.cost import StageCost

REPORT_NAME = "report.html"

Form = Literal["entry", "rig", "published"]


@dataclass(frozen=True)
class Products:
    """Where they are saved; ``entry`` is the name in the library, None where none was requested.

    ``traits`` says in a sentence in what the rig is unlike the usual (empty: in nothing).
    """

    rig: Path
    report: Path
    entry: str | None
    traits: str = ""


def write_products(
    campaign: CampaignFolder,
    rig: Rig,
    library_name: str | None,
    costs: Sequence[StageCost] = (),
    recipes: Sequence[AnyRecipe] | None = None,
    library: CalibrationLibrary | None = None,
) -> Products:
    """Write ``rig.json`` and ``report.html`` again and store the rig in the library; raises `StoreError`.

    ``library`` is that of this computer if not given. A rig that equals its current one but for the date
    is not stored a second time.
    """
    from dsl_core.reconstruction.spectral.rig_traits import traits_in_words

    recipes = campaign_recipes(campaign) if recipes is None else recipes
    accepted = tuple(accepted_calibrations(campaign, recipes).values())
    history = tuple(old for recipe in recipes for old in campaign.history(recipe.name))
    path = save_rig(rig, campaign.path / RIG_NAME, overwrite=True)
    report = write_calibration_report(campaign.path / REPORT_NAME, rig, accepted, history, costs)
    if library_name is not None:
        shelf, same = library or CalibrationLibrary(), {"provenance": rig.provenance}
        known = shelf.find(library_name).rig if library_name in shelf.names() else None
        if known is not None:
            # How the light wandered before says how it will.
            rig = rig.model_copy(update={"light_checks": known.light_checks})
        if known is None or known.model_copy(update=same) != rig:
            shelf.store(library_name, rig, accepted, history)
    return Products(path, report, library_name, traits_in_words(rig))


def write_calibration_report(
    path: Path,
    rig: Rig,
    accepted: tuple[AcceptedCalibration, ...],
    history: tuple[AcceptedCalibration, ...],
    costs: Sequence[StageCost] = (),
) -> Path:
    """Write the page, replacing an existing one, whole or not at all; raises `StoreError`."""
    from dsl_core.evaluation.report.calibration_report import render_calibration_report

    return write_text(path, lambda: render_calibration_report(rig, accepted, history, costs), overwrite=True)


def export_entry(entry: LibraryEntry, target: Path, form: str, overwrite: bool = False) -> list[Path]:
    """Write an entry whole (``entry``), its rig alone, or the published files; returns what was written.

    Raises `StoreError` for another form, and when a target exists or cannot be written.
    """
    match form:
        case "entry":
            return [write_record(target, entry, overwrite=overwrite)]
        case "rig":
            return [save_rig(entry.rig, target, overwrite=overwrite)]
        case "published":
            from dsl_core.io.published.calibration import export_calibration

            return export_calibration(entry.rig, target, overwrite=overwrite)
    raise StoreError(f"--form must be {', '.join(get_args(Form))}, not {form!r}.")


def import_entry(source: Path, library: CalibrationLibrary, name: str = "") -> LibraryEntry:
    """Import an exported entry, or a rig's file, into a library as the current version of its name.

    Raises `StoreError` or `CalibrationError` when the file holds neither.
    """
    found = read_entry(source)
    if found is None:
        rig = load_rig(source)
        return library.store(name or rig.name, rig)
    return library.store(name or found.name, found.rig, found.accepted, found.history)
