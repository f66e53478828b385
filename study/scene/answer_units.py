"""Units in which a fuzzy system of one's own may answer, in Pa."""

UNITS = {"Pa": 1.0, "kPa": 1e3}
