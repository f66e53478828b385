"""The boundary-value problem that every model solves, in SI units and independent of scenes."""
