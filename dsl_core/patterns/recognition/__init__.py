"""What pictures of an unknown capture show, told from the pictures themselves."""
