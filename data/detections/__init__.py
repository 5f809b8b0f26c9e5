"""What detectors see in labelled frames, kept: what their fusion learns from and is judged by."""
