"""The self-test: how camera and projector behave, measured."""
