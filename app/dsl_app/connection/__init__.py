"""The connected rig, for every slice that measures with it."""
