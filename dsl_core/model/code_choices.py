"""Binary codes by name, as the command line and the window offer them."""

from __future__ import annotations

from dataclasses import dataclass

from dsl_core.model.plan import BinaryCode, CodeSet, EnsembleCode, GrayCode, XorCode


@dataclass(frozen=True)
class CodeChoice:
    """A binary code with its name on the command line and its title in the window."""

    name: str
    title: str
    code: BinaryCode


CODE_CHOICES: tuple[CodeChoice, ...] = (
    CodeChoice("full", "Columns and rows", GrayCode()),
    CodeChoice("columns", "Columns only", GrayCode(rows=False)),
    CodeChoice("xor-04", "Columns, XOR, 4 px", XorCode(rows=False, base_px=4)),
    CodeChoice("xor-02", "Columns, XOR, 2 px", XorCode(rows=False, base_px=2)),
    CodeChoice("ensemble-04", "Columns, Gray and XOR, 4 px", EnsembleCode(rows=False, base_px=4)),
    CodeChoice("ensemble-02", "Columns, Gray and XOR, 2 px", EnsembleCode(rows=False, base_px=2)),
    CodeChoice("full-xor-04", "Columns and rows, XOR, 4 px", XorCode(base_px=4)),
    CodeChoice("full-xor-02", "Columns and rows, XOR, 2 px", XorCode(base_px=2)),
    CodeChoice("full-ensemble-04", "Columns and rows, Gray and XOR, 4 px", EnsembleCode(base_px=4)),
    CodeChoice("full-ensemble-02", "Columns and rows, Gray and XOR, 2 px", EnsembleCode(base_px=2)),
)


def code_of(name: str) -> BinaryCode | None:
    """The code of a name; None for a name that no code has.

    >>> code_of("xor-02").base_px
    2
    """
    return next((choice.code for choice in CODE_CHOICES if choice.name == name), None)


def name_of(code: CodeSet) -> str | None:
    """The name of a code; None for no code."""
    return next((choice.name for choice in CODE_CHOICES if choice.code == code), None)
