"""Lots: the whole chain for every gyro of a lot, shared among processes or a cluster, resumable."""
