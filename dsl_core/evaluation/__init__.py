"""Results against truth: depth, spectra, honesty of the uncertainties, cost, and a report of it all."""
