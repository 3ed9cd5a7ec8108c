"""The slow model with effects: all steps at once as row by row, and sensitivities as differences of
whole predictions."""

from dataclasses import replace

import numpy as np
import pytest

from hrg_cli.effects import find
from hrg_cli.fitting import least_squares
from hrg_cli.fitting.causes import (
    coordinate_priors,
    descent,
    designs,
    fast_march,
    slow_prediction,
    whitened_rows,
)
from hrg_cli.fitting.causes.fit_point import Point
from hrg_cli.fitting.causes.measured_runs import MeasuredRuns
from hrg_cli.fitting.causes.sensitivities import find_base_sensitivities, linearise_flow
from hrg_cli.fitting.causes.walks import Walk
from hrg_cli.fitting.causes.wave_frame import to_reals
from hrg_cli.fitting.envelopes.coordinates import SCALE_FACTOR

STRONG = {
    "cubic_stiffness": {"pull_rad_s": 3.0},
    "nonlinear_damping": {"damping_1_s": 0.2},
    "drive_rotation": {"electrical_angle_rad": 0.05},
    "pickoff_nonlinearity": {"cubic": 0.02},
    "thermal_lag": {"time_constant_s": 0.3},
    "thermal_damping": {"relative_1_k": 0.05, "reference_temperature_degc": 25.0},
}


def programme(runs=3, rows=90):
    """Runs side by side, the first driven, the last shorter than the others."""
    random = np.random.default_rng(2)
    t = np.broadcast_to(np.linspace(0, 2, rows), (runs, rows)).copy()
    t[-1, rows // 2 :] = t[-1, rows // 2]
    one = np.ones((runs, rows))
    rate = np.array([0.0, 1.0, -2.0])[:, None] * one
    start = np.array([[1.0 + 0.1j, 0.2j], [0.6, 0.5 + 0.02j], [0.1 + 0.02j, 0.9]])
    forced = np.array([1.0, 0.0, 0.0])[:, None] * one
    weight = np.where(np.diff(t, prepend=-1) > 0, 1e3, 0.0)
    series = MeasuredRuns(
        names=("a", "b", "c"), time_s=t, envelope=np.repeat(start[:, None], rows, axis=1), weight=weight,
        rate_rad_s=rate, temperature_degc=24 + t, temperature_rate_degc_s=one, branch=one, table_angle_rad=rate * t, phase_rad=0.1 * one,
        main_drive=0.3 * forced, quadrature_drive=0.01 * forced, main_impulse=0.3 * forced * t,
        quadrature_impulse=0.01 * forced * t, forced=forced, held_amplitude=np.nan * one, held_slope=0 * one,
        turn_rad_s=random.normal(size=runs), reference_frequency_hz=5000.0, mode_number=2,
    )  # fmt: skip
    active = tuple((find(name), find(name).values(values)) for name, values in STRONG.items())
    p = np.array([0.3, 0.01, 0.004, 0.05, 0.08, 0.55, 1.0])
    return series, Point(p, start, random.normal(size=runs), active)


def test_all_steps_at_once_are_the_steps_row_by_row():
    series, point = programme()
    rule = slow_prediction.Rule(series, point)
    marched = rule.march(point.start)
    motion = slow_prediction.predict(series, point).motion
    np.testing.assert_allclose(motion, marched, atol=1e-11)
    near = slow_prediction.predict(
        series, replace(point, p=point.p * 1.02, start=point.start * 0.98)
    )
    again = slow_prediction.predict(series, point, linearise_flow(near).near).motion
    np.testing.assert_allclose(again, marched, atol=1e-11)


def test_a_driven_motion_is_found_from_one_that_ran_off_by_a_radian():
    """Its phase runs off by 1.2 rad over the run, its angle by 0.5: plain sums of the changes would not
    settle, and the rows be marched one by one."""
    series, point = programme()
    driven = replace(
        series, forced=np.ones_like(series.forced), main_drive=0.3 + 0 * series.main_drive
    )
    p = point.p.copy()
    p[SCALE_FACTOR] += 0.1
    far = replace(point, p=p, offset_rad_s=point.offset_rad_s + 0.6)
    near = linearise_flow(slow_prediction.predict(driven, far)).near
    rule = slow_prediction.Rule(driven, point)
    found = rule.settle(near, point.start)
    assert found is not None
    np.testing.assert_allclose(found, rule.march(point.start), atol=1e-11)


def beside(series, what):
    """The programme as a case of a drive that the march has a branch for."""
    random = np.random.default_rng(3)
    rows = (*series.time_s.shape, 2)
    if what == "held amplitude":
        held = np.where(series.forced > 0, 1 + 0.1 * np.sin(series.time_s), np.nan)
        return replace(series, held_amplitude=held, held_slope=0.1 * np.cos(series.time_s))
    if what == "turned frame":
        return replace(series, frame_turn=0.2 * random.normal(size=rows))
    if what == "walk":
        jumps = 0.01 * random.normal(size=(rows[0], rows[1] - 1, 2)) * (1 + 0.5j)
        return replace(series, walk=Walk((), jumps, np.zeros(rows, complex)))
    return series


@pytest.mark.parametrize("what", ["logged commands", "held amplitude", "turned frame", "walk"])
def test_compiled_march_takes_the_same_steps(what, monkeypatch):
    """One equation, written for whole arrays of rows and for one row of one run."""
    pytest.importorskip("numba")
    series, point = programme()
    point = replace(point, active=())
    rule = slow_prediction.Rule(beside(series, what), point)
    fast = rule.march(point.start)
    monkeypatch.setattr(fast_march, "compile_march", lambda: None)
    plain = slow_prediction.Rule(beside(series, what), point).march(point.start)
    np.testing.assert_allclose(fast, plain, atol=1e-12)
    assert np.abs(plain[0, -1] - plain[0, 0]).max() > 0.1, "it moves"


def test_sensitivities_are_differences_of_whole_predictions():
    series, point = programme()
    flow = linearise_flow(slow_prediction.predict(series, point))
    for effect, values in point.active:
        steps = {p.name: 1e-3 * abs(values[p.name]) for p in effect.fitted()}
        own = whitened_rows.find_sensitivity(flow, effect, values, steps)
        for k, (name, size) in enumerate(steps.items()):
            seen = []
            for sign in (1, -1):
                changed = values | {name: values[name] + sign * size}
                there = slow_prediction.predict(
                    series,
                    replace(
                        point,
                        active=tuple((e, changed if e is effect else v) for e, v in point.active),
                    ),
                )
                seen.append(
                    whitened_rows.flatten_rows(
                        series, to_reals(there.seen * series.weight[..., None])
                    )
                )
            difference = (seen[0] - seen[1]) / (2 * size)
            assert np.linalg.norm(own[:, k] - difference) < 2e-3 * np.linalg.norm(difference), (
                effect.name
            )


def test_sensitivities_of_the_coordinates_are_differences_too():
    series, point = programme()
    # what is relative to the damping moves with it in the prediction alone
    point = replace(
        point, active=tuple(pair for pair in point.active if pair[0].name != "thermal_damping")
    )
    shared, _ = find_base_sensitivities(linearise_flow(slow_prediction.predict(series, point)))
    for k in range(7):
        size = 1e-4
        p = np.eye(7)[k] * size
        up, down = (
            slow_prediction.predict(series, replace(point, p=point.p + sign * p)).seen
            for sign in (1, -1)
        )
        difference = to_reals((up - down) * series.weight[..., None]) / (2 * size)
        assert (
            np.linalg.norm(shared[..., k] - difference) < 1e-3 * np.linalg.norm(difference) + 1e-6
        )


def test_an_effect_that_only_rounds_is_not_seen():
    series, point = programme()
    still = replace(
        series,
        quadrature_drive=0 * series.quadrature_drive,
        quadrature_impulse=0 * series.quadrature_impulse,
    )
    flow = linearise_flow(slow_prediction.predict(still, replace(point, active=())))
    effect = find("quadrature_drive_phase_error")
    assert not whitened_rows.find_sensitivity(
        flow, effect, effect.values(), {"phase_rad": 1e-5}
    ).any()


def test_a_design_beside_what_is_unsettled_over_several_runs_is_differences_too():
    """The steps of a fit are those of what it judges, also where a direction over all runs is taken
    off: blocks of one run each would mix the runs' own columns."""
    series, point = programme()
    count = 4 * int(np.count_nonzero(series.weight))
    free = designs.orthonormalise(np.random.default_rng(1).standard_normal((count, 1)))
    series = replace(series, unsettled=designs.Basis((), free))
    freedom = coordinate_priors.CoordinatePriors(np.zeros(7), np.full(7, np.inf))
    layout = whitened_rows.build_layout(series, point, freedom)
    design = whitened_rows.compute_design(
        linearise_flow(slow_prediction.predict(series, point)), layout
    )

    def judged(step):
        there = slow_prediction.predict(series, descent.move_point(point, layout, step, False))
        return whitened_rows.flatten_rows(series, to_reals(there.seen) * series.weight[..., None])

    whole = design.to_matrix()
    for k in (*range(layout.run(0).start, layout.run(1).stop), layout.coordinates[2]):
        step = 1e-4 * np.eye(layout.count)[k]
        change = (judged(step) - judged(-step)) / 2e-4
        assert np.linalg.norm(whole[:, k] - change) < 1e-3 * np.linalg.norm(change)


def test_what_all_runs_share_is_softened_as_a_whole_matrix_would_be():
    """A design in blocks beside columns of known variance, against (1 + U Λ Uᵀ)^{−1/2} of whole
    matrices: step, covariance, lengths and products."""
    rng = np.random.default_rng(8)
    rows, blocks = 60, [(slice(0, 30), slice(0, 3)), (slice(30, 60), slice(3, 6))]
    J = rng.normal(size=(rows, 9))
    for one, columns in blocks:
        outside = np.ones(rows, bool)
        outside[one] = False
        J[outside, columns] = 0.0
    unknown = np.linalg.qr(rng.normal(size=(rows, 3)))[0]
    variance = np.array([0.3, 50.0, np.inf])
    basis = designs.Basis((), unknown, variance)
    residual = rng.normal(size=rows)
    off = np.eye(rows) - (unknown * (1 - 1 / np.sqrt(1 + variance))) @ unknown.T
    whole = designs.Design.from_matrix(J, blocks)
    design = designs.Design(whole.shared, whole.places, whole.own, basis)
    want, covariance = least_squares.solve(off @ J, off @ residual)
    step, got = designs.factor_design(design).solve(
        basis.project_out(residual), np.zeros((0, 9)), np.zeros(0)
    )
    assert basis.free == 1 and basis.scale_noise(2.0).variance[0] == 0.3 / 4
    np.testing.assert_allclose(step, want, rtol=1e-9)
    np.testing.assert_allclose(got, covariance, rtol=1e-9)
    np.testing.assert_allclose(
        design.compute_lengths(), np.linalg.norm(off @ J, axis=0), rtol=1e-12
    )
    np.testing.assert_allclose(design.to_matrix(), off @ J, atol=1e-12)
    np.testing.assert_allclose(design.multiply(want), off @ J @ want, rtol=1e-9)
    np.testing.assert_allclose(
        design.multiply_transposed(residual), J.T @ off @ residual, rtol=1e-9
    )
