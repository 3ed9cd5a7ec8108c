"""Numbers deep in the JSON texts that records carry."""

from __future__ import annotations

import json
from typing import Any

import numpy as np

from ..errors import HrgError


def read_details_number(text: str, *keys: str, default: float) -> float:
    """A number deep in the JSON text that a record carries.

    Parameters
    ----------
    text
        A JSON object; "" for none.
    *keys
        The way to it, from the outermost key on.
    default
        What stands for a number that is not there.

    Returns
    -------
    float
        Finite.

    Raises
    ------
    HrgError
        Something else stands in its place.

    Examples
    --------
    >>> from hrg_cli.records.details import read_details_number
    >>> text = '{"noise": {"white_rad": 1e-6}}'
    >>> read_details_number(text, "noise", "white_rad", default=0.0)
    1e-06
    >>> read_details_number(text, "noise", "walk_rad", default=0.0)
    0.0
    """
    tree: Any = json.loads(text or "{}")
    for key in keys:
        if not isinstance(tree, dict):
            break
        tree = tree.get(key, default if key == keys[-1] else {})
    if isinstance(tree, int | float) and not isinstance(tree, bool) and np.isfinite(tree):
        return float(tree)
    raise HrgError(f"the details are damaged ({'.'.join(keys)} is no number); make the file again")
