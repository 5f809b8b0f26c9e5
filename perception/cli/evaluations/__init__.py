"""The measures of `trifuse evaluate`, one file a command and one for its figures."""
