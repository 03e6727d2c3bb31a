"""How the twin computes a frame."""
