"""A reconstruction that is to be done again: of which scan, with which parameters, and what it makes."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from dsl_app.shared.evented import Event, Value

#: Key of the calibration that a scan holds itself.
OWN = ""


@dataclass(frozen=True)
class AgainSource:
    """The scan, as far as the choices depend on it.

    ``calibration`` names the scan's own (empty: it has none), ``library`` those of this computer. ``before``
    is the result to compare with, if any; ``took_s`` is what that took (0: not known).
    """

    session: Path
    size_px: tuple[int, int]
    calibration: str = ""
    library: tuple[str, ...] = ()
    has_cuda: bool = False
    before: Path | None = None
    took_s: float = 0.0


@dataclass(frozen=True)
class AgainOrder:
    """What to do; ``calibration`` is `OWN`, a name of the library or the path of a file."""

    name: str
    start_nm: float = 430.0
    stop_nm: float = 660.0
    step_nm: float = 5.0
    spectra: bool = True
    model: str = "auto"
    solver: str = "best"
    refine: bool = True
    calibration: str = OWN
    override: bool = False
    device: str = "cpu"
    replace: bool = False


@dataclass(frozen=True)
class AgainDone:
    """The new result, and the one to compare it with, if any."""

    result: Path
    before: Path | None


class AgainState:
    """Values that the controller sets and the dialog follows.

    ``trouble`` is why the order cannot be carried out (empty: it can), ``cost`` what it makes and takes.
    ``ready`` fires when a scan was looked at, ``done`` with each new result.
    """

    def __init__(self) -> None:
        self.source: Value[AgainSource | None] = Value(None)
        self.order = Value(AgainOrder(""))
        self.trouble = Value("")
        self.cost = Value("")
        self.ready: Event[AgainSource] = Event()
        self.done: Event[AgainDone] = Event()
