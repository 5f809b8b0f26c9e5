"""How well one object is followed: arrays in, named results out."""
