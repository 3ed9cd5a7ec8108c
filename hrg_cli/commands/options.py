"""Options of a command made from the signature of its stage, where type, bounds, meaning and
default of every setting already stand."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from types import UnionType
from typing import Annotated, Any, Literal, Union, get_args, get_origin, get_type_hints

import typer


def make_flags(
    stage: Callable[..., Any], *names: str, prefix: str = "", **renamed: str
) -> list[inspect.Parameter]:
    """Options for settings of a stage: those named, and those that the command calls otherwise.

    An option that is not given is None, so that files and --set keep their say; choices, bounds and
    defaults are the stage's.

    Parameters
    ----------
    stage
        Its function, whose parameters have descriptions.
    *names
        Of the settings.
    prefix
        Put before every help.
    **renamed
        Setting -> what its option is called.

    Returns
    -------
    list of Parameter
        Of a signature, with keywords only.

    Examples
    --------
    >>> from typing import get_args
    >>> from hrg_cli import identify
    >>> from hrg_cli.commands.options import make_flags
    >>> (option,) = make_flags(identify, "bootstrap")
    >>> option.name, get_args(option.annotation)[1].help
    ('bootstrap', 'Block-bootstrap draws for the errors, 0: none (default 0).')
    """
    hints = get_type_hints(stage, include_extras=True)
    defaults = inspect.signature(stage).parameters
    return [
        _option(option, hints[setting], defaults[setting].default, prefix)
        for setting, option in [*((name, name) for name in names), *renamed.items()]
    ]


def _option(name: str, hint: Any, default: Any, prefix: str) -> inspect.Parameter:
    kind, *notes = get_args(hint) if get_origin(hint) is Annotated else (hint,)
    meaning = next((n.description for n in notes if getattr(n, "description", None)), "")
    if not meaning:
        raise TypeError(f"the setting {name} has no description, which its option would show")
    flag = f"--{name.replace('_', '-')}"
    accepted, more = _accepted(kind)
    option = typer.Option(
        flag, help=_sentence(prefix, meaning, default), show_default=False, **more
    )
    return inspect.Parameter(
        name,
        inspect.Parameter.KEYWORD_ONLY,
        annotation=Annotated[accepted | None, option],
        default=None,
    )


def _accepted(kind: Any) -> tuple[Any, dict[str, Any]]:
    """The type that an option of a setting takes, and how its text is read where typer cannot."""
    of_union = get_origin(kind) in (Union, UnionType)
    kinds = [k for k in (get_args(kind) if of_union else (kind,)) if k is not type(None)]
    if set(kinds) == {str, int}:
        return str, {"parser": parse_column, "metavar": "COLUMN"}
    [only] = kinds
    if only == list[float]:
        return str, {"parser": parse_numbers, "metavar": "NUMBER,..."}
    if only == list[str]:
        return str, {"parser": parse_words, "metavar": "NAME,..."}
    if only in (str, int, float, bool) or get_origin(only) is Literal:
        return only, {}
    raise TypeError(f"no option can be made of {kind}")


def _sentence(prefix: str, meaning: str, default: Any) -> str:
    text = f"{prefix}{meaning}" if prefix else meaning[:1].upper() + meaning[1:]
    usual = isinstance(default, str | int | float) and not isinstance(default, bool)
    shown = f" (default {default:g})" if usual and not isinstance(default, str) else ""
    if isinstance(default, str) and default:
        shown = f" (default {default})"
    return f"{text}{shown}."


def parse_column(text: str) -> str | int:
    """A column's title, or its number.

    Parameters
    ----------
    text
        As typed.

    Returns
    -------
    str or int
        The number where the text is one.

    Examples
    --------
    >>> from hrg_cli.commands.options import parse_column
    >>> parse_column("3"), parse_column("T")
    (3, 'T')
    """
    return int(text) if text.isdigit() else text


def parse_numbers(text: str) -> list[float]:
    """Numbers joined by commas.

    Parameters
    ----------
    text
        As typed.

    Returns
    -------
    list of float
        In its order.

    Raises
    ------
    BadParameter
        Of typer: a part is no number.

    Examples
    --------
    >>> from hrg_cli.commands.options import parse_numbers
    >>> parse_numbers("-20,0,20")
    [-20.0, 0.0, 20.0]
    """
    try:
        return [float(part) for part in text.split(",")]
    except ValueError:
        raise typer.BadParameter(
            f"{text!r}: numbers joined by commas were expected, for instance -20,0,20,40,60"
        ) from None


def parse_words(text: str) -> list[str]:
    """Names joined by commas.

    Parameters
    ----------
    text
        As typed.

    Returns
    -------
    list of str
        Without empty ones.

    Examples
    --------
    >>> from hrg_cli.commands.options import parse_words
    >>> parse_words("gain_mismatch, clock_error,")
    ['gain_mismatch', 'clock_error']
    """
    return [part.strip() for part in text.split(",") if part.strip()]
