"""Wrong command lines: what each command is given when all is well, and every kind of mistake in it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

#: Per kind of argument, values that cannot be meant, each with the kind of mistake. The files are those of
#: `tests.system.test_cli_wrong_lines`: a scan, a result, a plan, a rig, a text, an empty JSON, a folder.
WRONG: dict[str, dict[str, str]] = {
    "scan": {
        "absent": "absent.dsl",
        "a result for a scan": "scan.zarr",
        "a file for a folder": "text.txt",
        "an empty folder": "folder",
        "an empty text": "",
    },
    "result": {
        "absent": "absent.zarr",
        "a scan for a result": "scan.dsl",
        "a file for a folder": "text.txt",
        "an empty folder": "folder",
        "an empty text": "",
    },
    "path": {
        "absent": "absent",
        "an empty folder": "folder",
        "another kind": "text.txt",
        "an empty text": "",
    },
    "plan": {
        "absent": "absent.json",
        "an empty object": "braces.json",
        "not JSON": "text.txt",
        "a folder for a file": "folder",
        "another kind of file": "rig.json",
    },
    "calibration": {
        "absent": "absent.json",
        "an empty object": "braces.json",
        "a folder for a file": "folder",
        "another kind of file": "plan.json",
    },
    "new file": {
        "already there": "text.txt",
        "a folder for a file": "folder",
        "below a file": "text.txt/out",
        "an empty text": "",
    },
    "new folder": {"already there": "scan.dsl", "below a file": "text.txt/out", "a file": "text.txt"},
    "rig": {"unknown": "twinn", "a folder": "folder", "an empty object": "braces.json"},
    "rig option": {
        "without a value": "scene",
        "unknown": "sise=112x72",
        "not a size": "size=112",
        "unknown scene": "scene=plain",
        "huge": "size=99999x99999",
    },
    "bands": {
        "too fine": "430:660:0.0001",
        "beyond light": "100:2000:5",
        "backwards": "660:430:5",
        "no step": "430:660:0",
        "words": "blue:red:5",
        "two numbers": "430:660",
        "not a number": "nan:660:5",
    },
    "number": {"a word": "many", "negative": "-5", "not a number": "nan", "endless": "inf"},
    "whole number": {"a word": "many", "negative": "-5", "broken": "3.5", "huge": "99999999999"},
    "choice": {"unknown": "magic", "an empty text": ""},
    "time": {"a word": "long", "negative": "-60s", "none": "0s", "endless": "inf", "not a number": "nan"},
    "size": {"one number": "112", "negative": "-112x72", "words": "widexhigh", "none": "0x0"},
    "pixel": {"one number": "1", "outside": "999,999", "words": "a,b", "broken": "1.5,2"},
    "numbers": {"words": "a,b", "too many": "1,2,3", "not a number": "nan,1", "an empty text": ""},
    "region": {"three numbers": "1,2,3", "outside": "900,900,10,10", "empty": "0,0,0,0"},
    "lines": {"one number": "5", "overlapping": "5x9", "none": "0x5", "words": "5xfive"},
    "setting": {"no level": "100", "too bright": "100@2", "not a number": "nan@0.5", "too long": "99999@0.5"},
    "pictures": {"absent": "absent", "no pictures": "folder", "another kind": "text.txt"},
    "name": {"absent": "nobody", "a path": "../nobody", "an empty text": ""},
    "library name": {"a path": "../nobody", "an empty text": ""},
    "new name": {"two words": "My Lab", "taken": "twin", "an empty text": ""},
    "step setting": {"without a value": "scene", "unknown": "speed=5"},
    "mesh file": {
        "another ending": "new.txt",
        "no ending": "new",
        "a folder for a file": "folder",
        "below a file": "text.txt/new.ply",
        "an empty text": "",
    },
    "table": {"another ending": "new.txt", "a folder for a file": "folder", "below a file": "text.txt/a.csv"},
    "page": {"another ending": "new.txt", "a folder for a file": "folder", "below a file": "text.txt/a.html"},
    "spectra": {"absent": "absent", "no spectra": "folder", "another kind": "braces.json"},
    "place": {
        "without a name": "1,1",
        "outside": "a=999,999",
        "words": "a=b,c",
        "three numbers": "a=1,2,3",
        "an empty text": "",
    },
    "light": {"unknown": "D99", "an empty text": ""},
    "span": {"backwards": "660:430", "one number": "430", "words": "blue:red", "no band": "100:101"},
    "tolerance": {"not a number": "nanDN", "negative": "-1DN", "words": "little", "an empty text": ""},
}


@dataclass(frozen=True)
class Command:
    """A command, the kinds of its arguments with values that are well, and those of its options."""

    name: str
    arguments: tuple[tuple[str, str], ...] = ()
    options: dict[str, tuple[str, str]] = field(default_factory=dict)
    #: Arguments that go with the wrong option, where it needs company.
    also: tuple[str, ...] = ()
    #: Arguments without which the command would mean something else.
    always: tuple[str, ...] = ()

    def mistakes(self) -> Iterator[tuple[str, list[str]]]:
        """Each kind of mistake and the command line with it."""
        named = self.name.split()
        words = [*named, *self.always]
        right = [value for _, value in self.arguments]
        yield "an unknown option", [*words, *right, "--unheard-of"]
        yield "an unknown letter", [*words, *right, "-z"]
        yield "a misspelt option", [*words, *right, "--jsno"]
        yield "a switch with a value", [*words, *right, "--json=yes"]
        yield "a number for an option", [*words, *right, "-5"]
        yield "an empty argument", [*words, *right, ""]
        yield "a misspelt command", [*named[:-1], f"{named[-1]}x", *self.always, *right]
        yield "one argument too many", [*words, *right, "one-more", "and-another"]
        if self.arguments and self.name != "rigs doctor":
            yield "an argument too few", [*words, *right[:-1]]
        for place, (kind, _) in enumerate(self.arguments):
            for mistake, wrong in WRONG[kind].items():
                yield f"{kind}: {mistake}", [*words, *right[:place], wrong, *right[place + 1 :]]
        for option, (kind, _) in self.options.items():
            yield f"{option} without a value", [*words, *right, option]
            for mistake, wrong in WRONG[kind].items():
                yield f"{option}: {mistake}", [*words, *right, *self.also, option, wrong]


RIG = {"--rig": ("rig", "twin"), "-O": ("rig option", "size=112x72")}
COMMANDS = (
    Command("demo", (), {"--size": ("size", "56x36"), "--effects": ("choice", "all")}),
    Command("scenes"),
    Command(
        "effects",
        (),
        {
            "--plan": ("plan", "plan.json"),
            "--scene": ("choice", "box"),
            "--tolerance": ("tolerance", "1DN"),
        },
    ),
    Command(
        "plan",
        (("new file", "new.json"),),
        {
            **RIG,
            "--lines": ("lines", "5x5"),
            "--setting": ("setting", "100@0.5"),
            "--code": ("choice", "columns"),
        },
    ),
    Command(
        "scan",
        (("new folder", "new.dsl"),),
        {**RIG, "--plan": ("plan", "plan.json"), "--calibration": ("calibration", "rig.json")},
    ),
    Command("resume", (("scan", "scan.dsl"),), {"--rig": ("rig", "twin")}),
    Command(
        "reconstruct",
        (("scan", "scan.dsl"),),
        {
            "-o": ("new folder", "new.zarr"),
            "--bands": ("bands", "430:660:10"),
            "--model": ("choice", "auto"),
            "--solver": ("choice", "best"),
            "--device": ("choice", "cpu"),
            "--calibration": ("calibration", "rig.json"),
        },
        ("-o", "new.zarr"),
    ),
    Command(
        "evaluate",
        (("result", "scan.zarr"),),
        {"-o": ("new file", "new.html"), "--truth-rig": ("rig", "twin")},
    ),
    Command("compare", (("result", "scan.zarr"), ("result", "scan.zarr"))),
    Command(
        "depth-test",
        (("result", "scan.zarr"),),
        {
            "--positions": ("numbers", "1,2"),
            "--region": ("region", "0,0,9,9"),
            "-o": ("new file", "new.html"),
        },
    ),
    Command("sweep", (("result", "scan.zarr"),), {"--against": ("result", "scan.zarr")}),
    Command(
        "export",
        (("result", "scan.zarr"), ("choice", "csv"), ("new file", "new.csv")),
        {"--pixel": ("pixel", "1,1")},
    ),
    Command(
        "mesh",
        (("result", "scan.zarr"), ("mesh file", "new.ply")),
        {"--every": ("whole number", "1")},
    ),
    Command(
        "classify",
        (("result", "scan.zarr"),),
        {
            "--library": ("spectra", "spectra.csv"),
            "--library-error": ("number", "0.02"),
            "--by": ("choice", "angle"),
            "--worst": ("number", "0.1"),
            "--range": ("span", "430:660"),
            "--at": ("place", "a=28,18"),
            "-o": ("table", "new.csv"),
        },
        always=("--at", "a=28,18"),
    ),
    Command(
        "spectra",
        (("result", "scan.zarr"),),
        {"--at": ("place", "a=28,18"), "-o": ("table", "new.csv")},
        always=("--at", "a=28,18"),
    ),
    Command(
        "colours",
        (("result", "scan.zarr"),),
        {"--at": ("place", "a=28,18"), "--light": ("light", "D65"), "--to": ("name", "a")}
        | {"-o": ("table", "new.csv")},
        always=("--at", "a=28,18"),
    ),
    Command(
        "report",
        (("result", "scan.zarr"),),
        {"-o": ("page", "new.html"), "--library": ("spectra", "spectra.csv")},
    ),
    Command(
        "import", (("pictures", "folder"),), {"--unit-mm": ("number", "1"), "--mapping": ("plan", "m.json")}
    ),
    Command("info", (("path", "scan.dsl"),)),
    Command(
        "tradeoff", (), {"--budget": ("time", "60s"), "--error": ("number", "0.01"), "--rig": ("rig", "twin")}
    ),
    Command(
        "design",
        (("new file", "new.json"),),
        {"--frames": ("whole number", "32"), "--orders": ("whole number", "1"), "--rig": ("rig", "twin")},
    ),
    Command("selftest", (), {"--rig": ("rig", "twin"), "--set": ("step setting", "a=b")}),
    Command(
        "calibrate geometry",
        (("pictures", "folder"),),
        {"--board": ("size", "11x7"), "--square-mm": ("number", "20"), "--projector": ("size", "640x360")},
        always=("--pictures", "--board", "11x7", "--square-mm", "20"),
    ),
    Command("calibrate spectralon", (("new folder", "campaign"),), {"--rig": ("rig", "twin")}, ("--yes",)),
    Command(
        "calibrate color-checker",
        (("new folder", "campaign"),),
        {"--rig": ("rig", "twin"), "--set": ("step setting", "a=b")},
        ("--yes",),
    ),
    Command(
        "calibrate bandpass",
        (("new folder", "campaign"),),
        {"--rig": ("rig", "twin"), "-O": ("rig option", "size=112x72")},
        ("--yes",),
    ),
    Command(
        "calibrate depth-stage",
        (("new folder", "campaign"),),
        {"--rig": ("rig", "twin"), "--set": ("step setting", "a=b")},
        ("--yes",),
    ),
    Command(
        "calibrate all",
        (("new folder", "campaign"),),
        {"--rig": ("rig", "twin"), "--name": ("library name", "a")},
    ),
    Command("calibrations list"),
    Command("calibrations show", (("name", "lab"),), {"-o": ("new file", "new.html")}),
    Command("calibrations check", (("name", "lab"),), {"--rig": ("rig", "twin")}, ("--yes",)),
    Command("calibrations restore", (("name", "lab"), ("name", "2026"))),
    Command(
        "calibrations export", (("name", "lab"), ("new file", "new.json")), {"--form": ("choice", "rig")}
    ),
    Command("calibrations import", (("calibration", "rig.json"),)),
    Command("doctor", always=("--no-devices",)),
    Command("rigs"),
    Command("rigs drivers"),
    Command("rigs doctor", (("rig", "lab"),)),
    Command("rigs new", (("new name", "my-lab"),)),
    Command("gui", (), {"--theme": ("choice", "dark")}),
)


def wrong_lines() -> list[tuple[str, list[str]]]:
    """Every mistake in every command, by its name."""
    return [
        (f"{command.name}, {mistake}", line) for command in COMMANDS for mistake, line in command.mistakes()
    ]
