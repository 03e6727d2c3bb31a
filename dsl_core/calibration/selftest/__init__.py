"""What a camera and a projector really do, measured."""
