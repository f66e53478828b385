"""The problem that every model solves, in SI units; it knows no scene."""
