"""What the objects of all commands are made of."""

from __future__ import annotations

from typing import Literal

from pydantic import BaseModel, ConfigDict

Number = float | None
Status = Literal["valid", "suspect", "refused"]


class Shape(BaseModel):
    """A JSON object whose keys are all declared."""

    model_config = ConfigDict(
        extra="forbid", strict=True, populate_by_name=True, use_attribute_docstrings=True
    )


class Common(Shape):
    """The keys that every command's JSON has."""

    kind: str
    """Kind of the file written, or what was done."""
    status: Status
    """Validity; exit status 3 where it is refused, or suspect with --strict."""
    status_reasons: list[str]
    """Why it is not valid, and what else should be known: sentences."""
    output: str | None
    """File or folder written."""
    elapsed_s: float
    """Time taken."""


class Value(Shape):
    """A number with its standard deviation."""

    value: Number
    """The number."""
    std: Number
    """Its standard deviation."""


class Estimated(Value):
    """A parameter with its standard deviation and unit."""

    units: str
    """Unit."""


class Check(Shape):
    """A check on the final result that could have failed."""

    name: str
    """The check."""
    value: Number
    """What was found."""
    limit: Number
    """What was allowed."""
    passed: bool
    """Whether it passed."""
    sentence: str
    """What it means."""


class Before(Shape):
    """A figure before and after the correction."""

    before: Number
    """Without the correction."""
    after: Number
    """With it."""


class HeldOut(Before):
    """A figure before and after the correction, and on data that were left out of the fit."""

    held_out: Number
    """On data left out of the fit."""


class FitFigures(Shape):
    """How well a model fits."""

    chi2_per_dof: Number
    """χ² per degree of freedom."""
    residual_rms: Number
    """Rms of the residual, unit of the signals."""
