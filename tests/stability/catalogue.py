"""Every hard case, in the order of the table."""

from __future__ import annotations

from tests.stability import decode_cases, depth_cases, fit_cases, scan_cases, solver_cases
from tests.stability.case import Case

PARTS: dict[str, tuple[Case, ...]] = {
    "whole scans": scan_cases.CASES,
    "solvers": solver_cases.CASES,
    "binary code": decode_cases.CASES,
    "columns and depth": depth_cases.CASES,
    "calibration fits": fit_cases.CASES,
}
