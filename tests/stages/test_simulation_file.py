"""The simulation file: what is wrong is said in one sentence that names the key and what was
meant."""

import copy

import pytest

from hrg_cli.errors import HrgError
from hrg_cli.stages.simulation_file import list_runs

GOOD = {
    "device": {"frequency_hz": 5000.0, "time_constant_s": 3.0},
    "recording": {"sample_rate_hz": 40_000.0, "duration_s": 1.0},
}


def changed(**tables):
    tree = copy.deepcopy(GOOD)
    for name, values in tables.items():
        tree[name] = tree.get(name, {}) | values if isinstance(values, dict) else values
    return tree


@pytest.mark.parametrize(
    ("tables", "sentence"),
    [
        ({"device": {"frequncy_split_hz": 0.1}}, r"unknown key device.frequncy_split_hz \(did you mean frequency_split_hz\?\)"),
        ({"devise": {}}, r"unknown key devise \(did you mean device\?\)"),
        ({"device": {"frequency_hz": "5 kHz"}}, r"device.frequency_hz = '5 kHz': input should be a valid number"),
        ({"device": {"frequency_hz": -1.0}}, r"device.frequency_hz = '-1.0': input should be greater than 0"),
        ({"device": {"frequency_hz": float("nan")}}, r"device.frequency_hz"),
        ({"device": {"quality_factor": 1e4}}, r"one of .*damping_rate_1_s was expected, not quality_factor and time_constant_s"),
        ({"device": {"damping_split": 0.1, "damping_split_1_s": 0.1}}, r"damping_split and damping_split_1_s say the same; give one"),
        ({"device": {"damping_split_1_s": 0.5}}, r"one axis would gain energy"),
        ({"device": {"mode_number": 2.0}}, r"device.mode_number"),
        ({"recording": {"start_time": "noon"}}, r'start_time = "noon" is no ISO 8601 time; write it as "2026-05-04T14:03:22Z"'),
        ({"start": {"quadrature": 2.0}}, r"the quadrature 2 exceeds the amplitude 1"),
        ({"readout": {"kind": "carrier"}}, r'carrier_hz belongs to kind = "carrier"'),
        ({"readout": {"carrier_hz": 5e4}}, r'carrier_hz belongs to kind = "carrier"'),
        ({"readout": {"model": "full"}}, r'gap belongs to model = "full"'),
        ({"readout": {"full_scale": 1.0}}, r"full_scale belongs to a converter"),
        ({"readout": {"kind": "optical"}}, r"readout.kind = 'optical': input should be 'direct' or 'carrier'"),
        ({"control": {"quadrature_loop": "finite"}}, r"a free run has no control, but quadrature_loop is set"),
        ({"control": {"mode": "forced", "quadrature_gain_1_s": 3.0}}, r"quadrature_gain_1_s belongs to quadrature_loop"),
        ({"control": {"mode": "forced", "off_s": [[2.0, 1.0]]}}, r"intervals \[start, stop\] with start < stop"),
        ({"environment": {"temperature": {"kind": "jump"}}}, r"environment.temperature"),
        ({"environment": {"rate": {"kind": "sine", "amplitude_rad_s": 1.0}}}, r"environment.rate.sine.frequency_hz is missing"),
        ({"environment": {"earth_latitude_rad": 46.0}}, r"environment.earth_latitude_rad"),
        ({"environment": {"earth_latitude_rad": 0.5, "earth_rate_rad_s": 1e-5}}, r"say the same; give one"),
        ({"recording": {"duration_s": 0.0}}, r"recording.duration_s"),
        ({"recording": {"sample_rate_hz": 9000.0}}, r"sample_rate_hz = 9000 must exceed 10000, twice the highest frequency"),
        ({"readout": {"kind": "carrier", "carrier_hz": 19e3}}, r"sample_rate_hz = 40000 must exceed 48000"),
        ({"readout": {"kind": "carrier", "carrier_hz": 3e3}}, r"carrier_hz = 3000 must exceed the device's 5000 Hz"),
        ({"run": {"run_id": "a"}}, r"run is not an array of tables; write each run under \[\[run\]\]"),
        ({"run": [{"start": {"angle": 1.0}}]}, r"run 1 \(run1\): unknown key start.angle"),
        ({"run": [{"run_id": "a"}, {"run_id": "a"}]}, r"run_id a stands twice"),
        ({"run": [{"run_id": "a/b"}]}, r"run_id"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_said(tables, sentence):
    with pytest.raises(HrgError, match=sentence):
        list_runs(changed(**tables), "file.toml")


def test_a_missing_table_is_named():
    with pytest.raises(HrgError, match=r"file.toml: device is missing; recording is missing"):
        list_runs({}, "file.toml")


def test_runs_override_parts_and_programmes_replace_each_other():
    tree = changed(
        environment={
            "temperature_degc": 10.0,
            "rate": {"kind": "sine", "amplitude_rad_s": 1.0, "frequency_hz": 2.0},
        },
        readout={"kind": "carrier", "carrier_hz": 1e4, "noise": 1e-3},
        run=[
            {"environment": {"rate": {"kind": "steps", "levels_rad_s": [1.0], "dwell_s": 1.0}}},
            {"environment": {"rate": {"amplitude_rad_s": 3.0}}, "readout": {"noise": 2e-3}},
        ],
    )
    first, second = list_runs(tree)
    assert first.environment.rate.kind == "steps"
    assert first.environment.temperature_degc == 10.0
    assert (second.environment.rate.amplitude_rad_s, second.environment.rate.frequency_hz) == (
        3.0,
        2.0,
    )
    assert (second.readout.kind, second.readout.noise) == ("carrier", 2e-3)


def test_what_happens_in_one_run_is_in_that_one_alone():
    knock = {"c_velocity_over_omega": 1e-3, "time_s": 0.4}
    names = [{"run_id": name} for name in "abc"]

    def struck(run):
        tree = changed(effects={"momentum_kick": knock | run}) | {"run": names}
        return [run.run_id for run in list_runs(tree) if "momentum_kick" in run.effects]

    assert struck({"run": 1}) == ["b"]
    assert struck({"run": -1}) == struck({}) == ["a", "b", "c"]
    with pytest.raises(HrgError, match=r"effects.momentum_kick.run = 3 is no run .* 0 to 2"):
        struck({"run": 3})
    own = [*names[:2], {"run_id": "c", "effects": {"momentum_kick": knock}}]
    tree = changed() | {"run": own}
    assert ["momentum_kick" in run.effects for run in list_runs(tree)] == [False, False, True]


def test_integers_serve_as_numbers():
    assert list_runs(changed(device={"frequency_hz": 5000}))[0].device.frequency_hz == 5000.0


def test_damping_by_quality_factor_and_split_by_frequency_difference():
    device = {
        "frequency_hz": 5000.0,
        "quality_factor": 1e7,
        "frequency_split_hz": 1e-3,
        "damping_split": 0.01,
    }
    settings = list_runs({"device": device, "recording": GOOD["recording"]})[0].device
    assert 1 / settings.rate_1_s == pytest.approx(637, abs=0.5)
    assert settings.split_1_s == pytest.approx(1.57e-5, rel=2e-3)
    assert settings.frequency_split == pytest.approx(3.14e-3, rel=1e-3)


def test_runs_know_how_long_after_the_first_they_begin_where_all_say_when():
    times = ("2026-05-04T09:00:00Z", "2026-05-04T10:00:00+02:00", "2026-05-04T09:30:00")
    runs = [{"recording": {"start_time": text}} for text in times]
    assert [run.begun_s for run in list_runs(changed(run=runs))] == [3600.0, 0.0, 5400.0]
    assert [run.begun_s for run in list_runs(changed(run=[*runs, {}]))] == [0.0] * 4
