"""The discrete problem in the files of other codes, so that they can solve it again."""
