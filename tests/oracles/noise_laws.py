"""What a noise of known density must show, for tests."""

import numpy as np


def flicker_bias(density2_at_1_hz: float) -> float:
    """Bias instability B of a rate with one-sided density h/f: B = √(πh)   (IEEE Std 952: two-sided, S = B²/2πf)."""
    return float(np.sqrt(np.pi * density2_at_1_hz))
