"""What all cameras of the GenICam standard share, whichever library reaches them."""
