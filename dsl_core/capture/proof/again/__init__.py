"""What pictures that a scan captures again say beside the first ones of their kind."""
