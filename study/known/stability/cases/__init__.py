"""The cases, one family per module: `cases()` lists them, the functions beside it run them."""
