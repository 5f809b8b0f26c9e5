"""How the joint rescoring of three modalities is learned (6.2.4, 7.2.2)."""
