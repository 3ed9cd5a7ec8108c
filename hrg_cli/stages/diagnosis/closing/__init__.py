"""Diagnosis, the end: what the final result must pass before it may be called what it is."""
