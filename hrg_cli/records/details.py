"""Numbers deep in the JSON texts that records carry."""

from __future__ import annotations

import json
from typing import Any

import numpy as np

from ..errors import HrgError


def read_details_number(text: str, *keys: str, default: float) -> float:
    """A number deep in a record's JSON text, `default` where it is not there. HrgError: something
    else stands in its place."""
    tree: Any = json.loads(text or "{}")
    for key in keys:
        if not isinstance(tree, dict):
            break
        tree = tree.get(key, default if key == keys[-1] else {})
    if isinstance(tree, int | float) and not isinstance(tree, bool) and np.isfinite(tree):
        return float(tree)
    raise HrgError(f"the details are damaged ({'.'.join(keys)} is no number); make the file again")
