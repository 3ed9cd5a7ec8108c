"""Diagnosis, the samples: lines, tones, jumps and clipping, seen before any dynamics."""
