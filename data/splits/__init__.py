"""Splits of labelled frames into training, validation and test, and the frames that a network learned from."""
