"""Stages of a run: what each depends on, kept on disk once computed, and run side by side."""
