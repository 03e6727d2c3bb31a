"""The page of the first minute: look at a finished scan, try the simulated rig, connect one's own."""
