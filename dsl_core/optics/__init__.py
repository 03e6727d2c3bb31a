"""The physics as pure functions."""
