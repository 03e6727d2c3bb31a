"""What the twin looks at, with its true shape and reflectance."""
