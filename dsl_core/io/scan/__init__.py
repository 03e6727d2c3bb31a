"""Scans on disk: frames, log and manifest."""
