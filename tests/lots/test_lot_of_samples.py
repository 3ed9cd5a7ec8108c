"""A lot of raw samples with a gain mismatch below one gyro's threshold: no diagnosis names it, the
lot does, and whose it is; `hrg batch` says so on the screen, in JSON, table and page."""

import json

import numpy as np
import pytest
from diagnosis_programme import programme, waves

from hrg_cli import store
from hrg_cli.lots.common_causes import find_common_causes
from hrg_cli.lots.groups import Origin
from hrg_cli.records import collect
from hrg_cli.stages.diagnose import diagnose, summarise
from hrg_cli.stages.simulate import list_run_ids, simulate

GAIN_STD = 1.6e-5
"""σ of the gain by the four runs of one gyro below, as their own diagnoses state it."""
FEW_SIGMA = 2.5


def diagnosed(seed, sigma):
    """A random device in four runs of 1 s, its gain mismatch `sigma` times what they can tell."""
    effects = {"gain_mismatch": {"gain": sigma * GAIN_STD}} if sigma else {}
    return summarise(diagnose(waves(programme(seed, effects, runs=4, duration_s=1.0), seed=seed)))


@pytest.fixture(scope="module")
def few():
    """Eight gyros with a gain mismatch of 2.5 σ."""
    return [diagnosed(7000 + k, FEW_SIGMA) for k in range(8)]


def test_scores_are_the_diagnosis_own_estimates(few):
    """σ as stated; each cause's estimate scatters by it about the truth."""
    for report in few:
        scores = report["scores"]
        count = len(scores["names"])
        assert count > 15 and len(set(scores["names"])) == count
        assert [len(row) for row in scores["correlation"]] == list(range(count))
        assert np.all(np.abs(np.concatenate(scores["correlation"])) <= 1 + 1e-9)
    z = []
    for report in few:
        scores = report["scores"]
        at = scores["names"].index("gain_mismatch.gain")
        assert 0.6 < scores["std"][at] / GAIN_STD < 1.6
        z.append((scores["value"][at] - FEW_SIGMA * GAIN_STD) / scores["std"][at])
    assert abs(np.mean(z)) < 4 / np.sqrt(len(z)) and np.std(z) < 2.2


def test_the_lot_knows_what_no_gyro_does(few):
    assert sum(bool(report["effects"]) for report in few) <= 1  # chance 0.05 a gyro
    found = find_common_causes([report["scores"] for report in few], [Origin({}) for _ in few])
    (one,) = found.causes
    assert one.name == "gain_mismatch.gain" and one.group.describe() == "all gyros"
    assert abs(one.value - FEW_SIGMA * GAIN_STD) < 4 * one.std


@pytest.mark.slow
def test_a_cause_of_a_sigma_and_a_half_in_forty_gyros():
    """In the whole lot; at one station of two; in none."""
    clean = [diagnosed(5000 + k, 0.0)["scores"] for k in range(40)]
    moved = [diagnosed(5000 + k, 1.5)["scores"] for k in range(40)]
    stations = [Origin({"station": "12"[k % 2]}) for k in range(40)]
    assert find_common_causes(clean, stations).causes == ()
    (whole,) = find_common_causes(moved, stations).causes
    assert whole.name == "gain_mismatch.gain" and whole.group.describe() == "all gyros"
    assert abs(whole.value - 1.5 * GAIN_STD) < 4 * whole.std
    mixed = [moved[k] if k % 2 else clean[k] for k in range(40)]
    (one,) = find_common_causes(mixed, stations).causes
    assert one.name == "gain_mismatch.gain" and one.group.describe() == "all gyros of station 2"


@pytest.mark.slow
def test_batch_says_it_everywhere(hrg, tmp_path):
    """12 gyros at two stations, one file cut off: screen, JSON, table and page tell the same."""
    for k in range(12):
        table = programme(
            1000 + k,
            {"gain_mismatch": {"gain": 1e-3}} if k % 2 else {},
            runs=4,
            duration_s=1.0,
        )
        table["recording"]["gyro_id"] = f"SN-{k:03}"
        for run in list_run_ids(table):
            store.write(tmp_path / f"sn-{k:03}-{run}.h5", collect(simulate(table, run=run, seed=k)))
    whole = (tmp_path / "sn-002-run0.h5").read_bytes()
    (tmp_path / "sn-002-run9.h5").write_bytes(whole[:9000])
    (tmp_path / "lot.toml").write_text(
        'recordings = "*.h5"\nstages = ["identify", "diagnose"]\n'
        "[demodulate]\nperiods_per_window = 40.0\n[groups.station]\n"
        + "".join(
            f"{s} = {json.dumps([f'SN-{k:03}' for k in range(s - 1, 12, 2)])}\n" for s in (1, 2)
        )
    )
    done = hrg("batch", tmp_path / "lot.toml", "-o", tmp_path / "out", "--json")
    assert done.status == 3
    (one,) = [c for c in done.json["lot_causes"] if c["kind"] == "cause"]
    assert one["sentence"].startswith("all gyros of station 2: gain mismatch 0.10")
    assert set(one["named_alone_by"]) == {f"SN-{k:03}" for k in range(1, 12, 2)}
    rows = {row["gyro_id"]: row for row in done.json["rows"]}
    assert rows["SN-002"]["runs_failed"] == 1 and rows["SN-003"]["cause"] == "gain_mismatch"
    assert rows["SN-003"]["station"] == "2" and 0 < rows["SN-003"]["cause_share"] <= 1
    page = (tmp_path / "out" / "lot.html").read_text(encoding="utf-8")
    assert one["sentence"] in page and 'href="./SN-003/report.html"' in page
    assert "gain_mismatch" in (tmp_path / "out" / "lot.csv").read_text(encoding="utf-8")
    again = hrg("batch", tmp_path / "lot.toml", "-o", tmp_path / "out")
    assert again.status == 3 and one["sentence"] in again.out
