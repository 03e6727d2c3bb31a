"""How one picture is judged: by what is known so far, its rivals, and the rules that decide between them."""
