"""Diagnosis, the extended model: written as a simulation, simulated, held against the runs."""
