"""A scene for other programs: its finite elements for other codes, its lattices for a user."""
