"""The organ: its shape, its meshes, and places on it."""
