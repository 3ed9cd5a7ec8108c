"""How every page is made of its template: style sheet and scripts inside, whatever a file says as
text.

A page runs the scripts that it was made with and no others: their SHA-256 stands in its content
security policy.
"""

from __future__ import annotations

import base64
import hashlib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup

from ..version import __version__
from .text import clean_text

FOLDER = Path(__file__).parent


def render_page(template: str, scripts: Sequence[str], **content: Any) -> str:
    """The HTML of a template of this folder, with style sheet and scripts inside.

    Parameters
    ----------
    template
        Its file.
    scripts
        Files, one after another; no others may run.
    content
        Names of the template; one that it does not get is an error, not an empty place.

    Returns
    -------
    str
        HTML that needs no other file.

    Examples
    --------
    >>> from hrg_cli.reporting.templates import render_page
    >>> try:
    ...     render_page("page.html", ())
    ... except Exception as error:
    ...     type(error).__name__
    'UndefinedError'
    """
    environment = Environment(
        loader=FileSystemLoader(FOLDER),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["size"] = _say_size
    script = "".join((FOLDER / name).read_text(encoding="utf-8") for name in scripts)
    return environment.get_template(template).render(
        version=__version__,
        css=Markup((FOLDER / "page.css").read_text(encoding="utf-8")),
        script=Markup(script),
        script_hash=base64.b64encode(hashlib.sha256(script.encode()).digest()).decode(),
        plain=clean_text,
        **content,
    )


def _say_size(count: float) -> str:
    """Bytes in the unit that gives few digits."""
    for unit in ("B", "kB", "MB"):
        if count < 1000:
            return f"{count:.3g} {unit}"
        count /= 1000
    return f"{count:.3g} GB" if count < 1000 else f"{count:.0f} GB"
