"""Import of pictures of any structured-light program, by a mapping that is guessed and corrected."""
