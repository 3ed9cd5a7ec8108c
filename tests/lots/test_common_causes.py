"""Causes in common: found below one gyro's threshold in the whole lot, at a station, since a day;
told from individual ones; not invented."""

import json
import time

import lots_by_hand
import numpy as np
import pytest

from hrg_cli.lots.common_causes import estimate_beside, find_common_causes, gather_estimates
from hrg_cli.lots.groups import Group, Origin, list_groups
from hrg_cli.lots.lot_diagnosis import diagnose_lot, size_cause
from hrg_cli.lots.shifts import estimate_populations, find_shifts

GAIN = "gain_mismatch.gain"
RIVAL = "phase_mismatch.phase_rad"
BELOW = 1.5
"""σ a gyro: no diagnosis of one names it."""


def days(count):
    """Nine months of production, gyros in order."""
    return [f"2026-{1 + 9 * k // count:02d}-{1 + k % 28:02d}" for k in range(count)]


def lot(seed, gyros=40, at=lambda origin: True, size=BELOW, spread=0.0, dated=True):
    """Scores and origins of a lot; `at`: the gyros that have a gain mismatch of `size` σ."""
    rng = np.random.default_rng(seed)
    dates = days(gyros) if dated else [""] * gyros
    origins = [
        Origin({"station": "12"[k % 2], "fixture": "ABC"[k % 3]}, dates[k]) for k in range(gyros)
    ]
    scores = [
        lots_by_hand.scores(rng, {GAIN: size} if at(origin) else {}, spread) for origin in origins
    ]
    return scores, origins


def test_a_common_cause_of_a_sigma_and_a_half_is_found():
    for seed in range(8):
        found = find_common_causes(*lot(seed))
        (one,) = found.causes
        assert GAIN in (one.name, *one.rivals) and one.group.describe() == "all gyros"
        assert one.p_value < 0.01 and one.gyros >= 38
        if one.name == GAIN:
            assert abs(one.value - BELOW * 3e-4) < 4 * one.std and one.std < 1e-4


def test_a_station_among_two_is_named():
    right = 0
    for seed in range(12):
        found = find_common_causes(*lot(seed, at=lambda origin: origin.groups["station"] == "2"))
        right += [c.group.describe() for c in found.causes] == ["all gyros of station 2"]
        assert all(c.group.by in ("station", "") for c in found.causes)
    assert right >= 9  # power 0.95 a lot; 12 lots: fewer than 9 in one of 500


def test_a_cause_since_a_day_is_told_as_such():
    """A defect since the fifth of nine months at one station."""
    wanted = lambda origin: origin.groups["station"] == "2" and origin.day >= "2026-05"  # noqa: E731
    (one,) = find_common_causes(*lot(3, gyros=90, at=wanted, size=2.0)).causes
    assert (one.group.by, one.group.value) == ("station", "2")
    assert "2026-04" <= one.group.since <= "2026-06"
    assert GAIN in (one.name, *one.rivals)


@pytest.mark.parametrize("spread", [0.0, 1.0])
@pytest.mark.parametrize("lots", [25, pytest.param(400, marks=pytest.mark.slow)])
def test_clean_lots_are_given_nothing_at_the_stated_rate(spread, lots):
    """Also where every gyro has causes of its own, as large as its σ. At 1 %: 0.25 or 4 ± 2 lots."""
    false = sum(
        bool(find_common_causes(*lot(s, size=0.0, spread=spread)).causes) for s in range(lots)
    )
    assert false <= (2 if lots == 25 else 10)


def test_causes_alike_are_told_as_rivals_and_not_twice():
    """A cause of correlation 0.9 is either the one named or its rival; never a second one."""
    for seed in range(4):
        found = find_common_causes(*lot(seed, gyros=60))
        names = {c.name for c in found.causes}
        assert len(found.causes) == 1 and names <= {GAIN, RIVAL}


def test_many_gyros_tell_alike_causes_apart():
    (one,) = find_common_causes(*lot(0, gyros=200, size=4.0)).causes
    assert one.name == GAIN and one.rivals == ()


def test_two_causes_are_both_found():
    rng = np.random.default_rng(2)
    origins = [Origin({"station": "12"[k % 2]}) for k in range(60)]
    bias = "rate_bias.rate_rad_s"
    scores = [
        lots_by_hand.scores(rng, {GAIN: 2.5} | ({bias: 2.0} if o.groups["station"] == "1" else {}))
        for o in origins
    ]
    found = {c.name: c.group.describe() for c in find_common_causes(scores, origins).causes}
    assert found == {GAIN: "all gyros", bias: "all gyros of station 1"}


def test_an_individual_cause_stays_individual():
    """A gyro with a hundredfold mismatch neither makes a common cause nor hides one."""
    scores, origins = lot(1, size=0.0)
    scores[7]["value"][0] = 100 * scores[7]["std"][0]
    assert find_common_causes(scores, origins).causes == ()
    scores, origins = lot(1)
    scores[7]["value"][0] = 100 * scores[7]["std"][0]
    (one,) = find_common_causes(scores, origins).causes
    assert one.name != GAIN or one.alone == (7,)


def test_beside_is_the_estimate_with_the_other_free():
    """The same as least squares with both columns."""
    rng = np.random.default_rng(0)
    S = rng.standard_normal((50, 3)) @ rng.standard_normal((3, 3))
    r = rng.standard_normal(50)
    size = np.linalg.norm(S, axis=0)
    R = S.T @ S / size / size[:, None]
    one = {
        "names": ["a.p", "b.p", "c.p"],
        "units": ["1"] * 3,
        "value": (S.T @ r / size**2).tolist(),
        "std": (1 / size).tolist(),
        "correlation": [R[k, :k].tolist() for k in range(3)],
    }
    both = estimate_beside(estimate_beside(gather_estimates([one]), 0, [0]), 2, [0])
    C = np.linalg.inv(S.T @ S)
    np.testing.assert_allclose(both.value[0, 1], (C @ S.T @ r)[1], rtol=1e-9)
    np.testing.assert_allclose(both.std[0, 1], np.sqrt(C[1, 1]), rtol=1e-9)


def test_groups_are_named_once_and_never_too_small():
    origins = [Origin({"station": "12"[k % 2], "fixture": "AB"[k % 2]}) for k in range(12)]
    found = list_groups(origins)
    assert [g.describe() for g in found] == [
        "all gyros",
        "all gyros of station 1 (which is fixture A)",
        "all gyros of station 2 (which is fixture B)",
    ]
    assert list_groups(origins[:4]) == []
    assert len({g.members for g in list_groups([Origin({}, d) for d in days(300)])}) < 30


def test_a_station_whose_scale_factor_differs_is_named():
    rng = np.random.default_rng(4)
    origins = [Origin({"station": "12"[k % 2]}, day) for k, day in enumerate(days(40))]
    gyros = [
        {
            "frequency_hz": (5000 + 8 * rng.standard_normal(), 1e-4),
            "scale_factor": (
                0.554 + 1e-4 * rng.standard_normal() + 3e-4 * (o.groups["station"] == "2"),
                2e-5,
            ),
        }
        for o in origins
    ]
    (one,), tested = find_shifts(gyros, origins)
    assert one.name == "scale_factor" and one.group.by == "station" and tested > 2
    assert abs(abs(one.value) - 3e-4) < 4 * one.std
    clean = [{"scale_factor": (0.554 + 1e-4 * rng.standard_normal(), 2e-5)} for _ in origins]
    assert find_shifts(clean, origins)[0] == ()


def test_the_population_is_what_is_left_without_the_measurement():
    rng = np.random.default_rng(6)
    gyros = [
        {"scale_factor": (0.5 + rng.normal(0, np.hypot(3e-4, 4e-4)), 4e-4)} for _ in range(400)
    ]
    (one,) = estimate_populations(gyros)
    assert abs(one.spread - 3e-4) < 4 * one.spread_std < 3e-4
    assert one.measured_std == 4e-4 and abs(one.mean - 0.5) < 4 * one.mean_std


def test_the_report_says_it_in_words_and_json():
    rng = np.random.default_rng(8)
    gyros, origins = [], {}
    for k in range(40):
        origins[f"G{k}"] = Origin({"station": "12"[k % 2]})
        own = {GAIN: 2.0} if k % 2 else {}
        fault = ("gain_mismatch", "0.06 %", 0.5, 10.0) if k == 3 else None
        gyros.append(lots_by_hand.gyro(rng, f"G{k}", sizes=own, fault=fault))
    report = diagnose_lot(gyros, [{} for _ in gyros], origins, 0.02)
    (one,) = report["lot_causes"]
    assert one["sentence"].startswith("all gyros of station 2: gain mismatch ")
    assert one["sentence"].endswith(("ppm", "%")) and one["group"] == {
        "by": "station",
        "value": "2",
    }
    assert one["named_alone_by"] == ["G3"] and len(one["members"]) == 20
    assert abs(one["others"]["value"]) < 4 * one["others"]["std"]
    assert report["lot_tests"]["rate"] == 0.02 and report["lot_tests"]["pairs"] == 30
    assert GAIN in report["populations"]
    json.dumps(report, allow_nan=False)
    refused = [{**g, "results": {"diagnose": {"status": "refused", "scores": None}}} for g in gyros]
    assert diagnose_lot(refused, [{} for _ in gyros], origins, 0.02)["lot_causes"] == []


def test_sizes_are_rounded_by_their_sigma():
    assert size_cause("gain", 5.04e-4, 1.0e-4, "1") == "500 ± 100 ppm"
    assert size_cause("gain", 5.04e-3, 1.03e-4, "1") == "0.504 ± 0.010 %"
    assert size_cause("gain", -2e-2, 3e-3, "1") == "−2.00 ± 0.30 %"


def test_time_grows_in_proportion_to_the_gyros():
    def taken(gyros):
        scores, origins = lot(0, gyros=gyros, dated=False)
        best = np.inf
        for _ in range(3):
            started = time.process_time()
            find_common_causes(scores, origins)
            best = min(best, time.process_time() - started)
        return best

    assert taken(400) < 8 * taken(100)  # quadratic would be 16


def test_a_group_is_told_in_words():
    group = Group((0, 1), "station", "2", since="2026-05-04")
    assert group.describe() == "all gyros of station 2 since 2026-05-04" and group.depth == 2
