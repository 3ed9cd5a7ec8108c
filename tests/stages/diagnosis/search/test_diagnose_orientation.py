"""A vector coherent with the phase has its own sign in every run: (mθ, φ) and (mθ + π, φ + π) are
one wave."""

import tomllib

import numpy as np
import pytest
from diagnosis_programme import programme, verdict, waves

from hrg_cli.physics import ellipse
from hrg_cli.stages.diagnosis.search.orientation import CLIMBS, SignedNormal

OFFSET = {"in_phase_c": 1.5e-4, "in_phase_s": -5e-5, "quadrature_c": 4e-5, "quadrature_s": 1e-4}


def envelopes(wave):
    return ellipse.compute_envelopes(
        wave.main_amplitude, wave.quadrature_amplitude, wave.wave_angle_rad, wave.phase_rad
    )


def test_an_offset_is_found_whatever_sign_each_run_gives_it():
    table = programme(21, runs=6)
    signs = (1, -1, -1, 1, 1, 1)
    for sign, run in zip(signs, table["run"], strict=True):
        run["effects"] = {"coherent_offset": {k: sign * v for k, v in OFFSET.items()}}
    diagnosis, out = verdict(table)
    assert [e["name"] for e in out["effects"]] == ["coherent_offset"] and out[
        "verdict"
    ] == "explained"
    found = out["effects"][0]["parameters"]
    overall = np.sign(found["in_phase_c"]["value"])
    assert all(
        abs(overall * found[k]["value"] - v) < 4 * found[k]["std"] for k, v in OFFSET.items()
    )

    model = tomllib.loads(diagnosis.extended_model)
    for run in model["run"]:
        run["recording"] = table["recording"]
        run["readout"] = {"noise": 0.0}
    for measured, simulated in zip(waves(table), waves(model), strict=True):
        turn = np.exp(
            2j
            * np.pi
            * (measured.reference_frequency_hz - simulated.reference_frequency_hz)
            * simulated.time_s
        )
        difference = envelopes(measured) * turn[:, None] - envelopes(simulated)
        assert (
            np.sqrt(np.mean(np.abs(difference) ** 2, axis=1) / measured.signal_std**2).mean() < 1.8
        )


@pytest.mark.parametrize("runs", [6, 20])
def test_signs_that_turn_together_are_found(runs):
    """A vector of four numbers of which each run shows its own two well, and all the others a
    little: one sign after the other leads nowhere."""
    random = np.random.default_rng(runs)
    for _ in range(40):
        signs = np.append(1.0, random.choice([-1.0, 1.0], runs - 1))
        columns = random.standard_normal((30, runs, 4)) * random.choice([0.02, 1.0], (runs, 4))
        A = np.einsum("nrc,nrd->rcd", columns, columns)
        true = random.standard_normal(4)
        normal = SignedNormal(
            np.einsum("rcd,rs->rcsd", A, np.eye(runs)), (A @ true) * signs[:, None]
        )
        starts = normal.list_starts()
        best = starts[np.argsort(-normal.compute_gains(starts), kind="stable")[:CLIMBS]]
        gain, found = max((normal.climb(start) for start in best), key=lambda one: one[0])
        assert np.isclose(gain, normal.compute_gain_of_each(), rtol=1e-6)
        assert abs(found @ signs) == runs
