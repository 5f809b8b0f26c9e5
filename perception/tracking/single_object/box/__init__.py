"""The default tracker of one object: a box fitted to its returns."""
