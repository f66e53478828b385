"""The cases, one family per module: `cases()` lists them, the module's other functions run them."""
