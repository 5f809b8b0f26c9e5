"""Files that a run writes, each format with its writer and its reader side by side."""
