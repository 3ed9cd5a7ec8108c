"""Diagnosis, the case: what the steps of a search pass on, each giving the next one a new one."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from ....fitting.causes.extended_fit import ExtendedFit
from .damping_form import Form
from .inquiry import Inquiry
from .remainder import Remainder, search_rest
from .selection import Found, Search


@dataclass(frozen=True)
class Case:
    """The causes found, what they leave over (None: nothing), what is said of the runs' frequencies,
    and a damping's better form, if any."""

    inquiry: Inquiry
    search: Search
    remainder: Remainder | None = None
    frequencies: Mapping[str, Any] = field(default_factory=dict)
    form: Form | None = None

    def give_up(self, cause: Found, fit: ExtendedFit) -> Case:
        """The case in which a cause is given up; `fit`: the fit without it, whose rest is sought
        again."""
        search = self.search.give_up(cause, fit, self.inquiry.candidates)
        return replace(self, search=search, remainder=search_rest(fit, self.inquiry.noise))
