"""How a measured line spread becomes light, and how it is found from lines at many sub-pixel places."""
