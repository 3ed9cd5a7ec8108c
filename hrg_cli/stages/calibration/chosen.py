"""The variant that is written: what of it repeats between programmes, what it leaves, and what the
record keeps of it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from ...fitting.checks import Check
from ...fitting.tables.joint import Fitted
from ...fitting.tables.table_layout import Model
from ...records import Calibration, Wave
from .accuracy_stages import list_first_stages
from .between_nodes import estimate_interpolation_doubt
from .choice import TriedVariant, solve_again
from .drift_models import build_variant, list_measured_details
from .folds import choose_smoothness
from .noise_guards import say_noise
from .record import make_calibration_record
from .repeatability import compare_programmes, drop_unstable
from .residual_errors import gather_cells, predict_models, tabulate_model_figures
from .scale_factor_course import ScaleFactors
from .thermal_memory import compare_thermal_memory
from .variant_solutions import Wanted

Array = np.ndarray
LEAST_REPEATED = 2
"""Harmonics of 2mθ whose repeat between programmes is looked at, at least."""


@dataclass(frozen=True)
class Chosen:
    """The answer that is written, with the runs it was fitted to and the folds it is judged on."""

    fitted: Fitted
    folds: Array
    answer: TriedVariant
    wanted: Wanted
    stability: dict[str, Any] | None
    """Whether each harmonic repeats between programmes; None without two programmes."""
    dropped: tuple[str, ...] = ()
    """Harmonics left out because they do not repeat."""
    not_dropped: tuple[str, ...] = ()
    """Why none was left out, where that was asked for."""
    penalty: Array | None = None
    smoothness: float | None = None

    @classmethod
    def from_answer(
        cls,
        fitted: Fitted,
        folds: Array,
        answer: TriedVariant,
        wanted: Wanted,
        programmes: Mapping[str, str] | None,
    ) -> Chosen:
        """The answer, its harmonics compared between programmes (by run_id where they are
        named)."""
        drift, scale = (max(limit, LEAST_REPEATED) for limit in answer.limits)
        coefficients = answer.tried.solution.coefficients
        told = compare_programmes(fitted, coefficients, drift, scale, programmes)
        return cls(fitted, folds, answer, wanted, told)

    def drop_unstable(self) -> Chosen:
        """The same without the harmonics that do not repeat."""
        if self.stability is None:
            why = (
                "stable_only needs repeated programmes (several days or switch-ons, or warming and"
                " cooling); nothing was dropped"
            )
            return replace(self, not_dropped=(why,))
        if self.answer.name != "table":
            why = (
                f"stable_only drops harmonics of model table, {self.answer.name} is written:"
                " nothing was dropped; give --model table"
            )
            return replace(self, not_dropped=(why,))
        matrix, dropped = drop_unstable(self.fitted.layout, *self.answer.limits, self.stability)
        answer = solve_again(
            self.fitted, self.folds, self.answer, Model("table", matrix), self.wanted
        )
        return replace(self, answer=answer, dropped=tuple(dropped))

    def smooth(self) -> Chosen:
        """The same with a penalty on curvature between the nodes; as it is where it comes from
        elsewhere or harmonics were dropped."""
        if self.answer.tried.foreign or self.dropped:
            return self
        plain = build_variant(self.answer.name, self.fitted.layout, *self.answer.limits)
        penalty, smoothness = choose_smoothness(self.fitted, plain)
        answer = solve_again(self.fitted, self.folds, self.answer, plain, self.wanted, penalty)
        return replace(self, answer=answer, penalty=penalty, smoothness=smoothness)

    @property
    def scale_factor(self) -> float:
        """Mean K over nodes."""
        coefficients = self.answer.tried.solution.coefficients
        return self.fitted.layout.compute_mean_scale_factor(coefficients)

    @cached_property
    def own_checks(self) -> list[Check]:
        """Whether its scale factor is one of a resonator, and alike at all nodes."""
        layout, solution = self.fitted.layout, self.answer.tried.solution
        found = ScaleFactors.from_solution(layout, solution, self.inflation)
        return found.check(layout.axis)

    @property
    def chi2_per_dof(self) -> float:
        """χ² per degree of freedom at the noise found."""
        solution = self.answer.tried.solution
        pieces = self.fitted.pieces
        chi2 = pieces.compute_chi_square(solution.coefficients)
        return float(chi2 / max(pieces.count - solution.degrees, 1.0))

    @property
    def inflation(self) -> float:
        """Factor on the variances: a fit may find more noise than it was judged at, never less than
        there is; coefficients from elsewhere keep their own errors."""
        return 1.0 if self.answer.tried.foreign else max(self.chi2_per_dof, 1.0)

    def list_steps(self, draws: int, seed: int) -> list[dict[str, Any]]:
        """Figures of the first stages and of the answer, on data used and left out."""
        stages = list_first_stages(self.fitted.layout, *self.answer.limits)
        tried = self.answer.tried
        whole, held = predict_models(self.fitted, stages[:2], self.folds)
        whole = np.concatenate([whole, tried.solution.coefficients[:, None]], axis=1)
        own = np.stack([s.coefficients for s in tried.held], axis=1)[:, None]
        used, unseen = gather_cells(
            self.fitted, whole, np.concatenate([held, own], axis=1), self.folds
        )
        names = [stage.name for stage in stages]
        return tabulate_model_figures(names, used, unseen, self.scale_factor, draws, seed)

    @cached_property
    def thermal_memory(self) -> dict[str, Any] | None:
        """Lag and hysteresis of the thermometer beside the tables; None where they do not show."""
        tried = self.answer.tried
        if tried.model.start is not None:
            return None
        return compare_thermal_memory(self.fitted, tried.model, tried.solution.coefficients)

    def list_details(self, draws: int, seed: int) -> dict[str, Any]:
        """What the record keeps of the answer itself."""
        fitted, answer, steps = self.fitted, self.answer, self.list_steps(draws, seed)
        solution, model = answer.tried.solution, answer.tried.model
        return {
            "scale_factor": self.scale_factor,
            "figures": {kind: _before_and_after(steps, kind) for kind in ("drift", "scale")},
            "harmonics": answer.limits[0],
            "scale_factor_harmonics": answer.limits[1],
            "ladder": steps,
            "smoothness": self.smoothness,
            "chi2_per_dof": self.chi2_per_dof,
            "checks": [check.to_json() for check in (*answer.checks, *self.own_checks)],
            "noise": say_noise(fitted),
            "stability": self.stability,
            "dropped": list(self.dropped),
            "thermal_memory": self.thermal_memory,
            "interpolation_std": estimate_interpolation_doubt(
                fitted, solution, self.inflation, *answer.stored
            ),
            "measured": list_measured_details(
                model.name,
                fitted.layout,
                solution.coefficients,
                solution.covariance * self.inflation,
                fitted.paths,
            ),
            "jumps_of_half_a_turn": fitted.jumps,
            "runs": _noise_of_runs(fitted),
        }

    def make_record(
        self, waves: Sequence[Wave], valid: tuple[float, float], details: dict[str, Any]
    ) -> Calibration:
        """The tables as a record, valid between two values of the nodes' quantity."""
        tried = self.answer.tried
        return make_calibration_record(
            waves,
            self.fitted,
            tried.solution,
            self.inflation,
            self.answer.stored,
            valid,
            tried.model.name,
            details,
        )


def _before_and_after(steps: Sequence[Mapping[str, Any]], kind: str) -> dict[str, Any]:
    """Figures of the data as they came, of the data used, and of those left out."""
    first, last = steps[0], steps[-1]
    return {"before": first[kind], "after": last[kind + "_used"], "held_out": last[kind]}


def _noise_of_runs(fitted: Fitted) -> list[dict[str, Any]]:
    """Each run's white angle noise and angle random walk, of mθ."""
    return [
        {
            "run_id": p.run_id,
            "rows": p.rows,
            "blocks": len(p) + 1,
            "white_rad": float(np.sqrt(n.white)),
            "walk_rad2_s": n.walk,
        }
        for p, n in zip(fitted.paths, fitted.noises)
    ]
