"""What follows from labels, and from the thesis about them: what moves, and whom it follows through which frames."""
