"""Session restore: what was open is kept, and offered again after a crash."""
