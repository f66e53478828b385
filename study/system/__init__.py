"""What the program needs of the operating system: signals, streams, files, locks, and progress."""
