"""A picture worked on by rows, so that the frames of a large one need not be in memory at once."""
