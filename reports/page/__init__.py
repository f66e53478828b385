"""report.html: one page to look at, turn and share, which asks no network for anything."""
