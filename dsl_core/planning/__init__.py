"""What accuracy costs in time: predicted from the model, measured on the twin, and answered with a plan."""
