"""The spectrum of each pixel, by our solver and by those it is compared with."""
