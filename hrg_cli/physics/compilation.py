"""Compiling functions that call one another by numba, with some of them made to stand for others.

A compiled function keeps the functions it calls inside it. So each is compiled as a copy whose
globals hold its compiled callees; what numba keeps on disk bears a fingerprint of them all, since
numba itself looks at the calling file only.
"""

from __future__ import annotations

import functools
import hashlib
from collections.abc import Callable, Container, Sequence
from types import FunctionType
from typing import Any

Function = Callable[..., Any]


def bound(function: Any, **names: Any) -> Any:
    """A copy of the function in whose globals some names stand for others.

    Parameters
    ----------
    function
        A Python function.
    **names
        What each name of its globals is to be.

    Returns
    -------
    callable
        The copy; the function itself and its module stay as they are.

    Examples
    --------
    >>> import math
    >>> from hrg_cli.physics.compilation import bound
    >>> from hrg_cli.physics.electrodes import compute_cubic_factor
    >>> bound(compute_cubic_factor, float=None) is compute_cubic_factor
    False
    """
    copy = FunctionType(function.__code__, {**function.__globals__, **names}, function.__name__)
    copy.__qualname__, copy.__module__ = function.__qualname__, function.__module__
    return copy


def compile_all(
    jit: Callable[..., Any],
    functions: Sequence[Function],
    *,
    opened: Container[str],
    **given: Any,
) -> dict[str, Any]:
    """Each function compiled by name, with what it calls by these names compiled too.

    Parameters
    ----------
    jit
        The compiler, as `numba.njit`.
    functions
        In such an order that callees come before their callers.
    opened
        Names of those that are written into their callers.
    **given
        What stands for further names.

    Returns
    -------
    dict
        name -> compiled function, `given` among them.

    Examples
    --------
    >>> from hrg_cli.physics.compilation import compile_all
    >>> from hrg_cli.physics.electrodes import compute_cubic_factor
    >>> def not_compiled(function, inline):
    ...     return function
    >>> made = compile_all(not_compiled, [compute_cubic_factor], opened=())
    >>> made["compute_cubic_factor"]("printed")
    3.0
    """
    made, mark = dict(given), fingerprint(functions)
    for function in functions:
        copy = bound(function, **made)
        copy.__qualname__ = f"{function.__qualname__}_{mark}"
        name = function.__name__
        made[name] = jit(copy, inline="always" if name in opened else "never")
    return made


def fingerprint(functions: Sequence[Function]) -> str:
    """Digest of the functions' code, of the numbers they take from their modules and of what their
    arguments are.

    What numba keeps on disk names the arguments' classes, and is not read where one is gone.

    Parameters
    ----------
    functions
        Python functions.

    Returns
    -------
    str
        Twelve hexadecimal digits, other ones after any change.

    Examples
    --------
    >>> from hrg_cli.physics.compilation import fingerprint
    >>> from hrg_cli.physics.electrodes import compute_cubic_factor, pick_off
    >>> fingerprint([compute_cubic_factor]) == fingerprint([compute_cubic_factor, pick_off])
    False
    """
    return hashlib.sha256(repr([_content(f) for f in functions]).encode()).hexdigest()[:12]


@functools.lru_cache(maxsize=64)
def _content(function: Any) -> tuple[Any, ...]:
    code = function.__code__
    numbers = [
        value
        for name in code.co_names
        if isinstance(value := function.__globals__.get(name), (int, float))
    ]
    kinds = [function.__globals__.get(kind, kind) for kind in function.__annotations__.values()]
    return code.co_code, code.co_consts, code.co_names, numbers, kinds
