"""Settings of a stage: defaults stand in its signature alone; a TOML file, `--set` and flags change
them; all are checked.

A stage function declares each setting as a keyword with an annotated type, e.g.
`periods_per_window: Annotated[float, Field(gt=0, description="...")] = 1.0`.
"""

from __future__ import annotations

import functools
import inspect
import re
import tomllib
import typing
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

from .errors import HrgError, UsageError, name_some


@functools.cache
def make_model(stage: Callable[..., Any]) -> Any:
    """The pydantic model of a stage's keyword-only settings: strict, frozen, no unknown key, no
    NaN.

    Parameters
    ----------
    stage
        A function whose settings are annotated.

    Returns
    -------
    type
        Made once for each stage.

    Examples
    --------
    >>> from hrg_cli.settings import make_model
    >>> def wait(*, seconds: float = 1.0): ...
    >>> make_model(wait)(seconds=2).seconds
    2.0
    """
    from pydantic import ConfigDict, create_model

    hints = typing.get_type_hints(stage, include_extras=True)
    fields: dict[str, Any] = {
        name: (hints[name], ... if parameter.default is parameter.empty else parameter.default)
        for name, parameter in inspect.signature(stage).parameters.items()
        if parameter.kind is inspect.Parameter.KEYWORD_ONLY
    }
    config = ConfigDict(
        extra="forbid", frozen=True, allow_inf_nan=False, arbitrary_types_allowed=True
    )
    return create_model(f"{stage.__name__} settings", __config__=config, **fields)


MOST_KEYS = 100_000
"""Keys, tables and lists of a settings file."""
MOST_NAMES = 100
"""Names that dots join in one key: the parser keeps every beginning of it, which takes memory with
the square of their number."""
_LONG_KEY = re.compile(
    r"""(?<![\w.-])(?:(?:[\w-]++|"[^"\n]*+"|'[^'\n]*+')[ \t]*+\.[ \t]*+)"""
    f"{{{MOST_NAMES}}}"
)
MOST_TOLD = 3
"""Wrong keys that one sentence names."""


def load_toml(path: Path | str) -> dict[str, Any]:
    r"""A TOML file as a dictionary.

    Parameters
    ----------
    path
        Of at most 16 MB.

    Returns
    -------
    dict
        Tables within tables.

    Raises
    ------
    HrgError
        It is missing, too long, not text, or not TOML.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> from hrg_cli.settings import load_toml
    >>> with TemporaryDirectory() as folder:
    ...     file = Path(folder) / "chain.toml"
    ...     _ = file.write_text("[estimate]\ntolerance = 1e-8")
    ...     load_toml(file)
    {'estimate': {'tolerance': 1e-08}}
    """
    path = Path(path)
    if not path.exists():
        raise HrgError(f"{path}: no such file; name a TOML file")
    if not path.is_file() and not path.is_dir():  # it may have no end, or nobody who writes it
        raise HrgError(f"{path}: is a device, pipe or socket; name a TOML file")
    try:
        if path.stat().st_size > 16 << 20:
            raise HrgError(
                f"{path}: has {path.stat().st_size} bytes, a settings file of at most 16 MB was"
                " expected"
            )
        text = path.read_text(encoding="utf-8")
        _need_few_keys(text, str(path))
        tree = tomllib.loads(text)
        _need_usual_numbers(tree, str(path))
        return tree
    except UnicodeDecodeError as error:
        raise HrgError(f"{path}: is not a text file, a TOML file was expected") from error
    except tomllib.TOMLDecodeError as error:
        raise HrgError(f"{path}: is not TOML ({str(error)[:200]}); correct it") from error
    except ValueError as error:  # Python's: a number of thousands of digits
        raise HrgError(
            f"{path}: is not TOML that can be used (an integer of thousands of digits); correct it"
        ) from error
    except RecursionError as error:
        raise HrgError(f"{path}: is not TOML (nested too deeply); correct it") from error
    except OSError as error:
        raise HrgError(f"{path}: cannot be read ({error.strerror}); name a TOML file") from error


def _need_few_keys(text: str, where: str) -> None:
    """HrgError where a text has more keys, tables and lists than a settings file needs: counted by
    their signs before it is parsed, which takes some 0.1 ms and 1 kB for each of them."""
    count = sum(map(text.count, "=[{"))
    if count > MOST_KEYS:
        raise HrgError(
            f"{where}: has {count} keys, tables and lists (signs =, [ and {{), a settings file"
            f" of at most {MOST_KEYS} was expected; divide it"
        )
    long_lines = (line for line in text.splitlines() if line.count(".") >= MOST_NAMES)
    if long := next(filter(None, map(_LONG_KEY.search, long_lines)), None):
        raise HrgError(
            f"{where}: the key {long[0][:40]}… joins more than {MOST_NAMES} names by dots;"
            " shorten it"
        )


def parse_toml(text: str) -> dict[str, Any]:
    r"""A TOML text as a dictionary: the settings that a record keeps.

    Parameters
    ----------
    text
        The whole of it.

    Returns
    -------
    dict
        Tables within tables.

    Raises
    ------
    HrgError
        It is no TOML.

    Examples
    --------
    >>> from hrg_cli.settings import parse_toml
    >>> parse_toml("[estimate]\ntolerance = 1e-8")
    {'estimate': {'tolerance': 1e-08}}
    """
    try:
        _need_few_keys(text, "the text")
        tree = tomllib.loads(text)
        _need_usual_numbers(tree, "the text")
        return tree
    except (ValueError, RecursionError, HrgError) as error:
        raise HrgError("its settings or its model, kept as TOML, are damaged") from error


def flatten(tree: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """Nested tables as one table of dotted keys.

    Parameters
    ----------
    tree
        Tables within tables.
    prefix
        Before every key, with its dot.

    Returns
    -------
    dict
        Dotted key -> value; a list is a value.

    Examples
    --------
    >>> from hrg_cli.settings import flatten
    >>> flatten({"estimate": {"tolerance": 1e-8}, "jobs": 2})
    {'estimate.tolerance': 1e-08, 'jobs': 2}
    """
    out: dict[str, Any] = {}
    for key, value in tree.items():
        out |= (
            flatten(value, f"{prefix}{key}.")
            if isinstance(value, Mapping)
            else {f"{prefix}{key}": value}
        )
    return out


LARGEST_INTEGER = 2**63
"""TOML's integers have 64 bits."""


def list_leaves(tree: Any, key: str = "") -> Iterator[tuple[str, Any]]:
    """Every value of nested tables and lists with its dotted key.

    Parameters
    ----------
    tree
        Tables and lists within one another, or one value.
    key
        Its own.

    Returns
    -------
    iterator of tuple
        Dotted key and value; a list's places count from 0.

    Examples
    --------
    >>> from hrg_cli.settings import list_leaves
    >>> list(list_leaves({"run": [{"rate_rad_s": 0.1}, {"rate_rad_s": 0.2}]}))
    [('run.0.rate_rad_s', 0.1), ('run.1.rate_rad_s', 0.2)]
    """
    if isinstance(tree, Mapping | list):
        pairs = tree.items() if isinstance(tree, Mapping) else enumerate(tree)
        for name, value in pairs:
            yield from list_leaves(value, f"{key}.{name}" if key else str(name))
    else:
        yield key, tree


def _need_usual_numbers(tree: Any, where: str, key: str = "") -> None:
    """HrgError (as a sentence) where a whole number is beyond TOML's range, or a text holds a zero
    byte."""
    for place, value in list_leaves(tree, key):
        if isinstance(value, int) and not -LARGEST_INTEGER <= value < LARGEST_INTEGER:
            raise HrgError(
                f"{where}: {place[:80]} is a whole number of more than 64 bits; write a smaller"
                " one, or one with a decimal point"
            )
        if isinstance(value, str) and "\0" in value:
            raise HrgError(f"{where}: {place[:80]} holds a zero byte; correct it")


def parse_assignment(text: str) -> tuple[str, Any]:
    """`key=value` of --set; the value is TOML, or text where it is not.

    Parameters
    ----------
    text
        As it was typed.

    Returns
    -------
    tuple
        The dotted key, and the value.

    Raises
    ------
    UsageError
        There is no key, or the value is nested too deeply.

    Examples
    --------
    >>> from hrg_cli.settings import parse_assignment
    >>> parse_assignment("estimate.tolerance=1e-8")
    ('estimate.tolerance', 1e-08)
    >>> parse_assignment("model=table")
    ('model', 'table')
    """
    key, equals, value = text.partition("=")
    if not equals or not key.strip():
        raise UsageError(f"--set {text}: key=value was expected, e.g. --set periods_per_window=4")
    try:
        parsed = tomllib.loads(f"value = {value}")["value"]
    except tomllib.TOMLDecodeError:
        return key.strip(), value.strip()
    except (
        ValueError,
        RecursionError,
    ) as error:  # a number of thousands of digits, or brackets as deep
        raise UsageError(
            f"--set {text[:60]}…: {str(error)[:100] or 'is nested too deeply'}"
        ) from error
    try:
        _need_usual_numbers(parsed, "--set", key.strip())
    except HrgError as error:
        raise UsageError(str(error)) from None
    return key.strip(), parsed


def assign(tree: dict[str, Any], key: str, value: Any) -> None:
    """Set a dotted key of nested tables.

    Parameters
    ----------
    tree
        Changed in place.
    key
        A number in it addresses an element of an array of tables.
    value
        Of the key.

    Raises
    ------
    UsageError
        An element that there is not, or a value where a table was expected.

    Examples
    --------
    >>> from hrg_cli.settings import assign
    >>> tree = {"run": [{"rate_rad_s": 0.1}]}
    >>> assign(tree, "run.0.rate_rad_s", 0.2)
    >>> assign(tree, "resonator.quality", 1e6)
    >>> tree
    {'run': [{'rate_rad_s': 0.2}], 'resonator': {'quality': 1000000.0}}
    """
    *parents, last = key.split(".")
    for part in parents:
        if isinstance(tree, list):
            if not part.isdigit() or int(part) >= len(tree):
                raise UsageError(f"--set {key}: there is no element {part}")
            tree = tree[int(part)]
        else:
            tree = tree.setdefault(part, {})
        if not isinstance(tree, dict | list):
            raise UsageError(f"--set {key}: {part} is a value, a table was expected")
    if isinstance(tree, list):
        raise UsageError(f"--set {key}: an element's key was expected after its number")
    tree[last] = value


def merge(into: dict[str, Any], tree: Mapping[str, Any]) -> None:
    """Put tables over others: tables are merged, anything else is replaced.

    Parameters
    ----------
    into
        Changed in place.
    tree
        Put over it.

    Examples
    --------
    >>> from hrg_cli.settings import merge
    >>> limits = {"wave": {"residual_rms": 1e-3}, "jobs": 1}
    >>> merge(limits, {"wave": {"frequency_hz": 5e3}, "jobs": 2})
    >>> limits
    {'wave': {'residual_rms': 0.001, 'frequency_hz': 5000.0}, 'jobs': 2}
    """
    for key, value in tree.items():
        if isinstance(value, Mapping) and isinstance(into.get(key), dict):
            merge(into[key], value)
        else:
            into[key] = value


def accepts(stage: Callable[..., Any], name: str) -> bool:
    """Whether a stage has a setting.

    Parameters
    ----------
    stage
        Its function.
    name
        Of the setting.

    Returns
    -------
    bool
        It is in the stage's signature.

    Examples
    --------
    >>> from hrg_cli import identify
    >>> from hrg_cli.settings import accepts
    >>> accepts(identify, "bootstrap"), accepts(identify, "harmonics")
    (True, False)
    """
    return name in inspect.signature(stage).parameters


def resolve(
    stage: Callable[..., Any],
    config: Path | None = None,
    assignments: tuple[str, ...] = (),
    flags: Mapping[str, Any] | None = None,
    table: str = "",
) -> dict[str, Any]:
    """The stage's whole checked settings: signature < table of the file < --set < flags.

    Parameters
    ----------
    stage
        Its function.
    config
        A TOML file.
    assignments
        `key=value` of --set; the key may begin with the table's name.
    flags
        Of the command line; None was not given.
    table
        Of the file; the stage's name where none is told.

    Returns
    -------
    dict
        Name -> value.

    Raises
    ------
    HrgError
        The file cannot be read, or its table is none or holds a wrong key.
    UsageError
        A flag or an assignment is wrong.

    Examples
    --------
    >>> from hrg_cli.settings import resolve
    >>> def wait(*, seconds: float = 1.0, times: int = 1): ...
    >>> resolve(wait, assignments=("wait.seconds=2", "times=3"), flags={"times": 4})
    {'seconds': 2.0, 'times': 4}
    """
    name = table or stage.__name__
    from_file: dict[str, Any] = {}
    if config is not None:
        tree = load_toml(config)
        found = tree.get(name, {})
        if not isinstance(found, dict):
            raise HrgError(f"{config}: {name} is not a table; write its settings under [{name}]")
        from_file = found
        validate(make_model(stage), from_file, str(config), prefix=f"{name}.")
    given: dict[str, Any] = {}
    for text in assignments:
        key, value = parse_assignment(text)
        assign(given, key.removeprefix(f"{name}."), value)
    given |= {key: value for key, value in (flags or {}).items() if value is not None}
    return check_settings(stage, from_file | given, usage=True)


def check_settings(
    stage: Callable[..., Any],
    values: Mapping[str, Any],
    where: str = "settings",
    usage: bool = False,
) -> dict[str, Any]:
    """The stage's whole settings: its defaults with values over them.

    Parameters
    ----------
    stage
        Its function.
    values
        Name -> value.
    where
        Where they come from, for messages.
    usage
        They come from the command line.

    Returns
    -------
    dict
        Name -> value.

    Raises
    ------
    HrgError
        An unknown key, or a value out of range; `UsageError` of the command line.

    Examples
    --------
    >>> from hrg_cli.settings import check_settings
    >>> def wait(*, seconds: float = 1.0, times: int = 1): ...
    >>> check_settings(wait, {"times": 2})
    {'seconds': 1.0, 'times': 2}
    >>> check_settings(wait, {"second": 2})
    Traceback (most recent call last):
    ...
    hrg_cli.errors.HrgError: settings: unknown key second (did you mean seconds?)
    """
    model = validate(make_model(stage), values, where, usage=usage)
    return {key: getattr(model, key) for key in type(model).model_fields}


def validate(
    model: Any, values: Mapping[str, Any], where: str, prefix: str = "", usage: bool = False
) -> Any:
    """An instance of a pydantic model, or one sentence that lists the wrong keys.

    Parameters
    ----------
    model
        Its class.
    values
        Name -> value.
    where
        Where they come from, for messages.
    prefix
        Of their keys in messages, with its dot.
    usage
        They come from the command line.

    Returns
    -------
    BaseModel
        Of that class.

    Raises
    ------
    HrgError
        Wrong keys, the first three by name; `UsageError` of the command line.

    Examples
    --------
    >>> from hrg_cli.settings import make_model, validate
    >>> def wait(*, seconds: float = 1.0): ...
    >>> validate(make_model(wait), {"seconds": 2}, "chain.toml", prefix="wait.").seconds
    2.0
    """
    from pydantic import ValidationError

    try:
        return model.model_validate(dict(values))
    except ValidationError as error:
        found = error.errors(include_url=False)
        problems = [_problem(one, model, prefix, len(found) == 1) for one in found[:MOST_TOLD]]
        more = [f"and {len(found) - MOST_TOLD} more"] if len(found) > MOST_TOLD else []
        kind = UsageError if usage else HrgError
        raise kind(f"{where}: {'; '.join(problems + more)}") from error


def _problem(error: Mapping[str, Any], model: Any, prefix: str, alone: bool) -> str:
    """One of pydantic's errors in words; an unknown key that stands alone is answered with those
    that there are."""
    key = prefix + ".".join(str(part) for part in error["loc"])
    if error["type"] == "extra_forbidden":
        return f"unknown key {key}{_hint(str(error['loc'][-1]), model, error['loc'][:-1], alone)}"
    if error["type"] == "missing":
        return f"{key} is missing"
    says = error["msg"].removeprefix("Value error, ")
    found = "" if isinstance(error["input"], Mapping) else f" = {str(error['input'])[:60]!r}"
    parts = (key.removesuffix(".") + found, says[:1].lower() + says[1:])
    return ": ".join(part for part in parts if part)


def _hint(word: str, model: Any, place: tuple[Any, ...], alone: bool) -> str:
    """The key that an unknown one may mean, or those that there are."""
    import difflib

    for part in place:
        model = _find_part(model, part)
    known = list(_list_fields(model))
    close = difflib.get_close_matches(word, known, 1)
    if close:
        return f" (did you mean {close[0]}?)"
    return f" (there are {name_some(known)})" if known and alone else ""


def _list_fields(model: Any) -> dict[str, Any]:
    """Types of a table's keys, as a file names them; none where it is no table."""
    fields: Mapping[str, Any] = getattr(model, "model_fields", {})
    return {field.alias or name: field.annotation for name, field in fields.items()}


def _find_part(model: Any, part: str | int) -> Any:
    """The type of a table's key, or of a list's or dictionary's entry."""
    if fields := _list_fields(model):
        return fields.get(str(part))
    inner = typing.get_args(model)
    return inner[-1] if inner else None


def to_toml(values: Mapping[str, Any]) -> str:
    """Settings as TOML text.

    Parameters
    ----------
    values
        Models, tables, lists, paths, numbers; None is left out.

    Returns
    -------
    str
        Lines.

    Examples
    --------
    >>> from hrg_cli.settings import to_toml
    >>> print(to_toml({"estimate": {"tolerance": 1e-8, "from_s": None}}), end="")
    [estimate]
    tolerance = 1e-08
    """
    import tomli_w

    return tomli_w.dumps(_plain(values))


def _plain(value: Any) -> Any:
    if hasattr(value, "model_dump"):
        value = value.model_dump()
    if isinstance(value, Mapping):
        return {str(k): _plain(v) for k, v in value.items() if v is not None}
    if isinstance(value, list | tuple):
        return [_plain(v) for v in value]
    if isinstance(value, Path):
        return str(value)
    if hasattr(value, "item"):
        return value.item()
    return value
