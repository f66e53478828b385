"""Stages of a run: their keys, the store of their results, and the pool that runs them."""
