"""Arrays in, named figures out."""
