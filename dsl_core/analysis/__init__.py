"""First answers from a result: libraries of spectra, class maps, colours, transformed spectra, a report."""
