"""Increments of the angle to tables over angle and temperature."""
