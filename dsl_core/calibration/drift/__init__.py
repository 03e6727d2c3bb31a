"""Whether a rig is still as calibrated."""
