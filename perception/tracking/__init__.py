"""Objects followed over time."""
