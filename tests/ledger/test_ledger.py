"""`hrg ledger` as it is used: entering, drift against the last one, limits, charts, exports, exit
statuses."""

import json

import numpy as np
import pytest
from production import entry, production, write

from hrg_cli import store
from hrg_cli.ledger import database
from hrg_cli.ledger.history import tell_history
from hrg_cli.ledger.overview import make_overview
from hrg_cli.ledger.series import select_independent
from hrg_cli.records import Wave
from hrg_cli.reporting.quantities import round_with_std

SPLIT = "frequency_split_rad_s"
LIMITS = "[resonator]\nfrequency_split_rad_s = { minimum = 0.08, maximum = 0.12 }\n"


@pytest.fixture
def files(tmp_path):
    """Two results of SN-1 ten days apart and one of SN-2."""
    return [
        write(tmp_path / "a.h5", "SN-1", 0.0),
        write(tmp_path / "b.h5", "SN-1", 10.0, frequency_split_rad_s=0.1004),
        write(tmp_path / "c.h5", "SN-2", 3.0),
    ]


@pytest.mark.parametrize("gyros", [1, 2])
def test_a_mean_is_rounded_by_its_own_sigma_where_no_spread_is(hrg, tmp_path, gyros):
    """One gyro has no spread, and gyros that are equal to the last digit have none either."""
    ledger = tmp_path / "l.sqlite"
    made = [write(tmp_path / f"{k}.h5", f"SN-{k}", float(k)) for k in range(gyros)]
    assert hrg("ledger", "add", *made, "--ledger", ledger).status == 0
    [figure] = make_overview(database.read_entries(ledger), names=[SPLIT]).figures
    [std] = {e.figures[SPLIT].std for e in database.read_entries(ledger)}
    assert figure.mean_std == pytest.approx(std / np.sqrt(gyros))
    shown = hrg("ledger", "show", "--ledger", ledger).out.splitlines()
    [row] = [line for line in shown if line.startswith("frequency split Δf")]
    assert round_with_std(figure.mean * 1e3 / np.pi, figure.mean_std * 1e3 / np.pi) in row
    assert "(" in row


def test_add_says_what_is_new_and_what_is_known(hrg, files, tmp_path):
    ledger = tmp_path / "l.sqlite"
    first = hrg("ledger", "add", *files, "--ledger", ledger, "--station", "2", "--json").json
    assert first["added"] == 3 and first["known"] == 0 and first["status"] == "valid"
    told = first["files"][0]
    assert (
        told["sha256"] == store.compute_sha256(files[0])
        and told["processed"] == "2026-03-01T08:00:00Z"
    )
    assert told["station"] == "2" and told["order"] == "L7" and told["gyro_id"] == "SN-1"
    again = hrg("ledger", "add", files[0], "--ledger", ledger)
    assert again.status == 0 and "known already" in again.out and "0 added, 1 known" in again.out
    assert len(database.read_entries(ledger)) == 3


def test_circumstances_come_from_a_file_too(hrg, files, tmp_path):
    (tmp_path / "bench.toml").write_text('[ledger]\nstation = "3"\noperator = "ann"\n')
    ledger = tmp_path / "l.sqlite"
    given = ("--config", tmp_path / "bench.toml", "--operator", "bob", "--set", "order=W-5")
    assert hrg("ledger", "add", files[0], "--ledger", ledger, *given).status == 0
    (found,) = database.read_entries(ledger)
    assert (found.station, found.operator, found.order) == ("3", "bob", "W-5")
    (tmp_path / "bench.toml").write_text('[ledger]\nstaton = "3"\n')
    told = hrg("ledger", "add", files[0], "--ledger", ledger, *given)
    assert told.status == 1 and "did you mean station?" in told.err


def test_what_is_no_result_is_not_entered(hrg, files, tmp_path):
    ledger = tmp_path / "l.sqlite"
    (tmp_path / "notes.txt").write_text("hello")
    for bad in (tmp_path / "notes.txt", tmp_path / "missing.h5"):
        told = hrg("ledger", "add", files[0], bad, "--ledger", ledger)
        assert told.status == 1 and bad.name in told.err and told.err.count("\n") == 1
        assert not ledger.exists()
    nameless = write(tmp_path / "n.h5", "", 0.0)
    assert "--gyro-id" in hrg("ledger", "add", nameless, "--ledger", ledger).err
    assert hrg("ledger", "add", nameless, "--ledger", ledger, "--gyro-id", "X").status == 0
    assert database.read_entries(ledger)[0].gyro_id == "X"
    assert hrg("ledger", "add").status == 2 and hrg("ledger").status == 2


def test_history_is_the_drift_against_the_last_one(hrg, files, tmp_path):
    ledger, limits = tmp_path / "l.sqlite", tmp_path / "limits.toml"
    limits.write_text(LIMITS)
    hrg("ledger", "add", *files, "--ledger", ledger)
    told = hrg("ledger", "history", "SN-1", "--ledger", ledger, "--limits", limits, "--json").json
    (split,) = (f for f in told["figures"] if f["name"] == SPLIT)
    assert split["since_before"]["change"] == pytest.approx(4e-4)
    assert split["since_before"]["sigma"] == pytest.approx(4e-4 / (1e-4 * np.sqrt(2)))
    assert split["share_before"] == pytest.approx(4e-4 / 0.04)
    assert split["times"] == ["2026-03-01T08:00:00Z", "2026-03-11T08:00:00Z"]
    shown = hrg("ledger", "history", "SN-1", "--ledger", ledger, "--limits", limits)
    assert shown.status == 0 and "+2.8 σ" in shown.out and "+1 %" in shown.out
    wrong = hrg("ledger", "history", "SN-3", "--ledger", ledger)
    assert wrong.status == 2 and "did you mean SN-" in wrong.err


def test_status_3_outside_limits_and_out_of_control_when_strict(hrg, files, tmp_path):
    ledger, limits = tmp_path / "l.sqlite", tmp_path / "limits.toml"
    limits.write_text(LIMITS)
    hrg("ledger", "add", *files, "--ledger", ledger)
    asked = ("ledger", "show", "--ledger", ledger, "--limits", limits)
    assert hrg(*asked).status == 0
    told = hrg(*asked, "--set", f"resonator.{SPLIT}.maximum=0.1002")
    assert (
        told.status == 3
        and "SN-1, resonator: frequency split Δf is 31.958(32) mHz, the limit is" in told.err
    )
    mistyped = hrg(*asked, "--set", "resonator.frequency_splt_rad_s=0.1")
    assert mistyped.status == 2 and "did you mean" in mistyped.err
    rng = np.random.default_rng(0)
    stable = [entry(f"T-{n:02d}", n, 0.1 + 1e-4 * rng.standard_normal()) for n in range(20)]
    database.add_entries(tmp_path / "t.sqlite", stable)
    chart = ("ledger", "show", "--ledger", tmp_path / "t.sqlite")
    assert hrg(*chart, "--strict").status == 0
    database.add_entries(tmp_path / "t.sqlite", [entry("T-99", 30.0, 0.102)])
    told = hrg(*chart)
    assert told.status == 0 and "out: 1 beyond 3 σ" in told.out and "T-99" in told.err
    assert hrg(*chart, "--strict").status == 3


def test_the_screen_has_names_and_units_not_keys(hrg, files, tmp_path):
    """Tables and sentences of `show` and `tell_history` had keys; two kinds' figures of one name are
    told apart."""
    ledger, limits = tmp_path / "l.sqlite", tmp_path / "limits.toml"
    limits.write_text(f"[resonator]\n{SPLIT} = 0.1002\n[diagnosis]\n'values.{SPLIT}' = 0.0999\n")
    hrg("ledger", "add", *files, "--ledger", ledger, "--station", "1")
    named = f"values.{SPLIT}"
    diagnosed = [entry(f"SN-{k}", 20.0 + k, 0.1, name=named, kind="diagnosis") for k in (1, 2)]
    database.add_entries(ledger, diagnosed)
    for words in (("show", "--golden", "SN-1"), ("history", "SN-1")):
        for limited in ((), ("--limits", limits, "--guard-sigma", 2)):
            told = hrg("ledger", *words, "--ledger", ledger, *limited)
            said = told.out + told.err
            assert told.status == (3 if limited else 0) and "frequency split Δf" in said
            for key in (SPLIT, "rad_s", "_hz", "_1_s", "values.", "damping_", "0.1004"):
                assert key not in said, (words, key)
            if limited:
                assert "frequency split Δf, resonator" in told.out
                assert "frequency split Δf, diagnosis" in told.out
    asked = ("--figure", SPLIT, "--figure", named, "--json")
    kept = hrg("ledger", "history", "SN-1", "--ledger", ledger, *asked).json
    assert {SPLIT, named} == {figure["name"] for figure in kept["figures"]}, "keys for programs"


def test_a_guard_band_refuses_what_is_too_near(hrg, files, tmp_path):
    """0.1004(1) against 0.1006: inside at 2 σ from the limit, outside with 3 σ of guard."""
    ledger, limits = tmp_path / "l.sqlite", tmp_path / "limits.toml"
    limits.write_text(f"[resonator]\n{SPLIT} = 0.1006\n")
    hrg("ledger", "add", files[1], "--ledger", ledger)
    asked = ("ledger", "show", "--ledger", ledger, "--limits", limits, "--json")
    for k, status in ((0, 0), (1.9, 0), (3, 3)):
        told = hrg(*asked, "--guard-sigma", k)
        row = next(r for r in told.json["gyros"][0]["limits"] if r["name"] == SPLIT)
        assert told.status == status and row["in_guard_band"] == (status == 3)
        assert row["probability_outside"] == pytest.approx(0.02275, rel=1e-3)
    assert "less than 3 σ from its limit" in told.json["status_reasons"][0]


def test_a_parameter_by_its_second_name(hrg, files, tmp_path):
    ledger, limits = tmp_path / "l.sqlite", tmp_path / "limits.toml"
    limits.write_text(f'[resonator]\n"parameters.{SPLIT}.value" = 0.1002\n')
    hrg("ledger", "add", *files, "--ledger", ledger)
    assert hrg("ledger", "show", "--ledger", ledger, "--limits", limits).status == 3
    assert hrg("check", files[1], "--limits", limits).status == 3


def test_samples_processed_again_are_one_measurement():
    twice = [
        entry("SN-1", 0.0, 0.100, samples=("x", "y")),
        entry("SN-1", 5.0, 0.200, samples=("y", "z")),
        entry("SN-1", 9.0, 0.101, samples=("w@0.0:5.0",)),
        entry("SN-1", 10.0, 0.102, samples=("w@5.0:9.0",)),
        entry("SN-1", 11.0, 0.300, samples=("v",), status="refused"),
    ]
    kept = select_independent(twice)
    assert [e.figures[SPLIT].value for e in kept] == [0.200, 0.101, 0.102]
    told = make_overview(twice)
    assert (told.entries, told.refused, told.reprocessed) == (5, 1, 1)
    assert told.doubts[0] == "SN-1: its newest resonator is refused"


def test_time_of_measurement_orders_where_it_is_known():
    late = entry("SN-1", 0.0, 0.1, measured="2026-02-02T00:00:00Z")
    early = entry("SN-1", 1.0, 0.2, measured="2026-02-01T00:00:00Z")
    assert select_independent([late, early]) == [early, late]
    unknown = entry("SN-1", 2.0, 0.3)
    assert select_independent([late, early, unknown]) == [late, early, unknown]


def test_time_of_measurement_is_read_from_the_waves_beside(hrg, tmp_path):
    from synthetic_waves import run_down

    for n, day in enumerate(("2026-01-05T10:00:00Z", "2026-01-04T10:00:00Z")):
        wave = run_down(0.1 + 0.5 * n, 0.0, seconds=1.0, window=5e-3, seed=n, gyro_id="SN-1")
        store.write(tmp_path / f"{n}.h5", wave.replace(start_time=day, lot_id="LOT"))
    done = hrg("identify", tmp_path / "0.h5", tmp_path / "1.h5", "-o", tmp_path / "r.h5", "-q")
    assert done.status in (0, 3)
    told = hrg("ledger", "add", tmp_path / "r.h5", "--ledger", tmp_path / "l.sqlite", "--json")
    assert told.json["files"][0]["measured"] == "2026-01-04T10:00:00Z"
    assert told.json["files"][0]["order"] == "LOT"
    with store.open_record(tmp_path / "0.h5", Wave) as wave:
        assert wave.lot_id == "LOT"


def test_axes_turn_the_shorter_way():
    name = "damping_axis_rad"
    found = tell_history(
        [entry("SN-1", 0.0, 0.01, name=name), entry("SN-1", 1.0, np.pi / 2 - 0.01, name=name)],
        "SN-1",
    ).figures[0]
    assert found.since_before.change == pytest.approx(-0.02)


def test_a_line_is_followed_to_its_limit():
    """0.1 rad/s + 1e-4 a day against 0.12: 200 days from the start, 180 from the last."""
    rows = [entry("SN-1", day, 0.1 + 1e-4 * day, 1e-5) for day in range(0, 21, 2)]
    limits = {"resonator": {SPLIT: 0.12}}
    (found,) = tell_history(rows, "SN-1", limits=limits).figures
    assert found.trend.slope_per_day == pytest.approx(1e-4)
    assert found.days_to_limit == pytest.approx(180, rel=1e-6)
    assert found.share_first == pytest.approx(2e-3 / 0.12)


def test_the_golden_unit_tells_which_station_drifts(tmp_path):
    rows = production(tmp_path / "l.sqlite", gyros=20, station_shift=4e-4)
    told = make_overview(rows, golden="G-000", limits={"resonator": {SPLIT: 0.2}})
    first, second = told.golden
    assert (first.station, second.station) == ("1", "2") and first.measurements == 20
    assert abs(first.trend.sigma) < 4 and second.trend.sigma > 6
    assert second.trend.slope_per_day == pytest.approx(4e-5, rel=0.3)
    assert second.from_others.sigma > 5 and first.scatter_p > 1e-3 > second.scatter_p
    (figure,) = told.figures
    assert figure.gyros == 20 and "G-000" not in figure.points
    assert figure.gauge.components["station"].std == pytest.approx(5e-4, rel=0.8)
    assert figure.gauge.gyro_std == pytest.approx(5e-3, rel=0.5)


def test_exports_hold_every_result(hrg, files, tmp_path):
    pd = pytest.importorskip("pandas")
    ledger = tmp_path / "l.sqlite"
    named = write(tmp_path / "f.h5", "=SUM(A1)", 4.0)
    hrg("ledger", "add", *files, named, "--ledger", ledger, "--station", "@2")
    asked = ("ledger", "show", "--ledger", ledger)
    assert hrg(*asked, "-o", tmp_path / "t.jsonl", "-q").status == 0
    lines = [json.loads(line) for line in (tmp_path / "t.jsonl").read_text().splitlines()]
    assert [line["gyro_id"] for line in lines] == ["SN-1", "SN-1", "SN-2", "=SUM(A1)"]
    assert lines[1]["figures"][SPLIT] == {"value": 0.1004, "std": 1e-4, "units": "rad s-1"}
    assert hrg(*asked, "-o", tmp_path / "t.csv", "-q").status == 0
    table = pd.read_csv(tmp_path / "t.csv")
    assert set(table["gyro_id"]) == {"SN-1", "SN-2", "'=SUM(A1)"} and set(table["station"]) == {
        "'@2"
    }
    assert len(table[table["figure"] == SPLIT]) == 4
    assert hrg(*asked, "-o", tmp_path / "t.csv").status == 1, "exists already"
    pytest.importorskip("pyarrow")
    assert hrg(*asked, "-o", tmp_path / "t.parquet", "-q").status == 0
    typed = pd.read_parquet(tmp_path / "t.parquet")
    assert typed["value"].dtype == float and "'=SUM(A1)" in set(typed["gyro_id"])
    one = hrg("ledger", "history", "SN-1", "--ledger", ledger, "-o", tmp_path / "h.jsonl", "-q")
    assert one.status == 0 and len((tmp_path / "h.jsonl").read_text().splitlines()) == 2
    assert hrg(*asked, "-o", tmp_path / "t.json", "-q").status == 0
    assert json.loads((tmp_path / "t.json").read_text())["kind"] == "ledger"
    assert hrg(*asked, "-o", tmp_path / "t.png").status == 2


def test_what_is_asked_can_be_narrowed(hrg, files, tmp_path):
    ledger = tmp_path / "l.sqlite"
    hrg("ledger", "add", *files, "--ledger", ledger)
    asked = ("ledger", "show", "--ledger", ledger, "--json")
    assert hrg(*asked, "--since", "2026-03-10").json["entries"] == 1
    assert hrg(*asked, "--kind", "diagnosis").json["entries"] == 0
    named = hrg(*asked, "--figure", "scale_factor").json["figures"]
    assert [f["name"] for f in named] == ["scale_factor"]
    for wrong in (("--since", "tomorrow"), ("--figure", "scale_facto"), ("--golden", "SN-9")):
        told = hrg(*asked, *wrong)
        assert told.status == 2 and told.err.count("\n") == 1, told.err


def test_a_lot_is_entered_gyro_by_gyro(hrg, tmp_path):
    from conftest import ringing

    for gyro in ("SN-1", "SN/2"):
        name = gyro.replace("/", "-")
        store.write(tmp_path / f"{name}.h5", ringing(seconds=0.4, gyro_id=gyro, run_id=gyro))
    (tmp_path / "lot.toml").write_text(
        'lot_id = "L9"\nrecordings = "SN*.h5"\nstages = ["identify"]\n'
    )
    ledger = tmp_path / "l.sqlite"
    asked = ("batch", tmp_path / "lot.toml", "-o", tmp_path / "lot", "--ledger", ledger, "--json")
    first = hrg(*asked).json
    assert first["ledger"] == {"path": str(ledger), "added": 2, "known": 0}, first
    found = database.read_entries(ledger)
    assert {e.gyro_id for e in found} == {"SN-1", "SN/2"} and {e.order for e in found} == {"L9"}
    assert hrg(*asked).json["ledger"] == {"path": str(ledger), "added": 0, "known": 2}
    (tmp_path / "no.sqlite").write_text("no database at all, but some text of more than a head")
    told = hrg(*asked[:3], tmp_path / "other", "--ledger", tmp_path / "no.sqlite")
    assert told.status == 1 and "no.sqlite" in told.err


def list_departures(found):
    """Its doubts without those of its chart."""
    return [said for said in found.doubts if "σ from the" in said]


@pytest.mark.parametrize(("by", "doubted"), [(4.0, False), (-6.0, True), (13.2, True)])
def test_a_large_departure_from_the_history_is_in_doubt(by, doubted):
    """A page said "nothing is in doubt" beside a move of 13.2 σ: the chart's own spread held it."""
    last = 0.1 + by * np.sqrt(1 + 1 / 9) * 1e-4
    rows = [entry("SN-1", float(day), last if day == 9 else 0.1) for day in range(10)]
    found = tell_history(rows, "SN-1")
    told = f"is {by:+.3g} σ from the mean of the 9 earlier results that agreed"
    assert any(told in said for said in found.doubts) == doubted
    alone = [f"SN-1: {said}" for said in list_departures(found)]
    assert make_overview(rows).doubts == alone and len(alone) == doubted


@pytest.mark.parametrize("again", [1, 2, 9])
def test_a_step_stands_however_often_it_is_measured(again):
    """One result more after a step, and the alarm was silent."""
    steps = [0.1, 0.1 + 1e-4, *[0.103 - 1e-4 * (k % 2) for k in range(again)]]
    rows = [entry("SN-1", float(day), value) for day, value in enumerate(steps)]
    found = tell_history(rows, "SN-1")
    (said,) = list_departures(found)
    (standing,) = make_overview(rows).standings
    assert f"since the one processed {rows[2].processed}" in said
    assert standing.changed.since == rows[2].processed and standing.changed.sigma > 20
    assert (abs(standing.moved_sigma) < 2) == (again > 1)
    acknowledged = tell_history(rows[2:], "SN-1")
    assert list_departures(acknowledged) == []


def test_a_gyro_that_returns_is_in_doubt_no_more_and_one_that_creeps_is():
    def tell(values):
        rows = [entry("SN-1", float(day), value) for day, value in enumerate(values)]
        return list_departures(tell_history(rows, "SN-1"))

    assert tell([0.1, 0.103, 0.103, 0.1]) == []
    creeping = 0.1 + 1e-4 * np.arange(14)  # 1 σ a result
    assert tell(creeping[:7]) == [] and len(tell(creeping)) == 1
