"""Cases with known answers: verification and stability."""
