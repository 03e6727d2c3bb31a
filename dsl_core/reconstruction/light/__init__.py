"""The light of each shot of a scan, as the frames themselves tell it."""
