"""How to read a figure: what good and bad look like, by the figure's key; the answer's, the lot's
and the ledger's figures say it with their numbers."""

from __future__ import annotations

READ = {
    "channels": (
        "both fall smoothly, well within the converter's range",
        "flat tops, steps, a channel that stays still",
    ),
    "orbit": (
        "thin closed ellipses",
        "corners (clipping), a line as broad as the ellipse (noise)",
    ),
    "spectrum": (
        "one line over a flat floor, and nothing of it in the residual",
        "further lines, a hump beside the line",
    ),
    "log": ("smooth courses over the whole run", "steps, holes, a value that stays still"),
    "truth": (
        "estimates of the run lie on these lines",
        "they leave them by more than their own σ",
    ),
    "signals": (
        "slow curves with no point off them",
        "jumps and single points: knocks, lost or clipped samples",
    ),
    "residual-spectrum": (
        "a flat floor",
        "lines, or a hump: something moves within the windows that no window holds",
    ),
    "wave": (
        "smooth courses, σ small beside them",
        "jumps of θ, a_B as large as a_A (a circle has no wave angle), holes",
    ),
    "rates": (
        "flat bands about zero in every panel",
        "a wave over θ (splits, read-out), a slope over the amplitude (a nonlinearity), the"
        " temperature or time (a drift)",
    ),
    "correlation": (
        "pale off the diagonal",
        "full colour: the runs tell that pair's sum or difference alone",
    ),
    "runs": ("bars near the dashed line", "one far above: that run is unlike the others"),
    "compensated": (
        "after the tables a flat band, as wide as the noise",
        "what is left still follows rate, angle or temperature",
    ),
    "allan": (
        "after the tables the curve lies lower and keeps falling",
        "it levels off or climbs early: drift that no table holds",
    ),
    "harmonics": (
        "a few stand out of their σ, alike at all nodes",
        "high ones that stand out, or differ from node to node",
    ),
    "ladder": (
        "bars that get shorter downwards",
        "a step that buys nothing: its measurement can be saved",
    ),
    "ranking": (
        "blue bars far beyond all grey ones, and these below 3 to 4 σ",
        "a grey bar as long as a blue one",
    ),
    "gain": (
        "a χ² of one after, and as much gained on data left out",
        "a gain on fitted data alone",
    ),
    "correlations": (
        "blank off the diagonal",
        "full squares: these runs take the two causes for one; plan the next run",
    ),
    "measured-and-simulated": ("the later line on the dots", "a line that parts from them"),
    "forecast": (
        "the extended model's lines within the band, its bar the shorter one",
        "lines that leave the band as time goes on",
    ),
    "drift-forecast": (
        "a narrow band, and an error that stays small until the next fix",
        "a band as wide as the drift: more runs are needed before it can be compensated",
    ),
    "rehearsal": (
        "bias near 0, rms near 1, shares on the dashed lines",
        "rms above 1: the stated σ is too small",
    ),
    "pareto": (
        "few causes, in few gyros",
        "one that most gyros share: look at the design or station",
    ),
}
"""Key of a figure -> what good looks like, what bad."""
FAMILIES = {
    "departure-": (
        "after: flat about zero in every panel",
        "a bend or a slope that is left: what it goes with tells where to look",
    ),
    "-map": (
        "smooth both ways, whatever the shape",
        "a node that stands off its neighbours by many σ",
    ),
    "-against-node": (
        "a smooth course, σ small beside it",
        "a node that stands off its neighbours by many σ",
    ),
}
"""Part of a key -> the same, of figures of one kind."""


def explain_reading(key: str) -> str:
    """What good and bad look like in a figure.

    Parameters
    ----------
    key
        Of the figure.

    Returns
    -------
    str
        Empty where the figure says it itself.

    Examples
    --------
    >>> from hrg_cli.reporting.figures.good_and_bad import explain_reading
    >>> explain_reading("runs")
    'Good: bars near the dashed line. Bad: one far above: that run is unlike the others.'
    """
    found = READ.get(key) or next((text for part, text in FAMILIES.items() if part in key), None)
    return f"Good: {found[0]}. Bad: {found[1]}." if found else ""
