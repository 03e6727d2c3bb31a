"""One file for each format of spectra; `dsl_core.io.spectra.catalogue` lists them."""
