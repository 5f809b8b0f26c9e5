"""Pictures of whole frames with labelled boxes, that a detector of one modality learns from."""
