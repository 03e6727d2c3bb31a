"""Where the diffraction orders are and how much light each takes."""
