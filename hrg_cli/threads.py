"""Threads of the numerical libraries: one, unless the user says otherwise.

The matrices here are thousands of rows by tens of columns: a second thread takes half as much
processor time again, and where other programs run waits for them at every product.
"""

import os

NAMES = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
"""What the libraries read when they are loaded."""


def use_one() -> None:
    """One thread for what is loaded from here on, where the environment does not say.

    Examples
    --------
    >>> import os
    >>> from hrg_cli.threads import NAMES, use_one
    >>> use_one()
    >>> all(name in os.environ for name in NAMES)
    True
    """
    for name in NAMES:
        os.environ.setdefault(name, "1")
