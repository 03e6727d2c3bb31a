"""What a scan says by itself about how well its model fits."""
