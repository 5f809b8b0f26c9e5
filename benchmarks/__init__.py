"""Every stage beside its reference implementation and the best library; run by `trifuse bench`."""
