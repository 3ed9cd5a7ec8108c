"""Envelopes of runs to the resonator: likelihood, linear methods, inference."""
