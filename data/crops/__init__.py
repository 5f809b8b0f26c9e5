"""What the verifier of proposals is trained on: windows of labelled frames, changed a little at every look."""
