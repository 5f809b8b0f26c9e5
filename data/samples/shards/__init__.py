"""Training samples in tar files that are read in order, from a folder of this machine or an object store."""
