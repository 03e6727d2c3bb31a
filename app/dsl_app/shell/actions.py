"""Everything a person can do by menu or key, as one table. No Qt here.

A record says what an action is called and where it stands; the main window makes menus, tool bars and the
shortcut sheet from the table and connects each to the method of the same name.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Menu = Literal["File", "View", "Rig", "Calibrate", "Scan", "Results", "Help"]


@dataclass(frozen=True)
class Action:
    """One action: ``key`` names the method ``do_<key>`` of the window, ``shortcut`` is Qt's portable text.

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
    """One activity of the rail; ``help`` is the help page of who has no better one."""

    key: str
    title: str
    icon: str
    tip: str
    help: str


PAGES: tuple[Page, ...] = (
    Page("rig", "Rig", "rig", "Devices, live camera, projector, self-test", "rig"),
    Page("calibrate", "Calibrate", "calibrate", "Guided calibrations and their library", "calibrating"),
    Page("scan", "Scan", "scan", "Plan, run and watch a scan", "scanning"),
    Page("results", "Results", "results", "Spectra, depth, quality and the 3D cloud", "numbers"),
    Page("compare", "Compare", "compare", "Two scans, or a scan against truth", "comparing"),
)

ACTIONS: tuple[Action, ...] = (
    Action("open", "&Open…", "File", "Ctrl+O", "Open a scan, a result, a reference or a calibration"),
    Action("open_last", "Open the &last again", "File", "Ctrl+Shift+O", "Open what was opened last"),
    Action("export", "&Export…", "File", "Ctrl+E", "Write the result in formats of other programs"),
    Action("save_figure", "Save &figure…", "File", "", "Save the plot of this page as SVG or PNG"),
    Action(
        "import",
        "&Import…",
        "File",
        "Ctrl+I",
        "Take in a folder of images or a calibration of another program; says what is missing or misnamed",
    ),
    Action(
        "show_command",
        "Show &command line",
        "File",
        "Ctrl+Shift+C",
        "The command that does what this page does",
    ),
    Action("quit", "&Quit", "File", "Ctrl+Q", "Leave; a running scan asks first", separator=True),
    Action("undo", "&Undo", "View", "Ctrl+Z", "Take the last change of pins, regions or settings back"),
    Action("redo", "&Redo", "View", "Ctrl+Shift+Z", "Do again what was taken back"),
    *(
        Action(f"page_{page.key}", page.title, "View", f"Ctrl+{i}", page.tip, separator=i == 1)
        for i, page in enumerate(PAGES, 1)
    ),
    Action("theme_system", "Theme of the &system", "View", checkable=True, separator=True),
    Action("theme_light", "&Light theme", "View", checkable=True),
    Action("theme_dark", "&Dark theme", "View", checkable=True),
    Action(
        "show_log", "Show lo&g", "View", "Ctrl+L", "Messages of the program, with a filter", separator=True
    ),
    Action(
        "rig_connect",
        "&Connect or disconnect",
        "Rig",
        "Ctrl+Shift+K",
        "Open the devices that the Rig page names, or let them go",
    ),
    Action(
        "rig_live", "&Live view on or off", "Rig", "Ctrl+Shift+V", "Show the camera's frames as they come"
    ),
    Action("rig_expose", "&Auto exposure", "Rig", "", "Find the exposure that suits what the camera sees"),
    Action("calibrate_new", "&New campaign…", "Calibrate", "", "Begin a campaign of the rig at hand"),
    Action("calibrate_open", "&Open campaign…", "Calibrate", "", "Go on with a campaign that was begun"),
    *(
        Action(f"calibrate_{key}", f"{text}…", "Calibrate", f"F{i}", tip, separator=i == 4)
        for i, (key, text, tip) in enumerate(
            (
                ("selftest", "&Self-test", "Whether camera, projector, focus and room are good enough"),
                ("geometry", "&Geometry", "Find lenses and pose from a printed board"),
                ("spectralon", "S&pectralon", "Measure the LEDs' light, evenness and white"),
                ("color-checker", "&Color Checker", "Refine response and emission on known patches"),
                ("bandpass", "&Bandpass filters", "Measure how bright the film's orders are"),
                ("depth-stage", "&Depth stage", "Find where the film stands and how it bends"),
            ),
            4,
        )
    ),
    Action(
        "calibrate_everything",
        "Calibrate &everything",
        "Calibrate",
        "",
        "Run all calibrations in order on a rig that places targets itself",
        separator=True,
    ),
    Action(
        "scan_start",
        "&Start or resume the scan",
        "Scan",
        "Ctrl+Return",
        "Take every frame of the plan, or those that an interrupted scan still lacks",
    ),
    Action(
        "scan_pause", "&Pause or go on", "Scan", "Ctrl+Shift+P", "Wait before the next frame; nothing is lost"
    ),
    Action("scan_stop", "S&top the scan", "Scan", "", "What is stored stays stored, and can be resumed"),
    Action(
        "cancel_jobs",
        "&Cancel all work",
        "Scan",
        "Ctrl+.",
        "Stop everything that runs, at the next safe point",
        separator=True,
    ),
    *(
        Action(f"view_{key}", text, "Results", str(i), tip, page="results")
        for i, (key, text, tip) in enumerate(
            (
                ("colour", "&sRGB", "Colours as the eye sees them under a light"),
                ("band", "&Band", "Reflectance of one band"),
                ("depth", "&Depth", "Depth along the camera axis"),
                ("quality", "&Quality and orders", "Why pixels are limited, and which order measured a band"),
                ("cloud", "3D &cloud", "The points in space"),
            ),
            1,
        )
    ),
    Action(
        "band_down", "Band d&own", "Results", ",", "The next shorter wavelength", "results", separator=True
    ),
    Action("band_up", "Band &up", "Results", ".", "The next longer wavelength", "results"),
    Action(
        "intensity_graph",
        "&Intensity graph",
        "Results",
        "I",
        "What the pixel under the cursor saw line by line, against the model",
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
    Action("export_spectra", "E&xport spectra…", "Results", "", "Write the ticked spectra as CSV", "results"),
    Action(
        "series_add",
        "Add to a s&eries…",
        "Results",
        "",
        "Results that are compared together: a depth test, or accuracy over time",
        "compare",
        separator=True,
    ),
    Action(
        "reconstruct_again",
        "&Reconstruct again…",
        "Results",
        "Ctrl+R",
        "Make another result of a scan with other parameters, without scanning again",
        separator=True,
    ),
    Action("help_page", "&Help on this page", "Help", "F1", "Explains what has the focus, and its numbers"),
    Action("tour", "Guided &tour", "Help", "", "What is where in this window, in seven steps"),
    Action("demo", "&Demo", "Help", "", "A finished scan of the simulated rig", separator=True),
    Action("live_demo", "Demo, &live", "Help", "", "A short scan of the simulated rig, while you watch"),
    Action("shortcuts", "&Keyboard shortcuts", "Help", "Ctrl+/", "Every action and its keys"),
    Action("report_bundle", "Save a &report bundle…", "Help", "", "Log, settings and versions in one file"),
    Action("about", "&About", "Help", separator=True),
)


def find_action(key: str) -> Action:
    """The action of a key; raises `KeyError`."""
    return {action.key: action for action in ACTIONS}[key]
