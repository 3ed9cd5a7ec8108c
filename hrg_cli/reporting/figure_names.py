"""Keys of figures in words: what a figure is, without where it is kept and its unit."""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Collection

from ..limit_values import SUFFIXES
from .figures_in_words import WORDS
from .quantities import LABELS, RATE_OF_DECAY
from .text import clean_text

OF_PARAMETERS = LABELS | {"damping_rate_1_s": RATE_OF_DECAY}
"""The damping stays a rate: a decay time would move against its own sign."""
OF_TABLES = {
    "table.drift_rad_s": "drift D, where the tables differ most",
    "table.scale_factor": "scale factor K, where the tables differ most",
}
PLACES = ("details", "final_analysis", "split_components", "values", "parameters", "allan", "gain")
"""First parts of a name that say where a figure is kept, not what it is."""


def name_figure(name: str) -> str:
    """A figure's key in words, without its place and unit.

    Parameters
    ----------
    name
        As files and limits have it.

    Returns
    -------
    str
        For a person.

    Examples
    --------
    >>> from hrg_cli.reporting.figure_names import name_figure
    >>> name_figure("details.drift_rms_rad_s"), name_figure("effects.gain_mismatch.gain.value")
    ('drift rms', 'gain mismatch: gain')
    """
    if name in OF_TABLES:
        return OF_TABLES[name]
    parts = name.removesuffix(".value").split(".")
    while len(parts) > 1 and parts[0] in PLACES:
        parts = parts[1:]
    if parts[0] == "effects":
        return f"{_words(parts[1])}: {' '.join(map(_words, parts[2:]))}"
    return " ".join(OF_PARAMETERS.get(part) or _words(part) for part in parts)


def name_figures(figures: Collection[tuple[str, str]]) -> dict[tuple[str, str], str]:
    """Figures of several files in words that tell them apart.

    Parameters
    ----------
    figures
        (kind of file, key).

    Returns
    -------
    dict
        (kind, key) -> words, with the kind or the key where several would be called alike.

    Examples
    --------
    >>> from hrg_cli.reporting.figure_names import name_figures
    >>> list(name_figures([("resonator", "chi2"), ("diagnosis", "chi2")]).values())
    ['χ², resonator', 'χ², diagnosis']
    """
    said = {(kind, key): name_figure(key) for kind, key in figures}
    for more in (lambda kind, key: f", {kind}", lambda kind, key: f" ({clean_text(key)})"):
        alike = defaultdict(list)
        for figure, words in said.items():
            alike[words].append(figure)
        for words, named in alike.items():
            if len(named) > 1:
                said |= {figure: words + more(*figure) for figure in named}
    return said


def _words(part: str) -> str:
    unit = next((end for end, _ in SUFFIXES if part.endswith(end)), "")
    bare = re.sub(r"_ppm$", "", part.removesuffix(unit))
    return clean_text(" ".join(WORDS.get(word, word) for word in bare.split("_")))
