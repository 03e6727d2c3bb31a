"""What pictures of the first code show, by each other: nothing else is known yet."""
