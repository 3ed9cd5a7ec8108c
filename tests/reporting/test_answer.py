"""The answer: shares that are physics, words that a result earned, numbers rounded by their σ, one
answer for every screen."""

import json
import re

import numpy as np
import pytest
import records_by_hand as by_hand

from hrg_cli import store
from hrg_cli.extended import write_extended
from hrg_cli.limits import Row, check
from hrg_cli.physics import ellipse
from hrg_cli.records import Diagnosis, Resonator, Wave, collect
from hrg_cli.reporting.answer import answer
from hrg_cli.reporting.answer_text import list_untold
from hrg_cli.reporting.answer_use import build_matrix, write_snippet
from hrg_cli.reporting.answer_words import (
    Cause,
    Departure,
    make_sentence,
    order_causes,
    say_size,
)
from hrg_cli.reporting.figures.answer import plot_before_and_after
from hrg_cli.reporting.methods_paragraph import CITATIONS, write_methods
from hrg_cli.reporting.quantities import (
    format_parameter,
    format_quantity,
    format_unit,
    label_of,
    round_with_std,
)
from hrg_cli.stages.demodulate import demodulate
from hrg_cli.stages.diagnose import diagnose
from hrg_cli.stages.diagnosis.report.shares import (
    compute_departure_figures,
    compute_difference,
    list_sets_left_out,
)
from hrg_cli.stages.estimate import estimate
from hrg_cli.stages.simulate import list_run_ids, simulate
from hrg_cli.units import DEGREE_PER_HOUR

GAIN, DAMPING = 0.004, 2e-3


def programme(effects):
    """Waves of the demonstration's gyro with these effects, shorter."""
    runs = [(0.1, 0.0), (0.5, 0.0), (0.9, 1.5), (1.3, -1.5)]
    config = {
        "device": {
            "frequency_hz": 1003.7, "time_constant_s": 2.5, "damping_split": 0.05, "damping_axis_rad": 0.35,
            "frequency_split_rad_s": 0.4, "stiffness_axis_rad": 0.9, "scale_factor": 0.554,
        },
        "effects": effects,
        "readout": {"noise": 5e-4},
        "recording": {"sample_rate_hz": 8000.0, "duration_s": 2.0, "gyro_id": "G"},
        "run": [
            {"run_id": str(k), "start": {"wave_angle_rad": angle}, "environment": {"rate_rad_s": rate}}
            for k, (angle, rate) in enumerate(runs)
        ],
    }  # fmt: skip
    made = (collect(simulate(config, run=name, seed=4)) for name in list_run_ids(config))
    return [collect(estimate(collect(demodulate(one, periods_per_window=10)))) for one in made]


@pytest.fixture(scope="module")
def two_faults():
    return diagnose(
        programme({"gain_mismatch": {"gain": GAIN}, "nonlinear_damping": {"damping_1_s": DAMPING}})
    )


@pytest.fixture(scope="module")
def sound():
    return diagnose(programme({}))


def test_difference_of_two_waves_is_what_was_put_between_them():
    """A drift of 100 °/h, an amplitude 300 ppm larger and 2 mHz more, with the phase's and the
    angle's half turns in between."""
    t = np.linspace(0, 8, 400)
    theta, drift = 0.3 + 0.9 * t, 100 * DEGREE_PER_HOUR
    first = ellipse.compute_envelopes(
        1.0003 * np.exp(-0.1 * t), 0.05, theta + drift * t / 2, 2 * np.pi * 2e-3 * t + 3.0, 2
    )
    second = ellipse.compute_envelopes(np.exp(-0.1 * t), 0.05, theta, np.full(len(t), 3.0), 2)
    rows = [np.concatenate([u.real, u.imag], axis=1) for u in (first, second)]
    found = compute_departure_figures(compute_difference(*rows), np.zeros(len(t), int), t)
    assert found["drift_deg_h"] == pytest.approx(100, rel=1e-6)
    assert found["amplitude_ppm"] == pytest.approx(300, rel=1e-3)
    assert found["frequency_hz"] == pytest.approx(2e-3, rel=1e-6)


def test_a_round_wave_has_no_angle():
    round_ = ellipse.compute_envelopes(
        np.ones(50), np.full(50, 0.99), np.linspace(0, 1, 50), np.zeros(50), 2
    )
    rows = np.concatenate([round_.real, round_.imag], axis=1)
    assert (
        compute_departure_figures(
            compute_difference(rows, rows), np.zeros(50, int), np.arange(50.0)
        )["drift_deg_h"]
        is None
    )


def test_shares_of_the_causes(two_faults):
    """What is left without one cause is what the fit without it leaves: all without any is the base
    model, and no share is negative."""
    report = json.loads(two_faults.report)
    assert {e["name"] for e in report["effects"]} == {"gain_mismatch", "nonlinear_damping"}
    sets = [tuple(s) for s in json.loads(two_faults.left_out)]
    assert set(map(frozenset, sets)) == {
        frozenset(s)
        for s in (
            ("gain_mismatch", "nonlinear_damping"),
            ("gain_mismatch",),
            ("nonlinear_damping",),
        )
    }
    both = max(range(len(sets)), key=lambda k: len(sets[k]))
    assert np.array_equal(two_faults.simulated_without[:, :, both], two_faults.simulated_before)
    chi2 = [
        np.sum((two_faults.measured - two_faults.simulated_without[:, :, k]) ** 2) for k in range(3)
    ]
    full = np.sum((two_faults.measured - two_faults.simulated_after) ** 2)
    assert all(full < one <= chi2[both] * 1.01 for one in chi2)
    shares = {e["name"]: e["share"] for e in report["effects"]}
    assert (
        shares["gain_mismatch"]["drift_deg_h"] > 3 * shares["nonlinear_damping"]["drift_deg_h"] > 0
    )
    stds = [v["std"] for v in report["values"]]
    assert np.sqrt(np.diag(report["covariance"])) == pytest.approx(stds, rel=1e-9)


def test_sets_that_are_fitted():
    assert list_sets_left_out(["a"]) == [] and len(list_sets_left_out(["a", "b", "c"])) == 6
    many = list_sets_left_out(["a", "b", "c", "d", "e"])
    assert {("a",), ("e",), ("d", "e"), ("b", "c", "d", "e")} <= set(many) and len(many) == len(
        set(many)
    ) == 8


def test_a_fault_is_the_answer(two_faults):
    found = answer([two_faults], (), {"diagnosis": "d.h5"})
    assert (
        found.health == "fault found" and found.validity == "valid" and found.verdict == "explained"
    )
    assert (
        found.sentence.startswith("The drift is ")
        and "is a gain mismatch of " in found.sentence
        and len(found.sentence) < 230
    )
    said = re.search(r"gain mismatch of ([\d.]+)\((\d+)\) %", found.sentence)
    assert abs(float(said[1]) - 100 * GAIN) < 5e-4 * float(said[2])
    assert (
        found.causes[0].name == "gain_mismatch"
        and found.departure.before > 5 * found.departure.after
    )
    assert {p.name: p for p in found.parameters}["damping_rate_1_s"].text.startswith(
        "2.50"
    ) and found.parameters_of == "extended model"
    assert json.loads(json.dumps(found.to_json()))["health"] == "fault found"


def test_what_was_not_found_is_scored_beside_what_was(two_faults):
    """Two faults of some hundred σ reach causes that imitate them; nothing of that is left."""
    tested = [t for t in two_faults.told("tested") if t["visible"]]
    others = [t for t in tested if t["upper_limit"] is not None]
    assert len(others) > 10 and max(t["z"] for t in others) > 20
    assert max(t["z_left"] for t in others) < 4


def test_a_sound_gyro_is_the_answer(sound):
    found = answer([sound])
    assert (found.health, found.validity, found.causes, found.next_runs) == (
        "sound",
        "valid",
        (),
        (),
    )
    assert "no fault was found" in found.sentence


def test_the_snippet_undoes_the_readout(two_faults):
    """C put right by (1 + E)⁻¹: what the snippet multiplies by takes a gain mismatch away."""
    matrix = build_matrix({"gain_mismatch": {"gain": GAIN}})
    assert matrix == pytest.approx(np.diag([1 + GAIN / 2, 1 - GAIN / 2]))
    assert (
        build_matrix({"pickoff_nonlinearity": {"cubic": 1e-3}}) is None
        and build_matrix({"converter_nonlinearity": {"mid_scale": 60.0, "step": 0.0}}) is None
        and build_matrix({"nonlinear_damping": {"damping_1_s": 1e-3}}) is None
    )
    found = answer([two_faults])
    size = json.loads(two_faults.report)["effects"][0]["parameters"]
    assert "double c1 = 0.99" in found.snippet and "rate_rad_s" in found.snippet and size
    assert write_snippet({}, None, ()) == ""
    tables = answer([two_faults, by_hand.calibration()])
    assert "c1" not in tables.snippet and "hrg_rate_rad_s" in tables.snippet, (
        "the tables were made of the channels as they are"
    )


@pytest.mark.parametrize(
    ("verdict", "change", "health", "validity"),
    [
        ("adequate", {"effects": []}, "sound", "valid"),
        ("explained", {}, "fault found", "valid"),
        ("partly explained", {}, "fault found", "suspect"),
        ("unexplained", {"effects": []}, "in doubt", "suspect"),
        (
            "explained",
            {"effects": [{"name": "rate_bias", "parameters": {}}]},
            "bench fault",
            "valid",
        ),
    ],
)
def test_two_words(verdict, change, health, validity):
    record = by_hand.diagnosis()
    record = record.replace(
        verdict=verdict,
        report=json.dumps(json.loads(record.report) | change | {"verdict": verdict}),
    )
    found = answer([record])
    assert (found.health, found.validity) == (health, validity)


def test_a_size_of_many_parameters_is_the_one_that_stands_clearest_off_zero():
    """Whatever its unit: a knock's phase in radians is a larger number than its velocity."""
    knock = {
        "c_velocity_over_omega": {"value": 9.95e-4, "std": 8e-6, "units": "amplitude"},
        "s_velocity_over_omega": {"value": -1.4e-6, "std": 5e-6, "units": "amplitude"},
        "phase_rad": {"value": 2e-3, "std": 5e-3, "units": "rad"},
    }
    assert say_size({"parameters": knock}) == "995(8) ppm of the unit amplitude"
    assert (
        say_size({"parameters": dict(reversed(knock.items()))})
        == "995(8) ppm of the unit amplitude"
    )


def test_a_size_without_a_sign_is_given_by_its_magnitude():
    """A harmonic in the samples fixes how large a cubic is, to a tenth, and not its sign: the answer
    says ± 0.070(7), not 0.07 ± 0.07."""
    sized = {
        "name": "pickoff_nonlinearity",
        "parameters": {"cubic": {"value": 0.07, "std": 0.07, "units": "amplitude-2"}},
        "magnitude": {"cubic": 0.07},
        "magnitude_std": {"cubic": 0.007},
    }
    assert say_size(sized).startswith("± 0.070(7)")
    assert say_size({"parameters": sized["parameters"]}).startswith("0.07(7)")
    # a converter's codes are told whole, beside a size whose sign is not known
    step = {"value": 0.1, "std": 1e-4, "units": "amplitude"}
    sized["parameters"]["step"] = step
    sized["magnitude"]["step"], sized["magnitude_std"]["step"] = 0.1, 1e-4
    assert say_size(sized).startswith("± 0.070(7)")


def test_what_later_versions_write_is_said():
    """Failed checks, forecast, suspect runs and stability, in words; a file without them says
    nothing of them."""
    record = by_hand.diagnosis()
    more = {
        "checks": [
            {"name": "white_residual", "value": 3.2, "limit": 1.5, "passed": False},
            {"name": "x", "value": 1, "limit": 2, "passed": True},
        ],
        "forecast": {"before": 12.0, "after": 3.0, "ratio": 4.0, "low": 3.0, "high": 5.0, "unit": "deg_h"},
        "suspect_runs": [{"run_id": "r7", "what": "its amplitude steps", "evidence": "12 sigma"}],
        "stability": [{"change": "windows of twice the length", "effects": ["gain_mismatch"]}],
    }  # fmt: skip
    found = answer([record.replace(report=json.dumps(json.loads(record.report) | more))])
    assert found.why[0] == "check failed: white residual is 3.2, the limit is 1.5"
    assert found.forecast == "forecast of data left out: error 12 → 3 °/h, 4 times smaller (3 … 5)"
    assert found.suspect_runs == ("run r7: its amplitude steps (12 sigma)",)
    assert found.stability == ("with windows of twice the length the causes are gain mismatch",)
    bare = answer([record.replace(report="{}")])
    assert (bare.why, bare.forecast, bare.suspect_runs, bare.stability, bare.causes) == (
        (),
        "",
        (),
        (),
        (),
    )


def test_stability_asks_again_only_what_a_part_of_the_runs_can_show():
    """A cause that the frequencies of all runs show is not sought in half of them; what two halves
    say alike is said once."""
    record = by_hand.diagnosis()
    found = [{"name": "thermal_frequency"}, {"name": "gain_mismatch"}]
    more = {
        "effects": found,
        "frequencies": {"follow": ["thermal_frequency"]},
        "stability": [{"change": "half of the runs", "effects": ["gain_mismatch"]}] * 2,
    }
    said = answer([record.replace(report=json.dumps(json.loads(record.report) | more))])
    assert said.stability == ("the same causes under all 2 changes of the evaluation",)
    more["stability"] = [{"change": "half of the runs", "effects": []}] * 2
    said = answer([record.replace(report=json.dumps(json.loads(record.report) | more))])
    assert said.stability == ("with half of the runs the causes are none",)


def test_requirements_have_a_margin():
    row = Row("scale_factor", 0.55, 0.5, 0.56, True, std=0.002)
    assert row.margin_sigma == pytest.approx(5.0)
    found = answer([by_hand.diagnosis()], [row, Row("causes", 2.0, None, 0.0, False)])
    assert (
        found.requirements[0].value == "0.5500(20)"
        and found.requirements[0].limit == "≥ 0.5 and ≤ 0.56"
    )
    assert not found.requirements[1].passed and found.requirements[1].margin_sigma is None


def test_the_extended_resonator_is_a_resonator(two_faults, tmp_path):
    output = tmp_path / "d.h5"
    written = store.write(output, two_faults)
    model, path = write_extended(written, output, force=False)
    resonator = store.read(path, Resonator)
    assert (
        model.name == "d.extended.toml"
        and path.name == "d.extended_resonator.h5"
        and resonator.status == "valid"
    )
    values = resonator.parameters()
    for name, truth in (
        ("damping_rate_1_s", 0.4),
        ("scale_factor", 0.554),
        ("frequency_split_rad_s", 0.4),
    ):
        value, std, _ = values[name]
        assert abs(value - truth) < 5 * std, name
    assert resonator.provenance.sources[0].kind == "diagnosis"
    assert store.read(path, Resonator).covariance[1, 1] == pytest.approx(
        values["damping_rate_1_s"][1] ** 2
    )


def test_what_to_type_next_runs_as_it_stands(two_faults, tmp_path, monkeypatch, hrg):
    """Beside the files, and nowhere else, with nothing that the folder does not hold."""
    output = tmp_path / "d.h5"
    write_extended(store.write(output, two_faults), output, force=False)
    typed = hrg("info", output, "--json").json["answer"]["commands"]
    assert [line.split()[1] for line in typed] == ["simulate", "plan"]
    monkeypatch.chdir(tmp_path)
    for line in typed:
        done = hrg(*line.split()[1:])
        assert done.status == 0, (line, done.err)
    assert len(list(tmp_path.glob("twin*.h5"))) == 4  # a file a run
    assert (tmp_path / "next.toml").is_file()


def test_an_open_verdict_makes_its_resonator_suspect(two_faults, tmp_path):
    store.write(tmp_path / "d.h5", two_faults.replace(verdict="partly explained"))
    _, path = write_extended(
        store.read(tmp_path / "d.h5", Diagnosis), tmp_path / "d.h5", force=False
    )
    assert store.read(path, Resonator).status == "suspect"


@pytest.mark.parametrize(
    ("value", "std", "text"),
    [
        (1003.7000003, 9.8e-7, "1003.7000003(10)"),
        (0.4, 0.0012, "0.4000(12)"),
        (0.4, 0.0062, "0.400(6)"),
        (1234.0, 56.0, "1230(60)"),
        (-2e-3, 1.8e-4, "−0.00200(18)"),
        (1.57e-9, 3e-11, "1.570(30)×10⁻⁹"),
        (0.25, None, "0.25"),
        (0.25, 5e-324, "0.25"),
        (float("nan"), 1.0, "–"),
    ],
)
def test_rounded_by_sigma(value, std, text):
    assert round_with_std(value, std) == text


def test_units_of_people():
    assert (
        format_quantity("gain", 0.004, 1.5e-5, "1") == "0.4000(15) %"
        and format_quantity("gain", 4e-4, 1.5e-6, "1") == "400.0(15) ppm"
    )
    assert (
        format_quantity("rate_rad_s", 5 * DEGREE_PER_HOUR, 0.1 * DEGREE_PER_HOUR, "rad s-1")
        == "5.00(10) °/h"
    )
    assert (
        format_quantity("frequency_split_rad_s", np.pi, 0.0, "rad s-1") == "1000 mHz"
        and format_quantity("x_axis_rad", np.pi / 2, None, "rad") == "90 °"
    )
    assert (
        format_unit("rad s-1 K-1") == "rad/(s·K)"
        and format_unit("s-2") == "1/s²"
        and format_unit("1") == ""
    )


def test_waves_alone_have_no_answer():
    assert answer([by_hand.wave()]) is None and isinstance(by_hand.wave(), Wave)


def test_tables_that_measure_the_quadrature_say_so_in_equation_and_snippet():
    """Of a model with a measured part, a rate computed without it is wrong."""
    plain = by_hand.calibration()
    part = {"kind": "quadrature", "coefficients": [[1e-3, 2e-3]], "exact": True}
    measured = plain.replace(
        model="quadrature", details=json.dumps(json.loads(plain.details) | {"measured": part})
    )
    without, with_it = answer([plain]), answer([measured])
    assert "D_r" not in without.equation and "theta, dtheta_dt, 0.0" in without.snippet
    assert "a_B/a_A" in with_it.equation
    assert "hrg_measured_drift_rad_s(x, theta, ratio, frequency_hz)" in with_it.snippet
    assert "theta, dtheta_dt, measured)" in with_it.snippet


@pytest.mark.parametrize(
    ("value", "std", "label", "said"),
    [
        (0.4, 1e-3, "decay time τ", "2.500(6) s"),
        (-0.0038, 0.0019, "damping rate ν", "−0.0038(19) 1/s"),
        (0.0019, 0.0019, "damping rate ν", "0.0019(19) 1/s"),
    ],
)
def test_a_damping_that_may_be_none_is_no_decay_time(value, std, label, said):
    assert label_of("damping_rate_1_s", value, std) == label
    assert format_parameter("damping_rate_1_s", value, std, "s-1") == said


def test_reasons_that_the_answer_tells_are_not_told_again():
    why = ("check failed: the noise is louder (noise is 2, the limit is 1)", "one rate only")
    reasons = [
        "calibration.h5: one rate only",
        'diagnosis.h5: the verdict is "unexplained": the noise is louder',
        'diagnosis.h5: the verdict is "unexplained": the noise is louder; and another',
        "run.periods.h5: channel S is all zero",
        "frequency_split_rad_s is 0.4, at most 0.3 was wanted",
    ]
    assert list_untold(reasons, why) == reasons[2:]


def test_tables_of_dwells_have_their_own_equation_and_no_c(tmp_path, hrg):
    rate = np.tile(np.linspace(-2, 2, 9), 4)
    output = 3.0 * (rate + 0.01 * rate**2 + 1e-3) + 1e-5 * np.sin(np.arange(36) * 7.0)
    table = tmp_path / "dwells.csv"
    table.write_text(
        "out,rate\n" + "".join(f"{o!r},{r!r}\n" for o, r in zip(output.tolist(), rate.tolist()))
    )
    file = tmp_path / "g.h5"
    done = hrg("calibrate", table, "--output-column", "out", "--rate-column", "rate", "-o", file)
    assert done.status == 0, done.err
    found = hrg("info", file, "--json").json["answer"]
    assert "output" in found["equation"] and "θ" not in found["equation"] and not found["snippet"]
    assert hrg("export", file, "-o", tmp_path / "g.h").status == 1
    assert found["commands"][0].endswith(".json")
    assert hrg("export", file, "-o", tmp_path / "g.json").status == 0
    told = json.loads((tmp_path / "g.json").read_text())
    at = dict(zip(told["powers"], told["power_coefficients"]))
    seen = (
        output / told["nominal_scale"] + told["drift_harmonics"][0][0]
        - sum(c * rate**p for p, c in at.items())
    ) / told["scale_factor_harmonics"][0][0]  # fmt: skip
    assert seen == pytest.approx(rate, abs=1e-4)


def test_one_signal_has_no_equation_of_a_wave_and_only_what_is_cited_is_listed():
    modes = by_hand.resonator().replace(
        name=np.array(["frequency_hz", "damping_rate_1_s"], object), value=np.array([526.0, 0.13]),
        std=np.array([1e-3, 1e-3]), units=np.array(["Hz", "s-1"], object), covariance=np.eye(2) * 1e-6,
    )  # fmt: skip
    assert modes.modes_alone
    assert answer([modes]).equation == ""
    paragraph = write_methods([modes], {"recording": 1})
    assert "axes and the scale factor" not in paragraph.text
    assert paragraph.citations == (CITATIONS[2],) and "[1]" in paragraph.text
    both = write_methods([by_hand.resonator(), by_hand.diagnosis()], {"wave": 4})
    assert both.citations == (CITATIONS[0], CITATIONS[2])
    assert re.findall(r"\[(\d)\]", both.text) == ["1", "2"], "no number is left out"


def test_without_causes_nothing_is_said_of_them():
    """A sound gyro's page had a bar that filled its panel, called "Whose it is", and told what a
    cause's share is."""
    record = by_hand.diagnosis()
    report = json.loads(record.report) | {"effects": [], "verdict": "adequate"}
    sound = record.replace(report=json.dumps(report), verdict="adequate")
    told = write_methods([sound], {"wave": 4}).text
    assert "none was" in told and "share" not in told and "0 were" not in told
    made = answer([sound])
    plot = plot_before_and_after(sound, made.departure, made.causes)
    assert len(plot.figure.axes) == 1 and plot.title == "What is left"
    found = answer([record])
    plot = plot_before_and_after(record, found.departure, found.causes)
    assert len(plot.figure.axes) == 2 and plot.title == "Before and after"


def test_requirements_of_two_files_are_told_apart_in_words():
    rows = check(by_hand.resonator(), {"frequency_split_rad_s": 1.0, "status": "any"})
    rows += check(by_hand.diagnosis(), {"status": "any", "values.frequency_split_rad_s": 1.0})
    found = answer([by_hand.diagnosis()], rows)
    assert [r.label for r in found.requirements] == [
        *("status, resonator", "frequency split Δf, resonator"),
        *("status, diagnosis", "frequency split Δf, diagnosis"),
    ]
    assert answer([by_hand.diagnosis()], rows * 3) == found, "what files say alike is said once"
    assert [r.label for r in answer([by_hand.diagnosis()], rows[:2]).requirements] == [
        *("status", "frequency split Δf"),
    ]


def test_a_large_split_is_told_in_hertz():
    assert (
        format_quantity("frequency_split_rad_s", 10.1 * np.pi, 0.06 * np.pi, "rad s-1")
        == "10.10(6) Hz"
    )
    assert format_quantity("frequency_split_rad_s", 0.1 * np.pi, 1e-4 * np.pi, "rad s-1").endswith(
        "mHz"
    )


def test_a_cause_that_moves_nothing_is_not_what_made_the_drift():
    nothing = Departure("drift_deg_h", "drift", "°/h", 35.6, 35.6, False)
    tone = Cause("mains_tone", "mains tone", "1e-3", "read-out", 9.0, None, None, None, None, ())
    assert make_sentence("partly explained", {}, nothing, [tone], 2) == (
        "The drift is 35.6 °/h off: what was found is a mains tone of 1e-3, which makes next to none"
        " of that."
    )


@pytest.mark.parametrize(
    ("weak", "strong", "first"),
    [(0.05, 52.0, "cubic_stiffness"), (0.05, None, "cubic_stiffness"), (9.0, 4.0, "gain_step")],
)
def test_the_largest_cause_comes_first_though_its_share_is_not_known(weak, strong, first):
    """The model without the largest cause is the one that may not settle."""
    shares = {"gain_step": (7.0, weak), "cubic_stiffness": (92.0, strong)}
    effects = [
        {"name": name, "z": z, "share": None if part is None else {"drift_deg_h": part}}
        for name, (z, part) in shares.items()
    ]
    assert order_causes({"effects": effects}, None)[0].name == first
