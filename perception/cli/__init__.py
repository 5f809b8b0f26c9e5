"""One file a command, a pure function under each."""
