"""Scans and results in an object store, with addresses like ``s3://bucket/folder/NAME.dsl``."""
