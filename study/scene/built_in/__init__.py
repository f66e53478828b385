"""The scenes that come with the program."""
