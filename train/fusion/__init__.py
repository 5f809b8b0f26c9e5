"""Training of the joint rescoring of three modalities (6.2.4, 7.2.2)."""
