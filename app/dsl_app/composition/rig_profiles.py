"""The action that makes or edits a rig profile, and offers it on the Rig page."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from PySide6.QtCore import Qt

from dsl_app.connection.state import Link, RigState
from dsl_app.shared.widgets.inside import apply_theme_inside
from dsl_app.shell.main_window import MainWindow


class ProfileAction:
    """Shows the dialog; ``offer`` gets the name of a rig that was saved."""

    def __init__(self, window: MainWindow, rig: RigState, offer: Callable[[str], object]) -> None:
        self._window, self._rig, self._offer = window, rig, offer

    def edit(self, name: str) -> None:
        """Edit the profile of a rig; a rig without one begins a new profile."""
        from dsl_app.rig.profiles.controller import ProfileController
        from dsl_app.rig.profiles.dialog import ProfileDialog
        from dsl_app.rig.profiles.state import ProfileState
        from dsl_core.io.rig_profile import profile_path

        window, state = self._window, ProfileState()
        state.saved.connect(self._saved)
        control = ProfileController(state, window.parts.runner, self._takes_devices)
        control.open(profile_path(name) if name else None)
        dialog = ProfileDialog(state, control, window)
        dialog.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        apply_theme_inside(dialog, window.theme)
        dialog.open()

    def _takes_devices(self) -> bool:
        """Whether a rig is connected that may hold a device: those of this program control none."""
        from dsl_core.devices.registry import is_built_in

        return self._rig.link.value is not Link.CLOSED and not is_built_in(self._rig.choice.value.name)

    def _saved(self, path: Path) -> None:
        self._offer(path.stem)
        self._window.toasts.tell("info", f"The rig {path.stem} is saved. Connect it on the Rig page.")
