"""Networks as plain modules of torch; whoever trains them is elsewhere."""
