"""What pictures of lines show, by themselves and by those next to them."""
