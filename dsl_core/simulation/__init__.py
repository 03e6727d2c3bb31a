"""The digital twin: one simulated world, the devices in it, and scenes whose truth is known."""
