"""A folder of scans in any format, described by one drive.yaml, which `trifuse adopt` writes."""
