"""Training data of the image detectors: images or maps of whole frames with labelled boxes."""
