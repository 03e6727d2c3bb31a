"""Evidence of the bandpass filters: which filters were found, and the efficiency of the film's orders."""

from __future__ import annotations

import numpy as np

from dsl_app.calibrate.evidence.base import Evidence, side_by_side, stacked
from dsl_app.calibrate.evidence.charts import (
    ChartBox,
    NamedCurve,
    channel_curves,
    draw_curves,
    draw_points,
)
from dsl_app.calibrate.evidence.tables import Cell, NumberTable, with_spread
from dsl_app.shared.widgets.forms import label
from dsl_app.shared.widgets.layouts import column_of
from dsl_core.calibration.orders.efficiency import STANDS_OUT
from dsl_core.model.calibration.bandpass import BandpassCalibration, FilterSample
from dsl_core.model.spectral import SpectralCurve
from dsl_core.solve.normal import BAND_95

HEADS = (
    ("Requested, nm", "Nominal centre of the requested filter"),
    ("Passes, nm", "Effective wavelength of the light that it passes"),
    ("Found, nm", "Wavelength from the positions of its first orders, with one standard deviation"),
    ("Off, nm", "Found minus passed wavelength"),
    ("Orders", "Orders of the film that stand out from the noise"),
    ("Curve", "Whether its transmission was measured, or assumed to be nominal"),
    ("Verdict", "What is wrong with the filter"),
)


class BandpassEvidence(Evidence[BandpassCalibration]):
    """A table of filters above the efficiency of first orders, the bound of second ones, and the response."""

    def __init__(self) -> None:
        super().__init__(BandpassCalibration)
        self.table = NumberTable("Filters", HEADS, words=(4, 5, 6))
        self.efficiency = ChartBox(
            "Efficiency of first orders",
            "Points are single filters, lines the fitted curves, both with 95 % bands; relative to the zero"
            " order.",
            "Of the zero order",
            "Wavelength (nm)",
        )
        self.response = ChartBox(
            "Response of the camera",
            "Relative response of each channel with its 95 % band.",
            "Response",
            "Wavelength (nm)",
        )
        self.seconds = label("", "muted", wraps=True)
        self.warnings = label("", "warn", wraps=True)
        charts = side_by_side(self.efficiency, self.response)
        charts.setContentsMargins(0, 6, 0, 0)
        column_of(
            self.warnings, (stacked(self.table, charts, (180, 260)), 1), self.seconds, on=self, margins=0
        )

    def _draw_record(self, record: BandpassCalibration) -> None:
        self.table.fill([_row(each, record.warnings) for each in record.filters])
        self.warnings.setText("\n".join(f"{_sentence(each)}." for each in record.warnings))
        self.warnings.setVisible(bool(record.warnings))
        self.efficiency.draw(lambda: self._draw_efficiency(record))
        self.response.draw(lambda: self._draw_response(record))
        self.seconds.setText(_second_orders(record))

    def _draw_response(self, record: BandpassCalibration) -> None:
        self.response.begin()
        draw_curves(self.response, channel_curves(record.response))

    def _draw_efficiency(self, record: BandpassCalibration) -> None:
        self.efficiency.begin()
        colours = {1: self._theme.pins[0], -1: self._theme.pins[1]}
        curves = [
            NamedCurve(f"order {_signed(order)}", colour, record.efficiency[order])
            for order, colour in colours.items()
        ]
        bound = NamedCurve("orders ±2, at most", self._theme.muted, _bound_of_seconds(record), dashed=True)
        draw_curves(self.efficiency, [*curves, bound])
        for order, colour in colours.items():
            samples = [
                (each.effective_nm, sample.ratio, sample.ratio_std)
                for each in record.filters
                for sample in each.orders
                if sample.order == order
            ]
            if samples:
                nm, ratio, std = np.array(samples).T
                draw_points(self.efficiency, nm, ratio, std, colour)


def _row(each: FilterSample, warnings: tuple[str, ...]) -> list[Cell]:
    own = [warning for warning in warnings if warning.startswith(f"the filter of {each.filter_nm:g} nm:")]
    found, off = "not found", ""
    if each.found_nm is not None:
        spread = "" if each.found_std_nm is None else f" ± {max(each.found_std_nm, 0.1):.1f}"
        found, off = f"{each.found_nm:.1f}{spread}", f"{each.found_nm - each.effective_nm:+.1f}"
    orders = [sample.order for sample in each.orders if sample.ratio > STANDS_OUT * sample.ratio_std]
    return [
        f"{each.filter_nm:g}",
        f"{each.effective_nm:.1f}",
        (found, "warn" if own else ""),
        (off, "warn" if own else ""),
        ", ".join(map(_signed, sorted(orders))) or "none",
        ("measured" if each.curve_measured else "nominal", "muted"),
        (_sentence(own[0].split(": ", 1)[1]), "warn") if own else ("as requested", "good"),
    ]


def _bound_of_seconds(record: BandpassCalibration) -> SpectralCurve:
    """What second orders stay below with a probability of 95 %."""
    share = record.second_order_share + BAND_95 * record.second_order_share_std
    nm = np.array(record.efficiency[1].wavelengths_nm)
    return SpectralCurve.of(nm, share * np.maximum(*(record.efficiency[order].at(nm) for order in (1, -1))))


def _second_orders(record: BandpassCalibration) -> str:
    share, std = 100 * record.second_order_share, 100 * record.second_order_share_std
    most = share + BAND_95 * std
    return (
        f"Second orders: {with_spread(share, std)} % of the first, at most {most:.2f} % (95 %)."
        f" Blur of the projector {with_spread(record.blur_px, record.blur_std_px)} px."
    )


def _signed(order: int) -> str:
    return f"{order:+d}".replace("-", "−")


def _sentence(words: str) -> str:
    return words[:1].upper() + words[1:]
