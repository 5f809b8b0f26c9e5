"""Many drives at once, by Dask: one task a drive, done once, whatever dies meanwhile."""
