"""What each page decides, without Qt."""
