"""Diagnosis, the base model: the linear gyro fitted to all runs, before any cause."""
