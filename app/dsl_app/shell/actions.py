"""Everything that can be done by menu or shortcut, as one table. No Qt here.

A record holds the text and the place of an action; the main window makes menus and the list of shortcuts from
the table.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Menu = Literal["File", "Edit", "View", "Rig", "Calibrate", "Scan", "Results", "Help"]


@dataclass(frozen=True)
class Action:
    """One action: ``key`` identifies it, ``shortcut`` is Qt's portable text.

    ``page`` limits a shortcut to a page ("" everywhere); ``checkable`` actions have a state.
    """

    key: str
    text: str
    menu: Menu
    shortcut: str = ""
    tip: str = ""
    page: str = ""
    checkable: bool = False
    separator: bool = False


@dataclass(frozen=True)
class Page:
    """One activity of the rail; ``help`` is the help page of widgets without one of their own."""

    key: str
    title: str
    icon: str
    tip: str
    help: str


PAGES: tuple[Page, ...] = (
    Page("start", "Start", "start", "Finished scans, the simulated rig, your own rig, recent files", "rig"),
    Page("rig", "Rig", "rig", "Devices, live view, projector, self-test", "rig"),
    Page("calibrate", "Calibrate", "calibrate", "Guided calibrations and their library", "calibrating"),
    Page("scan", "Scan", "scan", "Plan, run and watch a scan", "scanning"),
    Page("results", "Results", "results", "Spectra, depth, quality and the 3D cloud", "numbers"),
    Page("compare", "Compare", "compare", "Compare two scans, or a scan with the truth", "comparing"),
)

ACTIONS: tuple[Action, ...] = (
    Action("open", "&Open…", "File", "Ctrl+O", "Open a scan, a result, a reference or a calibration"),
    Action("open_last", "Open &last file", "File", "Ctrl+Shift+O", "Open the most recent file again"),
    Action("export", "&Export…", "File", "Ctrl+E", "Export the result in formats of other programs"),
    Action("save_figure", "Save &plot…", "File", "", "Save the plot of this page as SVG or PNG"),
    Action(
        "import",
        "&Import…",
        "File",
        "Ctrl+I",
        "Import a folder of another program: its pictures, or a scan or calibration in the published layout",
    ),
    Action(
        "show_command",
        "Show &command line",
        "File",
        "Ctrl+Shift+C",
        "Show the command that does the same as this page",
    ),
    Action("quit", "&Quit", "File", "Ctrl+Q", "Quit; asks first while a scan is running", separator=True),
    Action("undo", "&Undo", "Edit", "Ctrl+Z", "Undo the last change of pins, regions or settings"),
    Action("redo", "&Redo", "Edit", "Ctrl+Shift+Z", "Redo what was undone"),
    *(Action(f"page_{page.key}", page.title, "View", f"Ctrl+{i}", page.tip) for i, page in enumerate(PAGES)),
    Action("theme_system", "&System theme", "View", checkable=True, separator=True),
    Action("theme_light", "&Light theme", "View", checkable=True),
    Action("theme_dark", "&Dark theme", "View", checkable=True),
    Action(
        "show_log", "Show lo&g", "View", "Ctrl+L", "Show or hide the messages of the program", separator=True
    ),
    Action(
        "rig_connect",
        "&Connect or disconnect",
        "Rig",
        "Ctrl+Shift+K",
        "Open or close the devices chosen on the Rig page",
    ),
    Action(
        "rig_live",
        "Start or stop &live view",
        "Rig",
        "Ctrl+Shift+V",
        "Show the camera's frames",
    ),
    Action("rig_expose", "&Auto exposure", "Rig", "", "Find the exposure that suits the scene"),
    Action("calibrate_new", "&New campaign…", "Calibrate", "", "Create a campaign for the current rig"),
    Action("calibrate_open", "&Open campaign…", "Calibrate", "", "Continue an existing campaign"),
    *(
        Action(f"calibrate_{key}", f"{text}…", "Calibrate", f"F{i}", tip, separator=i == 4)
        for i, (key, text, tip) in enumerate(
            (
                ("selftest", "&Self-test", "Check whether camera, projector, focus and room are good enough"),
                ("geometry", "&Geometry", "Find lenses and pose from a printed board"),
                ("spectralon", "S&pectralon", "Measure the LEDs' light, uniformity and white"),
                ("color-checker", "&Color Checker", "Refine response and emission with known patches"),
                ("bandpass", "&Bandpass filters", "Measure the brightness of the film's orders"),
                ("depth-stage", "&Depth stage", "Find the pose and bending of the film"),
            ),
            4,
        )
    ),
    Action(
        "calibrate_everything",
        "Calibrate &everything",
        "Calibrate",
        "",
        "Run all calibrations in order, on a rig that places targets itself",
        separator=True,
    ),
    Action(
        "scan_start",
        "&Start or resume the scan",
        "Scan",
        "Ctrl+Return",
        "Capture all frames of the plan, or those that an interrupted scan still lacks",
    ),
    Action(
        "scan_pause",
        "&Pause or continue",
        "Scan",
        "Ctrl+Shift+P",
        "Pause before the next frame",
    ),
    Action("scan_stop", "S&top the scan", "Scan", "", "Saved frames are kept, and the scan can be resumed"),
    Action(
        "cancel_jobs",
        "&Cancel all jobs",
        "Scan",
        "Ctrl+.",
        "Stop all running jobs at the next safe point",
        separator=True,
    ),
    *(
        Action(f"view_{key}", text, "Results", str(i), tip, page="results")
        for i, (key, text, tip) in enumerate(
            (
                ("colour", "Co&lour", "Colours as seen under a chosen light, or any three bands"),
                ("band", "&Band", "Reflectance of one band"),
                ("depth", "&Depth", "Depth along the camera axis"),
                (
                    "quality",
                    "&Quality and orders",
                    "Why pixels are limited, and which order measured a band",
                ),
                ("cloud", "3D &cloud", "The points in 3D"),
            ),
            1,
        )
    ),
    Action(
        "band_down",
        "Band d&own",
        "Results",
        ",",
        "Next shorter wavelength",
        "results",
        separator=True,
    ),
    Action("band_up", "Band &up", "Results", ".", "Next longer wavelength", "results"),
    Action(
        "intensity_graph",
        "&Intensity graph",
        "Results",
        "I",
        "Show what the pixel under the cursor received from each line, against the model",
        "results",
        separator=True,
    ),
    Action(
        "copy_spectra",
        "Copy s&pectra",
        "Results",
        "",
        "Copy the ticked spectra as a table for a spreadsheet",
        "results",
        separator=True,
    ),
    Action("export_spectra", "E&xport spectra…", "Results", "", "Save the ticked spectra as CSV", "results"),
    Action(
        "series_add",
        "Add to a s&eries…",
        "Results",
        "",
        "Add results to compare as a series: a depth test, or accuracy over time",
        "compare",
        separator=True,
    ),
    Action(
        "reconstruct_again",
        "&Reconstruct again…",
        "Results",
        "Ctrl+R",
        "Reconstruct a scan with other parameters, without scanning again",
        separator=True,
    ),
    Action(
        "help_page",
        "&Help on this page",
        "Help",
        "F1",
        "Explain the control that has the focus",
    ),
    Action("tour", "Guided &tour", "Help", "", "Show what is where in this window, in seven steps"),
    Action("demo", "&Demo", "Help", "", "Open a finished scan of the simulated rig", separator=True),
    Action("live_demo", "Demo, &live", "Help", "", "Watch a short scan of the simulated rig"),
    Action("shortcuts", "&Keyboard shortcuts", "Help", "Ctrl+/", "List every action and its shortcut"),
    Action("report_bundle", "Save a &report bundle…", "Help", "", "Log, settings and versions in one file"),
    Action("about", "&About", "Help", separator=True),
)
