"""Detectors of the three modalities: input image, network, detections (6.2.2, 6.2.3)."""
