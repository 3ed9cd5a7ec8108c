"""estimate against scipy.optimize.least_squares a period, the closed form's time a period, and the
growth with length, in processor time.

python benchmarks/bench_estimate.py
"""

import resource
import time
from functools import partial

import numpy as np
from scipy.optimize import least_squares
from timing import best as best_by

from hrg_cli.fitting.ellipse.closed_form import solve_closed_form
from hrg_cli.physics.signals import make_signals
from hrg_cli.records import Periods
from hrg_cli.stages.estimate import estimate

SIGMA = 1e-4
best = partial(best_by, clock=time.process_time)


def carrier_periods(rows: int) -> tuple[Periods, np.ndarray]:
    """Eight signals a window of a turning, decaying wave with noise, and its true x = (A, B, θ, φ,
    ψ)."""
    t = np.arange(rows) * 1e-3
    x = np.stack(
        [np.exp(-t / 1e3), 0.05 * np.cos(t), 0.3 + 2 * t, 0.5 * t, 0.4 + 0.01 * np.sin(t)], axis=-1
    )
    z = make_signals(x) + SIGMA * np.random.default_rng(1).standard_normal((rows, 8))
    record = Periods(
        time_s=t,
        signals=z,
        signals_std=np.full(z.shape, SIGMA),
        residual_rms=np.full((rows, 2), SIGMA),
        flags=np.zeros(rows, np.uint8),
        reference_frequency_hz=5000.0,
        periods_per_window=5,
        window_s=1e-3,
        mode="free",
        readout="carrier",
        run_id="bench",
    )
    return record, x


def run(record: Periods, **settings: str) -> None:
    """Estimate, keeping nothing."""
    for _ in estimate(record, **settings):  # type: ignore[arg-type]
        pass


def main() -> None:
    """Print the ratios."""
    few, truth = carrier_periods(200)

    def one_by_one() -> None:
        start = truth[0]
        for row in few.signals:
            start = least_squares(lambda x, row=row: make_signals(x) - row, start, method="lm").x

    scipy_us = best(one_by_one, 3) / len(few) * 1e6
    print(f"scipy.optimize.least_squares (lm, start previous): {scipy_us:.0f} us a period")
    record, _ = carrier_periods(1_000_000)
    part = record.rows(0, 300_000)
    closed_us = best(lambda: solve_closed_form(part.signals), 9) / len(part) * 1e6
    print(
        f"closed form alone: {closed_us:.2f} us a period-vector (aim: under 1),"
        f" {scipy_us / closed_us:.0f} times faster"
    )
    for solver in ("closed-form", "gauss-newton", "levenberg-marquardt"):
        taken = best(lambda solver=solver: run(part, solver=solver), 5) / len(part) * 1e6
        print(
            f"estimate, {solver}, with deviations and continuity: {taken:.2f} us a period,"
            f" {scipy_us / taken:.0f} times faster (aim: 500), {taken / closed_us:.1f} times the"
            " closed form alone"
        )
    for rows in (30_000, 100_000, 300_000, 1_000_000):
        part = record.rows(0, rows)
        print(
            f"growth: {rows:8d} periods {best(lambda part=part: run(part), 2) / rows * 1e6:.2f} us"
            " a period"
        )
    print(
        "peak memory with a million periods in memory:"
        f" {resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024:.0f} MB"
    )


if __name__ == "__main__":
    main()
