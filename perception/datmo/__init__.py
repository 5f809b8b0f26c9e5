"""Detection and tracking of moving objects (DATMO), on segmented scans (thesis 5.2)."""
