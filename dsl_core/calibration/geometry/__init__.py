"""Lenses and pose of camera and projector."""
