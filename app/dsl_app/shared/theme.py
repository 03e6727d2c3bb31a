"""Colours of the application: one accent, data in the foreground. No Qt here."""

from __future__ import annotations

from dataclasses import dataclass

from dsl_core.analysis.mark_colours import FIRST, Ground, mark_colour


@dataclass(frozen=True)
class Theme:
    """Colours by role, as ``#rrggbb``.

    ``window`` is the background, ``base`` that of plots and input, ``surround`` that of pictures, on which
    white, black and grey areas keep their edges; ``raised`` is that of toolbars and of surfaces in 3D, whose
    holes it is seen through: no black, which a dark surface has. ``line`` separates. ``muted`` is for units
    and hints. All that is text keeps a contrast of 4.5 to 1 on ``window`` and ``base``, and ``muted`` on
    ``surround`` and ``raised``, too.
    ``ground`` says which of the two sets of colours marks, curves and classes have.
    """

    name: str
    window: str
    base: str
    surround: str
    raised: str
    line: str
    text: str
    muted: str
    accent: str
    on_accent: str
    good: str
    warn: str
    bad: str
    ground: Ground

    @property
    def pins(self) -> tuple[str, ...]:
        """The first colours of marks."""
        return FIRST[self.ground]

    def pin(self, index: int) -> str:
        """The colour of the mark with an index, and of the class that is made from it."""
        return mark_colour(index, self.ground)


LIGHT = Theme(
    name="light",
    window="#f3f4f6",
    base="#ffffff",
    surround="#dfe2e7",
    raised="#e6e8ec",
    line="#c9cdd4",
    text="#1b1e24",
    muted="#5b6270",
    accent="#1f6feb",
    on_accent="#ffffff",
    good="#1a7f37",
    warn="#8a5a00",
    bad="#c02626",
    ground="light",
)
DARK = Theme(
    name="dark",
    window="#1d2026",
    base="#14161a",
    surround="#14161a",
    raised="#2a2e36",
    line="#3b414c",
    text="#e7e9ee",
    muted="#9aa3b2",
    accent="#4c8dff",
    on_accent="#0b1020",
    good="#4cc46a",
    warn="#e0a63a",
    bad="#ff6b6b",
    ground="dark",
)


def style_sheet(theme: Theme) -> str:
    """The style sheet of the whole application for a theme."""
    t = theme
    return f"""
QToolTip {{ background: {t.raised}; color: {t.text}; border: 1px solid {t.line}; padding: 4px; }}
QMainWindow::separator {{ background: {t.line}; width: 1px; height: 1px; }}
QDockWidget {{ color: {t.text}; }}
QDockWidget::title {{ background: {t.window}; padding: 5px 8px; border-bottom: 1px solid {t.line}; }}
QGroupBox {{ border: 1px solid {t.line}; border-radius: 4px; margin-top: 18px; padding: 8px; }}
QGroupBox::title {{ subcontrol-origin: margin; left: 0px; top: 2px; color: {t.muted}; font-weight: 600; }}
QLabel[role="muted"] {{ color: {t.muted}; }}
QLabel#over-picture {{ background: {t.raised}; border-radius: 4px; padding: 6px 10px; }}
QLabel[role="title"] {{ font-size: 15pt; font-weight: 600; }}
QLabel[role="heading"] {{ font-weight: 600; }}
QLabel[role="good"] {{ color: {t.good}; }}
QLabel[role="warn"] {{ color: {t.warn}; }}
QLabel[role="bad"] {{ color: {t.bad}; }}
QLabel[role="accent"] {{ color: {t.accent}; }}
QFrame#rail {{ background: {t.raised}; border-right: 1px solid {t.line}; }}
QFrame#rail QToolButton {{ border: none; padding: 8px 4px; color: {t.muted};
  border-left: 3px solid transparent; }}
QFrame#rail QToolButton:hover {{ background: {t.window}; color: {t.text}; }}
QFrame#rail QToolButton:checked {{ color: {t.text}; border-left: 3px solid {t.accent};
  background: {t.window}; }}
QFrame#rail QToolButton:focus {{ color: {t.text}; text-decoration: underline; }}
QToolButton[role="choice"] {{ padding: 3px 5px; border: 1px solid {t.line}; border-radius: 4px;
  background: {t.raised}; }}
QToolButton[role="choice"]:hover {{ border-color: {t.muted}; }}
QToolButton[role="choice"]:focus {{ border-color: {t.text}; }}
QToolButton[role="choice"]:checked {{ background: {t.accent}; color: {t.on_accent};
  border-color: {t.accent}; }}
QToolButton[role="choice"]:checked:focus {{ border-color: {t.text}; }}
QToolButton[role="menu"] {{ padding: 3px 18px 3px 6px; border: 1px solid {t.muted}; border-radius: 2px;
  background: {t.raised}; }}
QToolButton[role="menu"]:hover, QToolButton[role="menu"]:focus {{ border-color: {t.text}; }}
QToolButton[role="menu"]::menu-indicator {{ subcontrol-origin: border; subcontrol-position: right center;
  right: 5px; }}
QPushButton[role="primary"] {{ background: {t.accent}; color: {t.on_accent}; border: 1px solid {t.accent};
  border-radius: 4px; padding: 5px 14px; font-weight: 600; }}
QPushButton[role="primary"]:disabled {{ background: {t.raised}; color: {t.muted}; border-color: {t.line}; }}
QPushButton[role="primary"]:focus {{ border: 2px solid {t.text}; }}
QFrame[role="card"] {{ background: {t.base}; border: 1px solid {t.line}; border-radius: 6px; }}
QFrame[role="toast"] {{ background: {t.raised}; border: 1px solid {t.line}; border-left: 4px solid {t.accent};
  border-radius: 4px; }}
QFrame[role="toast"][level="warning"] {{ border-left-color: {t.warn}; }}
QFrame[role="toast"][level="error"] {{ border-left-color: {t.bad}; }}
QFrame[role="banner"] {{ background: {t.bad}; border: none; }}
QFrame[role="banner"] QLabel {{ color: {t.base}; font-weight: 600; }}
QCheckBox::indicator:unchecked, QAbstractItemView::indicator:unchecked {{ width: 12px; height: 12px;
  border: 1px solid {t.muted}; border-radius: 2px; background: {t.base}; }}
QCheckBox::indicator:unchecked:disabled {{ border-color: {t.line}; }}
QAbstractSpinBox {{ min-height: 18px; }}
QDialogButtonBox {{ dialogbuttonbox-buttons-have-icons: 0; }}
QTableView {{ gridline-color: {t.line}; }}
QHeaderView::section {{ background: {t.window}; color: {t.muted}; border: none;
  border-bottom: 1px solid {t.line}; padding: 4px 6px; }}
QPlainTextEdit#log {{ font-family: monospace; }}
"""
