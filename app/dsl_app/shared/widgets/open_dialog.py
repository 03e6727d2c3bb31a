"""A dialog to open files, in which a scan, a result or a campaign is one thing and no folder to walk into."""

from __future__ import annotations

from fnmatch import fnmatch
from pathlib import Path

from PySide6.QtCore import QDir, QFileInfo, QModelIndex, QPersistentModelIndex, QSortFilterProxyModel
from PySide6.QtGui import QAbstractFileIconProvider, QIcon
from PySide6.QtWidgets import QFileDialog, QFileIconProvider, QFileSystemModel, QWidget

from dsl_app.shared.known_files import Kind, kind_of, meant_by
from dsl_app.shared.paths import is_dir, is_file
from dsl_app.shared.widgets.ask_file import chosen_in, start_folder

#: Folders that are opened whole.
THINGS = (Kind.SCAN, Kind.RESULT, Kind.CAMPAIGN)
#: What may be shown alone, in the words of Qt's filters.
ALL, RESULTS, SCANS, BOTH = (
    "All files (*)",
    "Results (*.zarr)",
    "Scans (*.dsl)",
    "Results and scans (*.zarr *.dsl)",
)


class _Icons(QFileIconProvider):
    """Scans and results look like files, and say what they are in the column of types."""

    def icon(self, kind: QFileInfo | QAbstractFileIconProvider.IconType) -> QIcon:
        """The icon of a file for things."""
        if isinstance(kind, QFileInfo) and is_thing(Path(kind.filePath())):
            return super().icon(QAbstractFileIconProvider.IconType.File)
        return super().icon(kind)

    def type(self, info: QFileInfo) -> str:
        """What a thing is."""
        kind = kind_of(Path(info.filePath())) if info.isDir() else Kind.UNKNOWN
        return kind.value.capitalize() if kind in THINGS else super().type(info)


def is_thing(path: Path) -> bool:
    """Whether a folder is opened whole."""
    return is_dir(path) and kind_of(path) in THINGS


class _Things(QSortFilterProxyModel):
    """Shows those scans and results that the chosen filter names; Qt's filters are for files alone."""

    def __init__(self, dialog: QFileDialog) -> None:
        super().__init__(dialog)
        self._patterns = ["*"]

    def show_filter(self, words: str) -> None:
        """Show what a filter names from now on."""
        self._patterns = words.rpartition("(")[2].rstrip(")").split()
        self.invalidate()

    def filterAcceptsRow(self, row: int, parent: QModelIndex | QPersistentModelIndex) -> bool:
        """Whether a file or folder is shown; a folder without such an ending always is."""
        model = self.sourceModel()
        assert isinstance(model, QFileSystemModel)
        path = Path(model.filePath(model.index(row, 0, parent)))
        is_named = path.suffix.lower() in (".dsl", ".zarr")
        return not is_named or any(fnmatch(path.name.lower(), pattern) for pattern in self._patterns)


class OpenDialog(QFileDialog):
    """Ends with the thing that is double-clicked, or chosen with *Open*; other folders are entered.

    Where ``takes_folders``, *Open* chooses any folder. ``filters`` are offered, the first is on. It is Qt's
    own dialog: those of systems know only folders.
    """

    def __init__(
        self,
        parent: QWidget | None,
        title: str,
        folder: str,
        takes_folders: bool,
        filters: tuple[str, ...] = (ALL, RESULTS, SCANS),
    ) -> None:
        folder = folder or start_folder()
        place = Path(folder)
        # One that does not exist yet would be taken for a name that was typed, and nothing could be chosen.
        super().__init__(parent, title, folder if is_dir(place) else str(place.parent))
        self._takes_folders = takes_folders
        self.chosen: Path | None = None
        self.setOption(QFileDialog.Option.DontUseNativeDialog)
        modes = QFileDialog.FileMode
        self.setFileMode(modes.Directory if takes_folders else modes.ExistingFile)
        self.setOption(QFileDialog.Option.ShowDirsOnly, False)
        self._icons = _Icons()
        self.setIconProvider(self._icons)
        self.setFilter(QDir.Filter.AllEntries | QDir.Filter.NoDotAndDotDot | QDir.Filter.AllDirs)
        self._things = _Things(self)
        self.setProxyModel(self._things)
        self.setNameFilters(list(filters))
        self.filterSelected.connect(self._things.show_filter)
        self._things.show_filter(filters[0])
        self.directoryEntered.connect(self._entered)

    def _entered(self, folder: str) -> None:
        """A thing that is entered was meant."""
        if self.chosen is None and is_thing(Path(folder)):
            self._choose(Path(folder))

    def _choose(self, path: Path) -> None:
        self.chosen = meant_by(path)
        chosen_in(path)
        self.done(QFileDialog.DialogCode.Accepted)

    def accept(self) -> None:
        """Choose what is selected, or enter it."""
        names = [Path(name) for name in self.selectedFiles()]
        if len(names) == 1 and (is_file(names[0]) or is_thing(names[0]) or self._takes_folders):
            self._choose(names[0])
        else:
            super().accept()

    @classmethod
    def ask(
        cls,
        parent: QWidget | None,
        title: str,
        folder: str = "",
        takes_folders: bool = False,
        filters: tuple[str, ...] = (ALL, RESULTS, SCANS),
    ) -> Path | None:
        """What a person chooses, None for nothing."""
        dialog = cls(parent, title, folder, takes_folders, filters)
        dialog.exec()
        chosen = dialog.chosen
        dialog.deleteLater()
        return chosen

    @classmethod
    def ask_folder(cls, parent: QWidget | None, title: str, folder: str = "") -> Path | None:
        """A folder that a person chooses, who sees what is in it; a file stands for its folder."""
        path = cls.ask(parent, title, folder, takes_folders=True, filters=(ALL,))
        return path.parent if path is not None and is_file(path) else path
