"""Networks as plain torch modules, independent of their training."""
