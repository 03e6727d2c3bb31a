"""The 3D view of a result, drawn in a thread of its own."""
