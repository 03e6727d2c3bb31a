"""The spectra of many pixels from what is measured of them, by tensors or by compiled loops."""
