"""Which file of the published dataset layout is which shot, and a table of what is missing or misnamed.

==========================  =====================================================================
folder or file              content
==========================  =====================================================================
``intensityK/``             one image of the scene under the white pattern, setting K = 1, 2, ...
``black_exposureK/``        one image under the black pattern
``ldr_exposureK/``          one image a scan line, numbered from 0
``depth.npy``               points, (rows, columns, 3), metres, camera frame
``graycode_exposureK/``     ``graycode_NN.png``: the binary code; our addition, since the published layout
                            has depth in its place (names as in procam-calibration)
==========================  =====================================================================

Images are R, G, B in PNG, 16 bit, numbered ``capture_0000.png`` (the published capture program) or
``scene under white scanline pattern 0.png`` (its README). Earlier versions name the folders after exposure
and level; these names are known too.
"""

from __future__ import annotations

import re
import struct
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from dsl_core.io.png_parts import SIGNATURE, declares_too_much
from dsl_core.io.reading import parts_of, require_plain
from dsl_core.model.plan import MOST_PX, CapturePlan, Role, Setting
from dsl_core.words import counted

#: ``optional`` is what is not there and need not be.
Status = Literal["ok", "missing", "optional", "misnamed", "wrong size", "wrong type", "unreadable", "extra"]
#: Role, setting and pattern of a shot: what a file has to know of it.
Place = tuple[Role, int, int]

DEPTH_NAME = "depth.npy"
FOLDERS: dict[Role, str] = {
    "white": "intensity{k}",
    "black": "black_exposure{k}",
    "spectral": "ldr_exposure{k}",
    "code": "graycode_exposure{k}",
}
_EARLIER_FOLDERS: dict[Role, str] = {
    "white": "intensity_{percent:.0f}_white_crop/calibration00",
    "black": "step2_{exposure:.0f}ms_black_crop/calibration00",
    "spectral": "step2_{exposure:.0f}ms_crop/calibration00",
}
_FILE_NAMES: dict[Role, tuple[str, ...]] = {
    "white": ("capture_{n:04d}.png",),
    "black": ("capture_{n:04d}.png",),
    "spectral": ("capture_{n:04d}.png", "scene under white scanline pattern {n}.png"),
    "code": ("graycode_{n:02d}.png",),
}
_LAST_NUMBER = re.compile(r"(\d+)(?!.*\d)")


@dataclass(frozen=True)
class FileRecord:
    """A line of the table: what should be there, what is, and what to do (empty where all is well)."""

    expected: str
    found: str | None
    status: Status
    advice: str


def as_published(records: Sequence[FileRecord]) -> tuple[int, int]:
    """How many entries are as published, and how many should be: what is optional may be absent."""
    wanted = [record for record in records if record.status != "optional"]
    return sum(record.status == "ok" for record in wanted), len(wanted)


@dataclass
class FolderSurvey:
    """The usable file of every place of a plan below ``root``, and the table of all files."""

    root: Path
    plan: CapturePlan
    files: dict[Place, Path] = field(default_factory=dict)
    records: list[FileRecord] = field(default_factory=list)
    by_place: dict[Place, FileRecord] = field(default_factory=dict)

    def add(self, record: FileRecord, place: Place | None = None, path: Path | None = None) -> None:
        """Append a line, and the file when it can be used."""
        self.records.append(record)
        if place is not None:
            self.by_place[place] = record
            if path is not None and record.status in {"ok", "misnamed"}:
                self.files[place] = path

    def look_at_folder(self, role: Role, setting: int, count: int) -> None:
        """Look for the ``count`` frames of a role at a setting."""
        folder = find_folder(self.root, role, setting, self.plan.settings[setting])
        if folder is None:
            name = f"{folder_name(role, setting)}/"
            images = counted(count, "image")
            record = FileRecord(name, None, "missing", f"{_loss(role)} ({images})")
            self.add(record)
            self.by_place |= {(role, setting, pattern): record for pattern in range(count)}
            return
        numbered, stray = _numbered(folder, count)
        shift = 1 if count > 1 and 0 not in numbered and count in numbered else 0
        words = self._of_shift(role, setting) if shift else ""
        for pattern in range(count):
            candidates = numbered.pop(pattern + shift, [])
            self._look_at_frame((role, setting, pattern), folder, candidates, words)
            stray += candidates[1:]
        stray += [path for paths in numbered.values() for path in paths]
        for path in sorted(stray):
            name = path.relative_to(self.root).as_posix()
            advice = "not a frame of the plan, ignored; check that the plan is the scan's"
            self.add(FileRecord("", name, "extra", advice))

    def _look_at_frame(self, place: Place, folder: Path, candidates: list[Path], shift: str) -> None:
        role, setting, pattern = place
        wanted = folder_name(role, setting)
        expected = f"{wanted}/{file_name(role, pattern)}"
        if not candidates:
            self.add(FileRecord(expected, None, "missing", _loss(role)), place)
            return
        path = candidates[0]
        found = path.relative_to(self.root).as_posix()
        status, advice = _judge(probe_png(path), self.plan)
        if status == "ok":
            if shift:
                status, advice = "misnamed", shift
            elif role in {"spectral", "code"} and not _is_named(path, role, pattern):
                status, advice = "misnamed", f"used by its number; rename it to {file_name(role, pattern)}"
            elif folder.name != wanted and _bare(folder.name) == _bare(wanted):
                status, advice = "misnamed", f"used; rename the folder to {wanted}"
        self.add(FileRecord(expected, found, status, advice), place, path)

    def _of_shift(self, role: Role, setting: int) -> str:
        """Advice on numbers that start at 1: where another setting's do not, one may be missing."""
        advice = "the numbers start at 1; used as if they started at 0"
        for other, values in enumerate(self.plan.settings):
            folder = find_folder(self.root, role, other, values) if other != setting else None
            if folder is not None and 0 in _numbered(folder, 0)[0]:
                doubt = f"though those of {folder.name} do: check that the first one is not missing here"
                return f"{advice}, {doubt}"
        return advice


def survey(root: Path, plan: CapturePlan) -> FolderSurvey:
    """Look for every shot of a plan below ``root``.

    Its table has a line for every file that the plan needs or that is in its way, one for a folder that is
    missing as a whole.
    """
    result = FolderSurvey(root, plan)
    counts = Counter((shot.role, shot.setting) for shot in plan.shots())
    for (role, setting), count in counts.items():
        result.look_at_folder(role, setting, count)
    points = root / DEPTH_NAME
    if points.is_file():
        result.add(FileRecord(DEPTH_NAME, DEPTH_NAME, "ok", ""))
    else:
        result.add(FileRecord(DEPTH_NAME, None, "optional", "depth is computed from the code frames"))
    return result


def folder_name(role: Role, setting: int) -> str:
    """Published name of the folder of a role and setting."""
    return FOLDERS[role].format(k=setting + 1)


def file_name(role: Role, pattern: int) -> str:
    """Published name of a frame."""
    return _FILE_NAMES[role][0].format(n=pattern)


def find_folder(root: Path, role: Role, setting: int, values: Setting) -> Path | None:
    """The folder under its published name, an earlier one, or one that differs in case and signs only."""
    wanted = folder_name(role, setting)
    earlier = _EARLIER_FOLDERS.get(role)
    if (root / wanted).is_dir():
        return root / wanted
    if earlier is not None:
        path = root / earlier.format(percent=100 * values.level, exposure=values.exposure_ms)
        if path.is_dir():
            return path
    near = (f for f in sorted(root.glob("*")) if f.is_dir() and _bare(f.name) == _bare(wanted))
    return next(near, None)


def _bare(name: str) -> str:
    return re.sub(r"[^a-z0-9]", "", name.lower())


def _numbered(folder: Path, count: int) -> tuple[dict[int, list[Path]], list[Path]]:
    """PNG files by the last number in their names, well-named ones first, and those without a number."""
    numbered: dict[int, list[Path]] = {}
    stray = []
    files = sorted(path for path in folder.iterdir() if path.suffix.lower() == ".png")
    if count == 1 and files:
        # A folder for one image: its name and number do not matter to the published readers either.
        return {0: files}, []
    for path in files:
        match = _LAST_NUMBER.search(path.stem)
        if match is None:
            stray.append(path)
        else:
            numbered.setdefault(int(match[1]), []).append(path)
    for number, paths in numbered.items():
        paths.sort(key=lambda path: not any(_is_named(path, role, number) for role in _FILE_NAMES))
    return numbered, stray


def _is_named(path: Path, role: Role, pattern: int) -> bool:
    return path.name in {name.format(n=pattern) for name in _FILE_NAMES[role]}


def _judge(info: PngInfo | str, plan: CapturePlan) -> tuple[Status, str]:
    width, height = plan.camera_size_px
    if isinstance(info, str):
        return "unreadable", f"{info}; copy it again or capture it again"
    if (info.width_px, info.height_px) != (width, height):
        given = f"{info.width_px} x {info.height_px}"
        return (
            "wrong size",
            f"is {given} px, {width} x {height} is needed: crop and bin as for the calibration",
        )
    if info.channels != 3 or info.bits not in {8, 16}:
        kind = f"{info.channels} channel(s) of {info.bits} bit"
        return (
            "wrong type",
            f"has {kind}; R, G, B of 8 or 16 bit are needed: save the raw frame again",
        )
    return "ok", "" if info.bits == 16 else "8 bit only: dark first orders are coarse"


def _loss(role: Role) -> str:
    losses: dict[Role, str] = {
        "white": "capture it, or give depth and shading from elsewhere",
        "black": "black cannot be subtracted: capture it with the projector black",
        "spectral": "capture it again: bands that this line lights are lost",
        "code": "depth is decoded from it: capture it, because depth.npy alone cannot be imported",
    }
    return losses[role]


_END = b"\0\0\0\0IEND\xaeB`\x82"
_MOST_PIXELS = 200_000_000
#: More than a PNG of so many pixels takes.
MOST_PNG_BYTES = 1 << 31
_CHANNELS = {0: 1, 2: 3, 3: 1, 4: 2, 6: 4}


@dataclass(frozen=True)
class PngInfo:
    """What a PNG's header says; ``bits`` is per channel."""

    width_px: int
    height_px: int
    bits: int
    channels: int


def probe_png(path: Path) -> PngInfo | str:
    """The header of a PNG (specification, 11.2), undecoded, or in words why the file is not a whole one."""
    try:
        size = require_plain(path)
        with path.open("rb") as file:
            head = file.read(33)
            file.seek(max(size - len(_END), 0))
            tail = file.read()
        with parts_of(path, MOST_PNG_BYTES) as content:
            too_much = declares_too_much(content)
    except OSError as error:
        return f"cannot be read ({error.strerror})"
    if len(head) < 33 or not head.startswith(SIGNATURE) or head[12:16] != b"IHDR":
        return "is not a PNG image"
    if tail != _END:
        return "is cut off"
    if too_much:
        return "is damaged: a part of it declares more bytes than it has"
    width, height, bits, colour = struct.unpack(">IIBB", head[16:26])
    if not (0 < width <= MOST_PX and 0 < height <= MOST_PX and width * height <= _MOST_PIXELS):
        return f"declares {width} x {height} px, which no camera has"
    return PngInfo(width, height, bits, _CHANNELS.get(colour, 0))
