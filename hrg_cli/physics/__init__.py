"""Equations of the resonator, its read-out, drive and bench; knows NumPy alone."""
