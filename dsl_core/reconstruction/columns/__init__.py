"""The projector column that lights each pixel, and its deviation."""
