"""Signals that are late beside the temperature logs of all runs, as a lock-in's filter makes them: the
frequency follows dT/dt as well, as beside a gradient across the shell, and the report says both."""

from types import SimpleNamespace

import numpy as np
import pytest
from diagnosis_programme import programme, waves

from hrg_cli.stages.diagnose import diagnose, summarise
from hrg_cli.stages.diagnosis.search.late_thermometers import list_late_thermometers

LATE_S = 0.03


def test_a_gradient_says_that_the_signals_may_be_late():
    table = programme(5, {"thermal_frequency": {"relative_1_k": 3e-7}}, runs=4, cycle=True)
    late = []
    for wave in waves(table):
        t, log = np.asarray(wave.time_s), np.asarray(wave.temperature_degc, float)
        inside = slice(10, -10)
        early = np.interp(t + LATE_S, t, log)[inside]
        late.append(wave.picked(inside).replace(temperature_degc=early))
    out = summarise(diagnose(late))
    assert {one["name"] for one in out["effects"]} >= {"thermal_frequency", "thermal_gradient"}
    (told,) = [one for one in out["not_separable"] if one["effects"] == ["thermal_gradient"]]
    assert "the signals of all runs" in told["base"]
    size = float(told["base"].split(", ")[1].split(" ±")[0])
    assert size == pytest.approx(LATE_S, rel=0.05)


def with_causes(of_rate, of_split):
    """What a fit says of a frequency that follows T and dT/dt."""
    values = {
        "thermal_frequency": {"relative_1_k": 2e-7},
        "thermal_gradient": {
            "frequency_s_k": of_rate, "split_cos_rad_k": of_split, "split_sin_rad_k": 0.0
        },
    }  # fmt: skip
    active = [(SimpleNamespace(name=name), parts) for name, parts in values.items()]
    return SimpleNamespace(
        point=SimpleNamespace(active=active),
        values=values.__getitem__,
        parameter_std=lambda effect, name: 1e-9,
    )


def test_logs_that_are_late_and_a_gradient_of_the_split():
    (told,) = list_late_thermometers(with_causes(1e-6, 0.0))
    assert told["base"] == "the temperature logs of all runs, 5 ± 0.005 s late"
    assert list_late_thermometers(with_causes(1e-6, 1e-7)) == []
