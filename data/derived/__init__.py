"""Labels computed from labels: which objects move."""
