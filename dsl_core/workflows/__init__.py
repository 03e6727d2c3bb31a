"""What callers do with scans on disk; each function combines stages of the pipeline."""
