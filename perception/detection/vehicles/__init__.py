"""Location of detected vehicles in the scan: their points, distances and boxes."""
