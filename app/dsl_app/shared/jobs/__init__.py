"""Long work outside the window's thread, with progress and cancel."""
