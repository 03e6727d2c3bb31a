"""The Results page: images, spectra and export of a result."""
