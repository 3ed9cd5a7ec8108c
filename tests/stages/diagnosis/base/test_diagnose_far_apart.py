"""Runs at temperatures so far apart that their frequencies beat hundreds of times a run: the mean
turn is exact, and no beat is a tone."""

from diagnosis_programme import programme, verdict

TRUE = {"thermal_frequency": ("relative_1_k", 8.8e-5), "thermal_damping": ("relative_1_k", 6e-3)}


def test_temperatures_forty_degrees_apart_are_named_with_their_sizes_and_no_tone():
    effects = {
        name: {parameter: value, "reference_temperature_degc": 20.0}
        for name, (parameter, value) in TRUE.items()
    }
    table = programme(11, effects, runs=6, forced=True)
    for k, run in enumerate(table["run"]):
        run["environment"].pop("temperature")
        run["environment"]["temperature_degc"] = (0.0, 20.0, 40.0)[k // 2]
    _, out = verdict(table)
    found = {e["name"]: e for e in out["effects"]}
    assert set(found) == set(TRUE) and out["verdict"] == "explained"
    for name, (parameter, value) in TRUE.items():
        got, held = (
            found[name]["parameters"][parameter],
            found[name]["held"]["reference_temperature_degc"]["value"],
        )
        there = value / (
            1 + value * (held - 20.0)
        )  # relative to the value at the diagnosis's own reference
        # relative to the demodulation's reference frequency, which is some millihertz beside the
        # gyro's
        assert (
            abs(got["value"] - there) < 4 * got["std"] + 1e-5 * value and got["std"] < 1e-3 * value
        )
