"""Limits of each model: cases at the extremes, each compared with a figure known beforehand."""
