"""Live: sources that do not wait, and the server that shows the results."""
