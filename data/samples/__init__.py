"""Training samples from labelled drives: cached frames, datasets and Lightning data modules."""
