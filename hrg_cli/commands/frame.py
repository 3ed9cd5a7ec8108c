"""What every command has in common: its options, its pipes and its closing word."""

from __future__ import annotations

import contextlib
import copy
import functools
import inspect
import os
import sys
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, get_args

import typer
import typer.main

from ..errors import InterruptedRunError, UsageError
from ..extras import PlainPythonWarning
from ..reporting.text import take_first_paragraph
from .common import Common
from .guard import run_guarded

Files = Annotated[list[Path] | None, typer.Argument(metavar="FILE...", show_default=False)]
OneFile = Annotated[Path | None, typer.Argument(metavar="FILE", show_default=False)]
EffectsFrom = Annotated[
    Path | None,
    typer.Option(help="Python file with effects of your own; it is executed.", show_default=False),
]


def make_rehearse_option(what: str) -> Any:
    """Declaration of `--rehearse`: how often something is rehearsed; a spread needs two.

    Parameters
    ----------
    what
        Is rehearsed, in words.

    Returns
    -------
    OptionInfo
        Of typer.

    Examples
    --------
    >>> from hrg_cli.commands.frame import make_rehearse_option
    >>> make_rehearse_option("the result").help
    'Rehearse the result so many times on a simulated twin at once.'
    """
    return typer.Option(
        "--rehearse",
        min=2,
        help=f"Rehearse {what} so many times on a simulated twin at once.",
        show_default=False,
    )


Rehearsals = Annotated[int | None, make_rehearse_option("the result")]


_OPTIONS: dict[str, tuple[Any, Any]] = {
    "output": (
        Annotated[
            Path | None,
            typer.Option("--output", "-o", help="File (or folder) to write.", show_default=False),
        ],
        None,
    ),
    "force": (Annotated[bool, typer.Option("--force", help="Replace an existing output.")], False),
    "config": (
        Annotated[
            Path | None,
            typer.Option(
                "--config", help="TOML file with a table named as the command.", show_default=False
            ),
        ],
        None,
    ),
    "assignments": (
        Annotated[
            list[str] | None,
            typer.Option(
                "--set",
                metavar="KEY=VALUE",
                help="Change one setting; may be repeated.",
                show_default=False,
            ),
        ],
        None,
    ),
    "show_config": (
        Annotated[
            bool,
            typer.Option("--show-config", help="Print the resolved settings as TOML and leave."),
        ],
        False,
    ),
    "json": (
        Annotated[
            bool, typer.Option("--json", help="One JSON object on standard output, nothing else.")
        ],
        False,
    ),
    "quiet": (
        Annotated[bool, typer.Option("--quiet", "-q", help="No progress and no summary.")],
        False,
    ),
    "verbose": (
        Annotated[
            bool,
            typer.Option(
                "--verbose",
                "-v",
                help="Say the time taken; show the traceback of an internal error.",
            ),
        ],
        False,
    ),
    "strict": (
        Annotated[
            bool,
            typer.Option(
                "--strict", envvar="HRG_STRICT", help="A suspect result, too, ends with status 3."
            ),
        ],
        False,
    ),
    "seed": (
        Annotated[
            int | None,
            typer.Option("--seed", help="Seed of whatever is drawn at random.", show_default=False),
        ],
        None,
    ),
    "jobs": (
        Annotated[
            int, typer.Option("--jobs", min=1, help="Processes to use where work can be shared.")
        ],
        1,
    ),
}


JOBS_OF_REHEARSAL = {
    "jobs": "Processes that share the rehearsals of --rehearse; the rest is done by one."
}
NO_DRAWS = {"seed": "nothing is drawn at random"}
ONE_PROCESS = {"jobs": "the work is done by one process"}
_SETTINGS = ("config", "assignments", "show_config")


def refuse_settings(why: str) -> dict[str, str]:
    """The reason why a command has no settings, for each option that would change them.

    Parameters
    ----------
    why
        In words, after "has no effect here:".

    Returns
    -------
    dict
        Option -> the reason, a part of what `make_command` takes as `idle`.

    Examples
    --------
    >>> from hrg_cli.commands.frame import refuse_settings
    >>> list(refuse_settings("it has none"))
    ['config', 'assignments', 'show_config']
    """
    return dict.fromkeys(_SETTINGS, why)


def make_command(
    name: str,
    example: str,
    *,
    flags: Sequence[inspect.Parameter] = (),
    idle: Mapping[str, str] | None = None,
    says: Mapping[str, str] | None = None,
    also_written: Sequence[str] = (),
) -> Callable[[Callable[..., None]], Any]:
    """Make a command of its body: common options, one line for every failure, an example in its
    help.

    Parameters
    ----------
    name
        As typed after `hrg`.
    example
        Of a command line.
    flags
        Options made from a stage's signature (`options.make_flags`), which the body takes as
        **flags.
    idle
        Common option -> why it changes nothing in this command, whose help leaves it out and which
        says so where it is given all the same.
    says
        Common option -> its help in this command.
    also_written
        The command's own options that name further outputs.

    Returns
    -------
    callable
        Turns a function of (run, …) into click's command; its docstring is the help.

    Examples
    --------
    >>> from hrg_cli.commands.frame import make_command
    >>> @make_command("greet", "hrg greet")
    ... def main(run):
    ...     '''Say where the output goes.'''
    >>> main.name, main.epilog
    ('greet', 'Example: hrg greet')
    """
    without_effect = idle or {}

    def register(function: Callable[..., None]) -> Any:
        own = list(inspect.signature(function, eval_str=True).parameters.values())[1:]

        @functools.wraps(function)
        def run(**arguments: Any) -> None:
            given = {key: arguments.pop(key) for key in _OPTIONS}
            given["assignments"] = tuple(given["assignments"] or ())
            _say_idle(name, given, without_effect)
            run_guarded(
                functools.partial(_piped, name, function, Common(**given), arguments, also_written),
                given["verbose"],
            )

        parameters = [
            *(p for p in own if p.kind is not inspect.Parameter.VAR_KEYWORD),
            *flags,
            *(
                inspect.Parameter(
                    k,
                    inspect.Parameter.KEYWORD_ONLY,
                    annotation=_in_command(a, (says or {}).get(k), k in without_effect),
                    default=d,
                )
                for k, (a, d) in _OPTIONS.items()
            ),
        ]
        run.__signature__ = inspect.Signature(  # type: ignore[attr-defined]
            [p.replace(kind=inspect.Parameter.KEYWORD_ONLY) for p in parameters]
        )
        run.__annotations__ = {p.name: p.annotation for p in parameters}
        del run.__wrapped__
        alone = typer.Typer(
            add_completion=False, pretty_exceptions_enable=False, rich_markup_mode=None
        )
        # given whole, it is wrapped in the list of commands; taken from the docstring, it would be
        # cut off there
        summary = take_first_paragraph(function.__doc__)
        alone.command(name, epilog=f"Example: {example}", short_help=summary)(run)
        return typer.main.get_command(alone)

    return register


@contextlib.contextmanager
def _slowness_said(quiet: bool) -> Iterator[None]:
    """A simulation in plain Python is said when it begins, once; other warnings are shown, or not,
    as before."""
    shown, said = warnings.showwarning, set[str]()

    def show(text: Warning | str, kind: type[Warning], *place: Any) -> None:
        if not issubclass(kind, PlainPythonWarning):
            shown(text, kind, *place)
        elif str(text) not in said:
            said.add(str(text))
            print(text, file=sys.stderr, flush=True)

    with warnings.catch_warnings():
        warnings.filterwarnings("ignore" if quiet else "always", category=PlainPythonWarning)
        warnings.showwarning = show  # type: ignore[assignment]
        yield


@contextlib.contextmanager
def _dropped_where_it_fails(outputs: Sequence[Path]) -> Iterator[None]:
    """A command that fails leaves no output, also where it fails after writing one."""
    if not outputs:
        yield
        return
    from ..store import keep_whole_or_none

    with keep_whole_or_none(outputs, unless=(typer.Exit,)):
        yield


def _need_apart(inputs: Sequence[Path], outputs: Sequence[Path]) -> None:
    """HrgError: an input has a name that no file can have, or would be replaced. UsageError: two
    outputs are one file."""
    from .. import store

    for path in inputs:
        store.need_possible(path)
    for place, output in enumerate(outputs):
        store.need_no_input(output, inputs)
        if any(store.is_same_file(output, other) for other in outputs[:place]):
            raise UsageError(f"{output}: two outputs have this name; give each its own")


def _paths(value: Any) -> list[Path]:
    """The files that an option or an argument names."""
    values = value if isinstance(value, list) else [value]
    return [one for one in values if isinstance(one, Path)]


def _piped(
    name: str,
    function: Callable[..., None],
    common: Common,
    arguments: Mapping[str, Any],
    also_written: Sequence[str],
) -> None:
    """The command with its pipes: `-` among the inputs, `-o -`; what an interrupted one leaves is
    said."""
    from .pipes import DASH, name_piped_output, remove, take_from_pipe

    if common.output == DASH:
        if common.json:
            raise UsageError("-o - prints the name of a file, --json an object; choose one of them")
        common = replace(common, output=name_piped_output(name), piped=True)
    given, names = take_from_pipe(name, arguments)
    outputs = [*_paths(common.output), *(p for key in also_written for p in _paths(given[key]))]
    taken = [value for key, value in given.items() if key not in also_written]
    _need_apart([p for value in (*taken, common.config) for p in _paths(value)], outputs)
    try:
        with _dropped_where_it_fails(outputs), _slowness_said(common.quiet):
            function(common, **given)
    except KeyboardInterrupt:
        if common.output is not None and common.output.is_dir():
            raise InterruptedRunError(
                f"interrupted; what was finished before stays in {common.output}, no file is half"
                " written"
            ) from None
        raise
    remove(names)


def _in_command(annotation: Any, text: str | None, hidden: bool) -> Any:
    """The option with the help of this command; one without effect in it is taken, but not
    offered."""
    kind, option = get_args(annotation)
    changed = copy.copy(option)
    changed.help, changed.hidden = text or option.help, hidden
    return Annotated[kind, changed]


def _say_idle(name: str, given: Mapping[str, Any], idle: Mapping[str, str]) -> None:
    """A line for every option that is given and has no effect in the command; the environment's
    --strict is for all commands."""
    if given["quiet"]:
        return
    for key, why in idle.items():
        annotation, default = _OPTIONS[key]
        by_environment = key == "strict" and os.environ.get("HRG_STRICT")
        if given[key] not in (default, ()) and not by_environment:
            # typer keeps the first name of an annotated option as its default
            option = get_args(annotation)[1].default
            print(f"hrg {name}: {option} has no effect here: {why}", file=sys.stderr)


def read_command_line() -> str:
    """The command as it was typed, for `history`.

    Returns
    -------
    str
        Quoted as a shell would need it; bytes that are no text are escaped.

    Examples
    --------
    >>> from hrg_cli.commands.frame import read_command_line
    >>> read_command_line().startswith("hrg ")
    True
    """
    import shlex

    typed = "hrg " + shlex.join(sys.argv[1:])
    return typed.encode("utf-8", "backslashreplace").decode()  # a file's name may be no text


def need_inputs(paths: Sequence[Path], what: str) -> list[Path]:
    """The inputs, at least one.

    Parameters
    ----------
    paths
        That were named.
    what
        Is to be named, in words.

    Returns
    -------
    list of Path
        The same.

    Raises
    ------
    UsageError
        None is named.

    Examples
    --------
    >>> from hrg_cli.commands.frame import need_inputs
    >>> need_inputs(["a.h5"], "a wave file")
    ['a.h5']
    >>> need_inputs([], "a wave file")
    Traceback (most recent call last):
    ...
    hrg_cli.errors.UsageError: no input is named; name a wave file
    """
    if not paths:
        raise UsageError(f"no input is named; name {what}")
    return list(paths)
