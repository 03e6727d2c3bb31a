"""What some pixels, looked at closely, say about the model and about the frames."""
