"""The commands of `trifuse train`."""
