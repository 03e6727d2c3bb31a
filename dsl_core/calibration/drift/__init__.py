"""Whether a rig still is as calibrated."""
