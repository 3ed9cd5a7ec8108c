"""`hrg check` and `hrg diff`: many files, words and units, typing errors, a baseline in σ, JUnit
and Markdown."""

import json
from xml.etree import ElementTree

import h5py
import numpy as np
import pytest
import records_by_hand as by_hand

from hrg_cli import store
from hrg_cli.chain import Step
from hrg_cli.commands.run import _judge
from hrg_cli.commands.told_differences import describe_beyond
from hrg_cli.comparing import compare, compare_tables
from hrg_cli.errors import UsageError
from hrg_cli.limit_values import find_quantity, find_unit, limit_value, suggest
from hrg_cli.limits import Row
from hrg_cli.records import Recording
from hrg_cli.reporting.quantities import format_quantity
from hrg_cli.units import DEGREE_PER_HOUR


@pytest.fixture
def results(tmp_path):
    store.write(tmp_path / "diagnosis.h5", by_hand.diagnosis())
    store.write(tmp_path / "resonator.h5", by_hand.resonator())
    return tmp_path


def limits(folder, text):
    path = folder / "limits.toml"
    path.write_text(text)
    return path


@pytest.mark.parametrize(
    ("name", "written", "value"),
    [
        ("bias_rad_s", "5 deg/h", 5 * DEGREE_PER_HOUR),
        ("drift_rms_rad_s.held_out", "0.01 °/h", 0.01 * DEGREE_PER_HOUR),
        ("scale_factor_rms_ppm.held_out", "200 ppm", 200.0),
        ("effects.gain_mismatch.gain", "200 ppm", 2e-4),
        ("gain.drift_error_deg_h.after", "1 deg/h", 1.0),
        ("damping_axis_rad", "2 deg", np.radians(2)),
        ("frequency_hz", "3 mHz", 3e-3),
        ("damping_split_1_s", "1 deg/h", DEGREE_PER_HOUR),
        ("chi2_per_dof", 2, 2.0),
        ("frequency_split_rad_s", "127.3 mHz", np.pi * 0.1273),  # Δf, as it is told
        ("frequency_split_rad_s", "23 deg/s", np.radians(23)),
        ("parameters.frequency_split_rad_s.value", "1 Hz", np.pi),
        ("effects.cubic_stiffness.pull_rad_s", "3 mHz", 2 * np.pi * 3e-3),
        ("frequency_hz", "6.283185307179586 rad/s", 1.0),
        ("frequencies.hz.0", "2 kHz", 2000.0),
        ("bias_rad_s", "1 rad s-1", 1.0),
        ("damping_rate_1_s", "2 s-1", 2.0),
        ("angle_random_walk_rad_sqrt_s", "6 deg/sqrt(h)", np.radians(0.1)),
        ("rate_random_walk_rad_s_sqrt_s", "60 °/h/√h", DEGREE_PER_HOUR),
        ("forecast.parts.after.angle_deg", "60 arcsec", 1 / 60),
        ("forecast.parts.after.amplitude_percent", "100 ppm", 0.01),
        ("trade.scale_factor_coefficient_ppm_per_node_unit", "20 ppm", 20.0),
        ("chi2_per_dof", "2", 2.0),
    ],
)
def test_limits_with_units(name, written, value):
    assert limit_value(name, written) == pytest.approx(value, rel=1e-12)


@pytest.mark.parametrize(
    ("name", "written"),
    [
        ("bias_rad_s", "5 deg"),
        ("bias_rad_s", "five"),
        ("frequency_hz", "5 ppm"),
        ("angle_random_walk_rad_sqrt_s", "5 s"),
        ("frequency_split_rad_s", "5 s"),
        ("chi2", float("inf")),
    ],
)
def test_units_of_something_else(name, written):
    with pytest.raises(UsageError, match="limit"):
        limit_value(name, written)


@pytest.mark.parametrize("unit", ("ppm", "%", "ppb"))
@pytest.mark.parametrize(
    "name",
    ["scale_factor", "values.scale_factor", "parameters.scale_factor.std", "rows", "chi2_per_dof"],
)
def test_a_part_of_nothing_is_no_size(name, unit):
    """ "300 ppm" as the largest scale factor was taken for K ≤ 3e-4 without a word."""
    with pytest.raises(UsageError, match=rf"limit {name}: {unit} is a part of something.*ppm"):
        limit_value(name, f"300 {unit}")
    assert limit_value(name, "300") == 300.0 and limit_value("flagged_part", "5 %") == 0.05


def test_a_part_of_nothing_ends_the_check(hrg, results):
    given = limits(results, '[resonator]\nscale_factor.maximum = "300 ppm"\n')
    done = hrg("check", results / "resonator.h5", "--limits", given)
    assert done.status == 2 and "scale_factor is a number by itself" in done.err and not done.out


@pytest.mark.parametrize("size", (3e-9, 4e-5, 0.0123, 0.4, 700.0))
@pytest.mark.parametrize(
    "name",
    [
        *("bias_rad_s", "frequency_split_rad_s", "values.frequency_split_rad_s", "pull_rad_s"),
        *("damping_rate_1_s", "damping_axis_rad", "frequency_hz", "window_s", "gain", "x_ppm"),
        *("gain.drift_error_deg_h.after", "angle_random_walk_rad_sqrt_s", "parts.angle_deg"),
        *("rate_random_walk_rad_s_sqrt_s", "flatness_degc", "parts.amplitude_percent"),
    ],
)
def test_what_the_screen_shows_is_understood_as_a_limit(name, size):
    shown = format_quantity(name, size, None, find_unit(name))
    number, _, unit = shown.partition(" ")
    if "×10" in number:
        return  # powers of ten are written otherwise in a limit
    assert limit_value(name, f"{number} {unit}") == pytest.approx(size, rel=1e-5)


def test_what_was_meant():
    assert (
        suggest("adeqate", ("adequate", "explained")) == "did you mean adequate?"
        and suggest("xyz", ("adequate",)) == ""
    )
    assert find_quantity("rows") == "a ratio" and find_quantity("values.bias_rad_s") == "a rate"


def test_many_files_verdict_and_causes(hrg, results):
    given = limits(
        results,
        '[diagnosis]\nverdict = ["adequate", "explained"]\ncauses = 2\n[resonator]\nstatus ='
        ' "any"\nscale_factor = 0.6\n',
    )
    files = (results / "diagnosis.h5", results / "resonator.h5")
    done = hrg("check", *files, "--limits", given, "--json")
    assert done.status == 0 and {row["file"] for row in done.json["rows"]} == set(
        map(str, files)
    ), done.err
    assert done.json["answer"]["health"] == "fault found"
    strict = hrg(
        "check",
        *files,
        "--limits",
        given,
        "--set",
        "diagnosis.causes=0",
        "--set",
        'diagnosis.verdict="adequate"',
    )
    assert (
        strict.status == 3
        and "the verdict is explained, adequate was wanted" in strict.err
        and "causes is 2" in strict.err
    )


@pytest.mark.parametrize(
    ("text", "word"),
    [
        ("[diagnosis]\ncuases = 0\n", "did you mean causes?"),
        ('[diagnosis]\nverdict = "adequat"\n', "did you mean adequate?"),
        ("[diagnossis]\ncauses = 0\n", "did you mean diagnosis?"),
        ("[diagnosis]\ncauses = { maximun = 0 }\n", "did you mean maximum?"),
        ('[diagnosis]\nstatus = "god"\n', '"valid"'),
        ('[diagnosis]\n"gain.drift_error_deg_h.after" = "5 deg"\n', "no unit of a rate"),
    ],
)
def test_typing_errors_are_usage_errors(hrg, results, text, word):
    done = hrg("check", results / "diagnosis.h5", "--limits", limits(results, text))
    assert done.status == 2 and word in done.err, done.err


def test_junit_and_markdown(hrg, results):
    given = limits(results, "[diagnosis]\ncauses = 0\n")
    out = ("--junit", results / "check.xml", "--markdown", results / "check.md")
    assert hrg("check", results / "diagnosis.h5", "--limits", given, *out).status == 3
    root = ElementTree.parse(results / "check.xml").getroot()
    failed = {
        case.get("name") for case in root.iter("testcase") if case.find("failure") is not None
    }
    assert (
        failed == {"causes"}
        and root.get("failures") == "1"
        and "fault found" in root.find(".//system-out").text
    )
    text = (results / "check.md").read_text()
    assert text.startswith("### hrg check: FAILED") and "| diagnosis.h5 | causes | 2 |" in text
    assert hrg("check", results / "diagnosis.h5", "--limits", given, *out).status == 1, (
        "existing outputs are refused"
    )


def moved(record, name, sigmas):
    """The resonator with one value moved by so many σ of both."""
    values = record.value.copy()
    k = list(record.name).index(name)
    values[k] += sigmas * np.sqrt(2) * record.std[k]
    return record.replace(value=values)


def test_diff_is_in_sigma_of_both(hrg, results):
    old = by_hand.resonator()
    store.write(results / "new.h5", moved(old, "damping_rate_1_s", 4.0))
    done = hrg("diff", results / "resonator.h5", results / "new.h5", "--json")
    assert done.status == 0 and done.json["largest_sigma"] == pytest.approx(4.0, rel=1e-6)
    assert done.json["differences"][0]["name"] == "damping_rate_1_s"
    assert hrg("diff", results / "resonator.h5", results / "new.h5", "--limit-sigma", 3).status == 3
    assert hrg("diff", results / "resonator.h5", results / "new.h5", "--limit-sigma", 5).status == 0
    wrong = hrg("diff", results / "resonator.h5", results / "diagnosis.h5")
    assert wrong.status == 1 and "two of one kind" in wrong.err
    assert hrg("diff", results / "resonator.h5").status == 2


def test_components_of_a_split_are_limited_as_the_split_is():
    """δω cos and δω sin are halves of differences of frequencies, as δω is: Δf = δω/π. Taken for a
    rate before, limits in Hz were twice too wide."""
    for part in ("cos", "sin"):
        name = f"details.split_components.frequency_split_{part}_rad_s.value"
        assert limit_value(name, "1 Hz") == pytest.approx(np.pi)


def test_axes_differ_modulo_their_period():
    old = by_hand.resonator()
    k = list(old.name).index("damping_axis_rad")
    values = old.value.copy()
    values[k] += np.pi / 2
    found = {d.name: d for d in compare(old, old.replace(value=values)).differences}
    assert found["damping_axis_rad"].difference == pytest.approx(0, abs=1e-12)


def test_diff_of_diagnoses_and_tables():
    old = by_hand.diagnosis()
    report = json.loads(old.report)
    new = old.replace(
        verdict="adequate",
        report=json.dumps(report | {"verdict": "adequate", "effects": report["effects"][:1]}),
    )
    said = describe_beyond(compare(old, new), 5.0)
    assert (
        "cause gain mismatch is in the old result alone" in said
        and "verdict was explained, is adequate" in said
    )
    tables = by_hand.calibration()
    shifted = tables.replace(
        drift_harmonics=tables.drift_harmonics + np.eye(1, tables.drift_harmonics.shape[1]) * 1e-4
    )
    assert {d.name: d for d in compare_tables(tables, shifted)}[
        "table.drift_rad_s"
    ].difference == pytest.approx(1e-4, rel=1e-6)


def test_baseline(hrg, results, tmp_path):
    earlier = tmp_path / "earlier"
    earlier.mkdir()
    store.write(earlier / "resonator.h5", moved(by_hand.resonator(), "scale_factor", 7.0))
    given = limits(results, '[resonator]\nstatus = "any"\nscale_factor = 0.6\n')
    done = hrg("check", results / "resonator.h5", "--limits", given, "--baseline", earlier)
    assert done.status == 3 and "scale factor K moved by −7 σ" in done.err
    assert (
        hrg(
            "check",
            results / "resonator.h5",
            "--limits",
            given,
            "--baseline",
            earlier,
            "--limit-sigma",
            8,
        ).status
        == 0
    )
    assert hrg("check", results / "diagnosis.h5", "--baseline", earlier).status == 3, (
        "what the baseline lacks does not pass"
    )
    other = by_hand.resonator().replace(gyro_id="SN\x1b[2J-2")
    store.write(tmp_path / "other.h5", other)
    alien = hrg("check", results / "resonator.h5", "--baseline", tmp_path / "other.h5")
    assert alien.status == 3 and f"is {by_hand.resonator().gyro_id}" in alien.err
    assert "gyro was SN" in alien.err and "\x1b" not in alien.err, "another gyro's results"
    gone = hrg("check", results / "resonator.h5", "--baseline", tmp_path / "no.h5")
    assert gone.status == 1 and "no such file" in gone.err, "a baseline that is not there"
    assert hrg("check", results / "resonator.h5").status == 2


def test_strict_from_the_environment(hrg, results, monkeypatch):
    store.write(results / "rec.h5", by_hand.recording(seconds=1.0, truth=False).judged(["doubted"]))
    assert hrg("demodulate", results / "rec.h5", "-o", results / "p1.h5").status == 0
    monkeypatch.setenv("HRG_STRICT", "1")
    assert (
        hrg("demodulate", results / "rec.h5", "-o", results / "p2.h5").status == 3
        or store.read_any(results / "p2.h5").status == "valid"
    )


def test_files_of_one_name_are_told_apart_and_limits_in_their_units(tmp_path, hrg):
    """Ten gyros' folders hold a `resonator.h5` each; nobody can tell whose missed the limit by that."""
    for name in ("SN-1", "SN-2"):
        (tmp_path / name).mkdir()
        store.write(tmp_path / name / "resonator.h5", by_hand.resonator().replace(gyro_id=name))
    files = [tmp_path / name / "resonator.h5" for name in ("SN-1", "SN-2")]
    found = hrg("check", *files, "--set", "resonator.frequency_split_rad_s='1 uHz'")
    assert found.status == 3
    assert "SN-1/resonator.h5" in found.out and "SN-2/resonator.h5" in found.out
    assert str(tmp_path) not in found.out
    missed = [line for line in found.err.splitlines() if line.startswith("refused")]
    assert len(missed) == 2 and all("mHz" in line for line in missed)
    told = hrg("check", *files, "--set", "resonator.frequency_split_rad_s='1 uHz'", "--json").json
    assert told["answer"] is None, "an answer is one gyro's"


def test_limits_outside_a_table_hold_for_every_result_that_has_the_figure(tmp_path, hrg):
    """One file of limits, whichever command holds it: a figure of one of the results, the status of
    all; a table's own line goes first."""
    files = [tmp_path / "resonator.h5", tmp_path / "diagnosis.h5"]
    store.write(files[0], by_hand.resonator())
    store.write(files[1], by_hand.diagnosis())
    given = limits(tmp_path, 'status = "any"\nscale_factor = 0.6\ncauses = 9\n')
    rows = hrg("check", *files, "--limits", given, "--json").json["rows"]
    assert [(row["file"], row["name"]) for row in rows] == [
        (str(files[0]), "status"),
        (str(files[0]), "scale_factor"),
        (str(files[1]), "status"),
        (str(files[1]), "causes"),
    ]
    given.write_text("scale_factor = 0.6\n[resonator]\nscale_factor = 0.1\n")
    rows = hrg("check", files[0], "--limits", given, "--json").json["rows"]
    assert [row["maximum"] for row in rows if row["name"] == "scale_factor"] == [0.1]
    given.write_text("quality = 0.6\n")  # nothing has it, and nothing is near it
    assert hrg("check", *files, "--limits", given).status == 3


def test_a_page_shows_limits_outside_a_table_and_refuses_typing_errors(tmp_path, hrg):
    store.write(tmp_path / "resonator.h5", by_hand.resonator())
    given = limits(tmp_path, 'status = "any"\nscale_factor = 0.6\n')
    asked = ("report", tmp_path / "resonator.h5", "--limits", given, "-o", tmp_path / "page.html")
    assert hrg(*asked).status == 0 and "≤ 0.6" in (tmp_path / "page.html").read_text()
    for written in ("scale_factr = 0.6\n", "[resonater]\nscale_factor = 0.6\n"):
        given.write_text(written)
        refused = hrg(*asked, "--force")
        assert refused.status == 2 and "did you mean" in refused.err, refused.err


def test_a_limit_does_not_read_the_samples_of_a_recording(tmp_path, hrg, monkeypatch):
    """Bytes that a page reads of a recording, a limit outside a table beside it or not."""
    noise = np.random.default_rng(0).normal(size=(2, 300_000))
    store.write(
        tmp_path / "long.h5",
        Recording(c=noise[0], s=noise[1], sample_rate_hz=1e4, mode="free", gyro_id="HRG-1"),
    )
    store.write(tmp_path / "resonator.h5", by_hand.resonator())
    read, whole = [], h5py.Dataset.__getitem__

    def counted(dataset, *key):
        values = whole(dataset, *key)
        read[-1] += np.asarray(values).nbytes
        return values

    monkeypatch.setattr(h5py.Dataset, "__getitem__", counted)
    files = tmp_path / "resonator.h5", tmp_path / "long.h5"
    for extra in ((), ("--limits", limits(tmp_path, 'status = "any"\nscale_factor = 0.6\n'))):
        read.append(0)
        done = hrg("report", *files, "-o", tmp_path / "page.html", "--force", *extra)
        assert done.status == 0, done.err
    assert "≤ 0.6" in (tmp_path / "page.html").read_text()
    assert read[1] - read[0] < 0.01 * noise.nbytes


def test_a_damping_split_is_told_as_its_limit_is_written(tmp_path, hrg):
    """Limits come in °/h of drift, and so does the answer: not 1/s against °/h."""
    store.write(tmp_path / "resonator.h5", by_hand.resonator())
    given = limits(tmp_path, '[resonator]\nstatus = "any"\ndamping_split_1_s = "5 deg/h"\n')
    refused = hrg("check", tmp_path / "resonator.h5", "--limits", given)
    assert refused.status == 3 and "≤ 5 °/h" in refused.out
    assert "°/h, the limit is ≤ 5 °/h" in refused.err and "1/s" not in refused.err


STEP = Step("calibrate", (), "calibration.h5", "valid", ())


def test_a_missed_limit_has_its_units_everywhere(hrg, results):
    """JUnit and the summary of `run` told rad/s without a unit, where the table told °/h."""
    told = hrg(
        *("check", results / "resonator.h5", "--junit", results / "units.xml"),
        *("--set", 'resonator.damping_split_1_s="1 deg/h"'),
    )
    assert told.status == 3 and "°/h, the limit is ≤ 1 °/h" in told.err
    suite = ElementTree.parse(results / "units.xml").getroot()
    (failure,) = suite.iter("failure")
    assert "°/h, the limit is ≤ 1 °/h" in failure.get("message", "")
    row = Row("damping_split_1_s", 0.02, None, 1e-3, False)
    (reason, *_) = _judge([STEP], [row])["status_reasons"]
    assert reason.endswith("°/h, the limit is ≤ 206.265 °/h")
