"""What every way of identifying ends in, filled in step by step before it becomes a record."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ...fitting.checks import Check
from ...fitting.envelopes.likelihood import Fit

Array = np.ndarray


@dataclass
class Verdict:
    """Parameters by name, their covariance in `order`, and every sentence about them."""

    values: dict[str, float]
    std: dict[str, float]
    order: list[str]
    covariance: Array
    chi2_per_dof: float
    condition: float
    run_chi2_per_dof: Array
    run_residual_rms: Array
    run_rows: Array
    flat: list[str] = field(default_factory=list)
    suspect: list[str] = field(default_factory=list)
    refused: list[str] = field(default_factory=list)
    details: dict[str, Any] = field(default_factory=dict)
    mode_number: int = 2
    fit: Fit | None = None
    checks: list[Check] = field(default_factory=list)
