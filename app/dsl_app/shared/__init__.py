"""What several slices need: evented values, file kinds, settings, theme."""
