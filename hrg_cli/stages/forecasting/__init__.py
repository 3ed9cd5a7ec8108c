"""The parts of a forecast: the drift over the angle and the wave's way over hours."""
