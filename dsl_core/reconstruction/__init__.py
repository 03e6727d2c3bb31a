"""From frames to depth, surface and spectra."""
