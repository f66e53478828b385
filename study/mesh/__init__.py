"""Mesh files: read by one guarded loader, then checked, repaired or refused."""
