"""Every stage beside its plain form and the best library for it; run by `trifuse bench`."""
