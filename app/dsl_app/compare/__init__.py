"""The Compare page: two results, or a series of them."""
