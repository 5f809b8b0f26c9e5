"""Training of the bird's-eye-view detector."""
