"""Cached detections in labelled frames, on which the fusion is trained and evaluated."""
