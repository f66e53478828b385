"""Units in which a user's fuzzy system may answer, in Pa."""

UNITS = {"Pa": 1.0, "kPa": 1e3}
