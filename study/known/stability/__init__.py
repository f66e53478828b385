"""Where each model breaks: cases at the extremes, each held to a figure known beforehand."""
