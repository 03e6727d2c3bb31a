"""Response, emission, white level, blur and halo."""
