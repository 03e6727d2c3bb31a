"""What was measured of a projector's light, without assuming its form."""
