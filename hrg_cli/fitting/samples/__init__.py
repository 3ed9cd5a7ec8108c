"""Samples to rows of signals: what demodulation is made of."""
