"""The 3D view of a result, rendered in its own thread."""
