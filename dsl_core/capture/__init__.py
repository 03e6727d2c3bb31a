"""Doing a plan with the devices of a rig."""
