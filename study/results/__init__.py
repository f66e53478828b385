"""What a study found, on disk and in memory."""
