"""What the effects that are linear in temperature or time have in common: a bend, and a split that
moves."""

from __future__ import annotations

from ..physics.resonator import split_matrix
from .effect import Array, Parameter, Values


def make_bend(name: str, units: str, typical: float, meaning: str) -> Parameter:
    """The parameter of a law's bend, which is fitted where the runs ask for it.

    Parameters
    ----------
    name, units, typical, meaning
        As of `Parameter`.

    Returns
    -------
    Parameter
        Of higher order, held by every fit that does not free it.

    Examples
    --------
    >>> from hrg_cli.effects.bent_laws import make_bend
    >>> bend = make_bend("bend_1_s3", "s-3", 1e-4, "bend of ν per second squared")
    >>> bend.fitted, bend.higher_order
    (False, True)
    """
    return Parameter(name, units, typical, meaning, fitted=False, higher_order=True)


def read_split(p: Values, names: tuple[str, str]) -> Array:
    """The matrix of a split whose components are two of an effect's parameters.

    Parameters
    ----------
    p
        Values of the effect's parameters; 0 where they are not named.
    names
        Of the cosine and the sine.

    Returns
    -------
    ndarray
        (2, 2), c R(0) + s R(π/2).

    Examples
    --------
    >>> from hrg_cli.effects.bent_laws import read_split
    >>> read_split({"cos": 1.0}, ("cos", "sin")).tolist()
    [[1.0, 0.0], [0.0, -1.0]]
    """
    return split_matrix(p.get(names[0], 0.0), p.get(names[1], 0.0))
