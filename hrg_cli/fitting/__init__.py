"""Estimation: what is fitted to signals, envelopes and tables; knows arrays, no files."""
