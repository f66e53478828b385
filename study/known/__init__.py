"""Cases whose answers are known beforehand: verification and stability."""
