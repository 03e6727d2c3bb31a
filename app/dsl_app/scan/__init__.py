"""The Scan page: a plan, its capture and its reconstruction."""
