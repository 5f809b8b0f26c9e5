"""The detectors of whole images: anchors, targets, losses, weights of Darknet."""
