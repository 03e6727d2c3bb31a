"""Whether a picture shows the pattern that was asked for."""
