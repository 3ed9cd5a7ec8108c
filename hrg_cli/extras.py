"""The optional packages: which extra brings each, what is said where one is missing."""

from __future__ import annotations

import warnings
from importlib.util import find_spec

EXTRAS = {
    "numba": "fast",
    "matplotlib": "report",
    "jinja2": "report",
    "markupsafe": "report",
    "nptdms": "labs",
    "pyarrow": "labs",
    "openpyxl": "labs",
    "dask": "lots",
    "distributed": "lots",
    "xarray": "notebook",
    "h5netcdf": "notebook",
    "uncertainties": "notebook",
    "cryptography": "signing",
}
"""Package -> the extra of `pip install 'hrg-cli[EXTRA]'` that brings it."""


def _list_missing(extra: str) -> list[str]:
    """The packages of an extra that are not installed."""
    return [name for name, of in EXTRAS.items() if of == extra and not _is_there(name)]


def find_optional(error: Exception) -> str | None:
    """The optional package that an error says is not installed.

    Parameters
    ----------
    error
        Any.

    Returns
    -------
    str or None
        None of other errors, and of packages that no extra brings.

    Examples
    --------
    >>> from hrg_cli.extras import find_optional
    >>> find_optional(ModuleNotFoundError("no", name="pyarrow.lib")), find_optional(ValueError())
    ('pyarrow', None)
    """
    package = (getattr(error, "name", None) or "").split(".")[0]
    return package if isinstance(error, ModuleNotFoundError) and package in EXTRAS else None


def tell_how_to_install(package: str) -> str:
    """What is missing and the command that brings it.

    Parameters
    ----------
    package
        One that an extra brings.

    Returns
    -------
    str
        The end of a sentence.

    Examples
    --------
    >>> from hrg_cli.extras import tell_how_to_install
    >>> print("reading it needs", tell_how_to_install("pyarrow"))
    reading it needs pyarrow, which is not installed; run pip install 'hrg-cli[labs]'
    """
    return (
        f"{package}, which is not installed; run pip install 'hrg-cli[{EXTRAS[package.lower()]}]'"
    )


def tell_lack_of_pages() -> str | None:
    """Why no page can be made; None where it can.

    Returns
    -------
    str or None
        A sentence.

    Examples
    --------
    >>> from hrg_cli.extras import tell_lack_of_pages
    >>> tell_lack_of_pages()  # of an installation with the extra `report`
    """
    gone = _list_missing("report")
    return f"pages and figures need {tell_how_to_install(gone[0])}" if gone else None


class PlainPythonWarning(UserWarning):
    """A simulation that takes long for want of a compiler."""


def warn_of_plain_python() -> None:
    """Warn, without a compiler, that what is simulated now takes long.

    Examples
    --------
    >>> from hrg_cli.extras import warn_of_plain_python
    >>> warn_of_plain_python()  # silent where there is one
    """
    if gone := _list_missing("fast"):
        said = "simulating in plain Python, some hundred times as slow as with"
        warnings.warn(PlainPythonWarning(f"{said} {tell_how_to_install(gone[0])}"), stacklevel=3)


def _is_there(package: str) -> bool:
    try:
        return find_spec(package) is not None
    except (ValueError, ModuleNotFoundError):  # a name that is held back
        return False
