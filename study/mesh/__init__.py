"""Mesh files: read them through one guarded loader, check them, repair them or refuse them."""
