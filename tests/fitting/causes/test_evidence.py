"""The evidence engine on plain linear models: scores, blindness, groups, selection statistics,
held-out errors."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from hrg_cli.fitting import least_squares
from hrg_cli.fitting.causes import designs, evidence, left_out_folds


def problem(seed=0, rows=400, base=5, size=0.0):
    random = np.random.default_rng(seed)
    J = random.standard_normal((rows, base))
    S = random.standard_normal((rows, 1))
    r = random.standard_normal(rows) + size * S[:, 0]
    Q = designs.factor_design(designs.Design.from_matrix(J)).basis
    return J, Q, S, Q.project_out(r)


def test_score_is_the_estimate_over_its_deviation_of_a_full_fit():
    J, Q, S, r = problem(1, size=0.4)
    score = evidence.score("s", r, S, Q)
    full = np.column_stack([S, J])
    solution = np.linalg.lstsq(full, r, rcond=None)[0]
    std = np.sqrt(np.linalg.inv(full.T @ full)[0, 0])
    assert score.estimate[0] == pytest.approx(solution[0], rel=1e-9)
    assert score.std[0] == pytest.approx(std, rel=1e-9)
    assert score.z == pytest.approx(abs(solution[0]) / std, rel=1e-6)
    assert score.gain == pytest.approx((solution[0] / std) ** 2, rel=1e-9)


def test_many_scores_at_once_are_those_of_the_singular_values():
    random = np.random.default_rng(7)
    J, Q, _, r = problem(7)
    candidates = [
        random.standard_normal((len(r), m)) * 10.0 ** random.uniform(-6, 6, m)
        for m in (1, 3, 60, 2, 30)
    ]
    one = candidates[0]
    candidates.append(
        np.column_stack([one, one + 1e-9 * J[:, :1], np.zeros(len(r))])
    )  # two columns that are one, and nothing
    candidates.append(np.full((len(r), 1), np.nan))
    found = evidence.score_candidates([str(k) for k in range(len(candidates))], r, candidates, Q)
    for S, score in zip(candidates[:5], found[:5], strict=True):
        full = np.column_stack([S / np.linalg.norm(S, axis=0), J])
        assert score.rank == S.shape[1]
        assert score.gain == pytest.approx(
            r @ r - np.linalg.lstsq(full, r, rcond=None)[1][0], rel=1e-8
        )
        assert score.space.T @ score.space == pytest.approx(np.eye(score.rank), abs=1e-9)
        std = np.sqrt(np.diag(np.linalg.inv(full.T @ full))[: S.shape[1]]) / np.linalg.norm(
            S, axis=0
        )
        assert score.std / std == pytest.approx(1, rel=1e-8)
    assert found[5].rank == 1 and found[5].gain == pytest.approx(found[0].gain, rel=1e-6)
    assert not found[6].visible


def test_scores_of_noise_are_normal():
    z = [
        evidence.score("s", r, S, Q).estimate[0] / evidence.score("s", r, S, Q).std[0]
        for _, Q, S, r in map(problem, range(300))
    ]
    assert abs(np.mean(z)) < 4 / np.sqrt(300)
    assert np.var(z) == pytest.approx(1, abs=4 * np.sqrt(2 / 300))


def test_what_the_base_model_can_do_is_invisible():
    J, Q, _, r = problem(2)
    score = evidence.score("s", r, J[:, :1] * 3 - J[:, 1:2], Q)
    assert not score.visible and score.z == 0 and np.isnan(score.estimate[0])


def test_two_spellings_of_one_cause_are_alike():
    J, Q, S, r = problem(3, size=0.3)
    one, other = evidence.score("a", r, S, Q), evidence.score("b", r, 2 * S + J[:, :1], Q)
    assert evidence.correlate_spaces(one, other) == pytest.approx(1, abs=1e-9)
    assert (
        evidence.correlate_spaces(
            one, evidence.score("c", r, np.random.default_rng(9).standard_normal(S.shape), Q)
        )
        < 0.3
    )


def in_runs(seed=0, runs=4, rows=50, own=3, common=2):
    """A design whose first columns belong to one run each, and its blocks."""
    random = np.random.default_rng(seed)
    J = np.zeros((runs * rows, runs * own + common))
    blocks = [(slice(k * rows, (k + 1) * rows), slice(k * own, (k + 1) * own)) for k in range(runs)]
    for block in blocks:
        J[block] = random.standard_normal((rows, own)) * 10.0 ** random.uniform(-6, 6, own)
    J[:, runs * own :] = random.standard_normal((runs * rows, common))
    return J, blocks, random


def test_a_design_in_blocks_is_solved_as_the_whole():
    J, blocks, random = in_runs()
    J[blocks[1][0], blocks[1][1].start] = 0.0  # one run shows nothing of one of its parameters
    J[:, -1] += 1e3 * J[:, 0] / np.linalg.norm(J[:, 0])
    r, prior = random.standard_normal(len(J)), random.standard_normal((2, J.shape[1]))
    parts = designs.factor_design(designs.Design.from_matrix(J, blocks))
    assert parts.basis.shape == (
        len(J),
        np.linalg.matrix_rank(J / np.maximum(np.linalg.norm(J, axis=0), 1e-300)),
    )
    np.testing.assert_allclose(parts.basis.project(parts.basis.project_out(J / 1e6)), 0, atol=1e-9)
    step, covariance = parts.solve(r, 0 * prior, np.zeros(2))
    whole, its = least_squares.solve(J, r)
    np.testing.assert_allclose(step, whole, rtol=1e-8, atol=1e-10)
    np.testing.assert_allclose(covariance, its, rtol=1e-7, atol=1e-9 * np.abs(its).max())
    assert evidence.score("s", r, r[:, None], parts.basis).gain == pytest.approx(
        np.sum((r - J @ whole) ** 2), rel=1e-9
    )


def test_blocks_beside_what_is_unknown_over_all_of_them_are_solved_as_the_whole():
    """A direction over several runs that nobody knows: the steps are those of J less its part along
    it, which no longer stands in blocks."""
    J, blocks, random = in_runs(5)
    unknown = designs.orthonormalise(random.standard_normal((len(J), 2)))
    design = designs.Design.from_matrix(J, blocks)
    shared = design.shared - unknown @ (unknown.T @ design.shared)
    design = replace(design, shared=shared, unknown=designs.Basis((), unknown))
    whole = J - unknown @ (unknown.T @ J)
    np.testing.assert_allclose(design.to_matrix(), whole, atol=1e-9 * np.abs(J).max())
    np.testing.assert_allclose(design.compute_lengths(), np.linalg.norm(whole, axis=0), rtol=1e-9)
    r = random.standard_normal(len(J))
    r -= unknown @ (unknown.T @ r)
    np.testing.assert_allclose(
        design.multiply_transposed(r), whole.T @ r, rtol=1e-6, atol=1e-9 * np.abs(J).max()
    )
    factored = designs.factor_design(design)
    step, covariance = factored.solve(r, np.zeros((1, J.shape[1])), np.zeros(1))
    wanted, its = least_squares.solve(whole, r)
    np.testing.assert_allclose(step, wanted, rtol=1e-7, atol=1e-10)
    np.testing.assert_allclose(covariance, its, rtol=1e-6, atol=1e-9 * np.abs(its).max())
    np.testing.assert_allclose(factored.basis.project(r - whole @ wanted), 0, atol=1e-8)


def test_the_smooth_part_in_blocks_is_the_score_of_the_whole():
    J, blocks, random = in_runs(3)
    basis = designs.factor_design(designs.Design.from_matrix(J, blocks)).basis
    r = random.standard_normal(len(J))
    smooth = [(rows, random.standard_normal((50, 6))) for rows, _ in blocks]
    smooth[0][1][:, 0] = J[blocks[0]][:, 0]  # one column that the run's own can do
    smooth[2][1][:, 1] = smooth[2][1][:, 2]  # and two that are one
    whole = np.zeros((len(J), 24))
    for k, (rows, S) in enumerate(smooth):
        whole[rows, 6 * k : 6 * k + 6] = S
    one = evidence.score("smooth", r, whole, basis)
    assert evidence.measure_smooth_power(r, basis, smooth) == (
        pytest.approx(one.gain, rel=1e-9),
        one.rank,
    )
    assert one.rank == 22


def test_tests_that_look_at_the_same_count_as_one():
    """The best of correlated tests is as likely as that of so many independent ones, within a fifth
    of the chance at 5 %."""
    random = np.random.default_rng(4)
    common = random.standard_normal((60, 3))
    power = np.exp(-np.arange(60) / 6)
    for alike, spread in ((12, 0.1), (6, 0.5), (12, 3.0)):
        spaces = [
            np.linalg.qr(common[:, [k % 3]] + spread * random.standard_normal((60, 1)))[0]
            for k in range(alike)
        ]
        noise = random.standard_normal((4000, 60)) * np.sqrt(power)
        sizes = [float(np.sum(S[:, 0] ** 2 * power)) for S in spaces]
        z2 = np.max(
            [(noise @ S[:, 0]) ** 2 / size for S, size in zip(spaces, sizes, strict=True)], axis=0
        )
        weighted = [S * np.sqrt(power)[:, None] for S in spaces]
        count = evidence.count_independent(weighted)
        assert 1 <= count <= alike
        p = [
            evidence.correct_for_tries(float(evidence.find_significance(g, 1)[1]), count)
            for g in z2
        ]
        assert 0.035 < np.mean(np.array(p) < 0.05) < 0.065, (alike, spread, count)
    one = spaces[0]
    assert evidence.count_independent([one, one, -one]) == pytest.approx(1.0, abs=1e-4)
    apart = np.linalg.qr(random.standard_normal((60, 6)))[0]
    assert evidence.count_independent([apart[:, :3], apart[:, 3:]]) == pytest.approx(2.0)


def test_corrected_p_counts_the_number_tried():
    assert evidence.correct_for_tries(1e-6, 50) == pytest.approx(5e-5, rel=1e-3)
    assert evidence.correct_for_tries(1.0, 50) == pytest.approx(1.0)


def test_held_out_error_of_one_fold_is_that_of_a_refit_without_it():
    random = np.random.default_rng(5)
    X, y = random.standard_normal((60, 3)), random.standard_normal(60)
    best = np.linalg.lstsq(X, y, rcond=None)[0]
    folds = np.array_split(np.arange(60), 4)
    left = left_out_folds.predict_folds(
        y - X @ best, X, {k: np.zeros((15, 0)) for k in range(4)}, folds
    )
    for fold in folds:
        rest = np.setdiff1d(np.arange(60), fold)
        again = np.linalg.lstsq(X[rest], y[rest], rcond=None)[0]
        np.testing.assert_allclose(left[fold], y[fold] - X[fold] @ again, rtol=1e-9, atol=1e-12)


def test_what_the_other_folds_hold_no_information_on_stays_where_it_is():
    """A cause that one run alone shows (a temperature that goes up there) was carried to 1e10 σ by
    the rounding of the others' columns."""
    random = np.random.default_rng(6)
    X, y = random.standard_normal((60, 3)), random.standard_normal(60)
    X[15:, 2] *= 1e-9
    left_over = y - X @ np.linalg.lstsq(X, y, rcond=None)[0]
    folds = np.array_split(np.arange(60), 4)
    own = {k: np.zeros((15, 0)) for k in range(4)}
    left = left_out_folds.predict_folds(left_over, X, own, folds, least_information=1e-4)
    assert 0.7 < np.sqrt(np.mean(left**2)) < 1.3
    rest = X[15:, :2]
    step = np.linalg.lstsq(rest, left_over[15:], rcond=None)[0]
    np.testing.assert_allclose(left[:15], left_over[:15] - X[:15, :2] @ step, rtol=1e-6)


def _score(X, y, folds, own=None, prior=None):
    whole = np.column_stack([X, own]) if own is not None else X
    pull = np.zeros((0, X.shape[1])) if prior is None else prior
    wide = np.column_stack([pull, np.zeros((len(pull), whole.shape[1] - X.shape[1]))])
    stacked = np.concatenate([whole, wide])
    target = np.concatenate([y, np.zeros(len(wide))])
    left = y - whole @ np.linalg.lstsq(stacked, target, rcond=None)[0]
    blocks = {k: np.zeros((len(f), 0)) if own is None else own[f] for k, f in enumerate(folds)}
    blocks = {k: block[:, np.any(block != 0, axis=0)] for k, block in blocks.items()}
    return left_out_folds.score_folds(left, X, blocks, folds, prior, 1e-6)


def test_the_score_of_folds_is_the_density_that_the_others_give_them():
    """Two independent ways: the condensed one, and e'C⁻¹e + ln|C| of each fold from a fit without
    it, the fold's own column of any size."""
    random = np.random.default_rng(11)
    X, y = random.standard_normal((60, 3)), random.standard_normal(60)
    folds = np.array_split(np.arange(60), 4)
    own = np.zeros((60, 4))
    for k, f in enumerate(folds):
        own[f, k] = 1.0
    prior = np.array([[2.0, 0.0, 0.0]])
    wide, expected = 1e5, 0.0
    for f in folds:
        rest = np.setdiff1d(np.arange(60), f)
        V = np.eye(45) + wide * own[rest] @ own[rest].T
        A = X[rest].T @ np.linalg.solve(V, X[rest]) + prior.T @ prior
        mean = np.linalg.solve(A, X[rest].T @ np.linalg.solve(V, y[rest]))
        C = np.eye(15) + wide * own[f] @ own[f].T + X[f] @ np.linalg.solve(A, X[f].T)
        e = y[f] - X[f] @ mean
        expected += e @ np.linalg.solve(C, e) + np.linalg.slogdet(C)[1]
        expected -= np.log1p(15 * wide)
    found = _score(X, y, folds, own, prior)
    assert found == pytest.approx(expected, rel=2e-4)


def test_a_score_is_not_ruled_by_what_other_folds_hardly_tell():
    """A number that nearly one fold alone tells (a start, an angle at one temperature): the plain
    sum of squared errors grew with a true cause of 12 σ in one draw of four."""
    wrong = 0
    for seed in range(40):
        random = np.random.default_rng([seed, 12])
        X = random.standard_normal((200, 3))
        X[40:, 2] *= 0.02
        cause = random.standard_normal(200) + 8.0 * X[:, 2]
        y = X[:, 2] + 0.9 * cause + random.standard_normal(200)
        folds = np.array_split(np.arange(200), 5)
        wrong += _score(np.column_stack([X, cause]), y, folds) > _score(X, y, folds)
    assert wrong == 0


def test_the_price_is_that_of_every_parameter():
    """BIC against its origin: the mean of the likelihood over a wide normal prior (odds of two
    models) is what m columns cost, ln N each, but for what does not grow with N."""
    random = np.random.default_rng(8)
    for m in (1, 3):
        grown = []
        for rows in (200, 200_000):
            X = random.standard_normal((rows, m))
            r = X @ np.full(m, 0.5) + random.standard_normal(rows)
            best = np.linalg.lstsq(X, r, rcond=None)[0]
            gain = float(best @ (X.T @ X) @ best)
            # ∫ exp(−χ²/2) N(b; 0, 1) db over exp(−r²/2), exactly
            M = X.T @ X + np.eye(m)
            twice_ln_odds = (X.T @ r) @ np.linalg.solve(M, X.T @ r) - np.linalg.slogdet(M)[1]
            grown.append(evidence.find_bic_gain(gain, m, rows) - twice_ln_odds)
        assert grown[1] == pytest.approx(grown[0], abs=1.0)  # a forgotten ln N would be 6.9


def test_several_numbers_cost_what_makes_one_as_improbable():
    """2 ln of the ratio of the tails of χ²_q and χ²_1, but for a part of 1/z²; of few rows no more
    than ln N each."""
    for q, size in itertools.product((2, 3, 4, 6), (25.0, 36.0, 100.0)):
        more = evidence.price_numbers(q, size, 10_000) - evidence.price_numbers(1, size, 10_000)
        assert more == pytest.approx(2 * np.log(chi2.sf(size, q) / chi2.sf(size, 1)), abs=0.8)
        assert evidence.price_numbers(q, size, 8) == pytest.approx(q * np.log(8))


def test_a_useless_column_does_not_pay_its_price():
    paid = [
        evidence.find_bic_gain(*(lambda s: (s.gain, s.rank))(evidence.score("s", r, S, Q)), 400) > 0
        for _, Q, S, r in map(problem, range(300, 600))
    ]
    assert np.mean(paid) < 0.05  # χ²₁ > ln 400 by chance: 1.4 %
