"""Factors of the normal distribution that turn one measure of scatter into another."""

from __future__ import annotations

from math import pi, sqrt
from statistics import NormalDist

#: Half the width of a 95 % band, in standard deviations.
BAND_95 = NormalDist().inv_cdf(0.975)
#: Standard deviation of normal values over the median of their sizes.
STD_OF_MEDIAN_SIZE = 1 / NormalDist().inv_cdf(0.75)
#: Standard deviation of the median of many normal values over that of their mean.
MEDIAN_OVER_MEAN_STD = sqrt(pi / 2)
