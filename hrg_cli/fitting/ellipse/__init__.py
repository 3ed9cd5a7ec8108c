"""Signals to the ellipse of the wave, and its errors."""
