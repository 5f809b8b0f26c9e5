"""Arrays in, named metrics out."""
