"""Looking for a spectrum in the whole picture."""
