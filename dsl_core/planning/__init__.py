"""What accuracy costs in time: predicted from the model, and answered with a plan."""
