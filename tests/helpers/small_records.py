"""A small record of any kind, made from its own declarations."""

import numpy as np

from hrg_cli.records import Calibration, Provenance, Recording, Source


def small(kind, rows=7):
    """A record of any kind with every column filled, made from its own declarations."""
    rng = np.random.default_rng(3)
    sizes = {
        "row": rows,
        "signal": 4,
        "channel": 2,
        "auxiliary_row": 5,
        "truth_row": 4,
        "parameter": 3,
        "parameter_2": 3,
        "coefficient": 3 * (3 + 3),
        "coefficient_2": 3 * (3 + 3),
    }
    values = {}
    for name, spec in kind.columns().items():
        if spec.dims is None:
            text = {"object": "{}", "list": "[]"}.get(
                spec.valid.json, next(iter(spec.valid.one_of), "text")
            )
            number = min(5000.0, spec.valid.at_most or 5000.0)
            values[name] = {"i8": 2, "f8": number}.get(spec.dtype, text)
            continue
        shape = tuple(sizes.get(d, 3) for d in spec.dims)
        if spec.dtype == "str":
            values[name] = np.array([f"n{i}" for i in range(shape[0])], dtype=object)
        elif spec.dtype == "raw":
            values[name] = rng.integers(-100, 100, shape).astype("i2")
        else:
            values[name] = np.sort(
                rng.uniform(1, min(50, spec.valid.at_most or 50), shape), axis=0
            ).astype(spec.dtype)
            if name == "covariance" and shape[0] == shape[1]:
                values[name] = values[name] @ values[name].T  # else it is none, and is not written
    if kind is Recording:
        values |= {"time_s": None, "c_units": "V", "s_units": "V"}
    if kind is Calibration:
        values |= {"frequency_hz": None}
    return kind(
        **values,
        provenance=Provenance(
            history=("then hrg made it",), sources=(Source("a", "b", "c"),), settings="[x]\n"
        ),
    )
