"""The self-test, step by step."""
