"""Proposals of labels for a whole drive: what the pipeline found in each frame, joined over all of them."""
