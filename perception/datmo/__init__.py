"""Detection and tracking of moving objects: from a segmented scan to things that move."""
