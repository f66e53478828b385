"""Export of the discrete problem to the input files of other codes."""
