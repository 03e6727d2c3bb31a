"""From captures of targets to the parameters of a rig."""
