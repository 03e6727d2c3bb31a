"""Exports a result: formats, the files they make, and what stands in the way. No Qt."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

from dsl_app.results.state import BAND_KEY, BANDS_KEY, COLOUR_KEY, ResultsState, depth_key
from dsl_app.shared.jobs.base import Job, JobRunner
from dsl_app.shared.notify import Notifier
from dsl_app.shared.paths import is_dir, is_file, there
from dsl_app.shared.replaced import load_as_read
from dsl_core.io.export.format import Exporter, Format
from dsl_core.io.result.result_arrays import ResultArrays
from dsl_core.optics.levels import top_of
from dsl_core.progress import Progress
from dsl_core.words import counted


class ExportController:
    """Writes a result in other formats as it is looked at when this is made.

    Another result may be opened behind a dialog: its name, pins and pictures belong to the first one.
    """

    def __init__(
        self, result: ResultArrays, state: ResultsState, runner: JobRunner, notifier: Notifier
    ) -> None:
        """Keep what is marked on the open ``result``, and how its pictures are shown."""
        self.result, self._runner, self._notifier = result, runner, notifier
        pins = [mark.pixel for mark in state.marks.value if mark.pixel and not mark.trouble]
        self._pixels = [result.in_picture(pin) for pin in pins]
        self._choice, self._look = picture_choice(state), picture_look(state)

    def refusal(self, form: Format) -> str:
        """Why a format cannot be written for this result; empty when it can."""
        if form.needs_pins and not self._pixels:
            return "Pin a pixel first"
        if form.needs_spectra and not self.result.has_spectra:
            return "This result has depth only"
        return ""

    def trouble(self, folder: str, name: str, targets: dict[str, Path], replace: bool) -> str:
        """Why the files cannot be written, and what to do; empty when they can."""
        if not targets:
            return "Select at least one format."
        if not name:
            return "Enter a name for the files."
        if not is_dir(Path(folder)):
            return f"{folder} is not a folder. Choose an existing one."
        taken = self.taken(targets)
        if taken and not replace:
            names = ", ".join(path.name for path in taken[:4]) + (" and more" if len(taken) > 4 else "")
            verb = "exists" if len(taken) == 1 else "exist"
            return f"{names} already {verb}. Choose another name, or allow replacing."
        return ""

    def taken(self, targets: dict[str, Path]) -> list[Path]:
        """Files that an export would replace."""
        return [path for path in expected_files(targets, self.result, self._choice) if there(path)]

    def write(self, targets: dict[str, Path], overwrite: bool) -> None:
        """Write the result to a path per format key.

        Tables hold the pins; pictures show the bands, light and contrast of then.
        """
        if not targets:
            return
        result, look = self.result, {**self._choice, **self._look}

        def work(progress: Progress) -> list[Path]:
            from dsl_core.io.export import export_csv, export_png, formats

            exporters: dict[str, Exporter] = {
                **{form.key: form.write for form in formats().values()},
                "csv": partial(export_csv, pixels=self._pixels),
                "png": partial(export_png, **look),
            }
            data, written = load_as_read(result), []
            for done, (form, path) in enumerate(targets.items()):
                check = partial(progress.report, f"write {form}", done, len(targets))
                check()
                written += exporters[form](data, path, overwrite=overwrite, check=check)
            return written

        self._runner.submit(Job(f"Export {result.path.stem}", work, self._exported))

    def _exported(self, written: Sequence[Path]) -> None:
        size = size_words(sum(path.stat().st_size for path in written if is_file(path)))
        self._notifier.tell(
            "info",
            f"Wrote {counted(len(written), 'file')}, {size}, to {written[0].parent}.",
            "\n".join(str(path) for path in written),
        )


def size_words(count: int) -> str:
    """A number of bytes as text, never as nothing.

    >>> size_words(8_643), size_words(46_096_080), size_words(12)
    ('9 kB', '46.1 MB', '1 kB')
    """
    return f"{count / 1e6:.1f} MB" if count >= 1e6 else f"{max(round(count / 1e3), 1)} kB"


def picture_choice(state: ResultsState) -> dict[str, Any]:
    """What exported pictures show of that on the screen: the band, the light, and three bands as colours."""
    result, bands = state.result.value, state.bands.value
    light, adapted = state.picture_light.value
    choice: dict[str, Any] = {"light": light, "adapted": adapted}
    if result is not None and result.has_spectra:
        choice["band_nm"] = float(result.wavelengths_nm[state.band.value])
        if bands is not None:
            choice["bands_nm"] = tuple(float(result.wavelengths_nm[band]) for band in bands)
    return choice


def picture_look(state: ResultsState) -> dict[str, Any]:
    """The levels that exported pictures take over from those on the screen."""
    result, bands, levels = state.result.value, state.bands.value, state.levels.value
    limits = state.depth_limits.value
    look: dict[str, Any] = {
        "colour_levels": levels.get(COLOUR_KEY),
        "band_levels": levels.get(BAND_KEY),
        "depth_levels_mm": levels.get(depth_key(limits), limits),
    }
    if result is not None and bands is not None:
        look["bands_levels"] = levels.get(BANDS_KEY, (0.0, top_of(result["reflectance"])))
    return {name: value for name, value in look.items() if value is not None}


def expected_files(targets: dict[str, Path], result: ResultArrays, choice: dict[str, Any]) -> list[Path]:
    """Files that an export writes; ``choice`` is that of pictures."""
    from dsl_core.io.export.depth_maps import depth_files
    from dsl_core.io.export.mesh.export import mesh_files
    from dsl_core.io.export.png import picture_files

    held = set(result.arrays) - set(result.missing)
    files: list[Path] = []
    for form, path in targets.items():
        if form == "envi":
            headers = [path]
            if "reflectance_std" in held:
                headers.append(path.with_name(f"{path.stem}_std.hdr"))
            files += [file for header in headers for file in (header, header.with_suffix(".img"))]
        elif form in ("tiff", "npy"):
            files += depth_files(path, "depth_std_mm" in held, "flags" in held)
        elif form == "obj":
            files += mesh_files(path, "rgb" in held)
        elif form == "png":
            files += picture_files(path, held, result.wavelengths_nm.tolist(), **choice).values()
        else:
            files.append(path)
    return files
