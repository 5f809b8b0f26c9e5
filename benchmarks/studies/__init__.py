"""The thesis' own studies, below the flags of `trifuse study`."""
