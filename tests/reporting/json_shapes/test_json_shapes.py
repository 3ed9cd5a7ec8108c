"""What every command prints with --json is what the documentation says of it: real outputs held
against the declared shapes."""

import json
from pathlib import Path

import numpy as np
import pytest
from pydantic import ValidationError

from docs.handbook import json_keys, pages
from hrg_cli import collect, demodulate, diagnose, estimate, simulate
from hrg_cli.cli import COMMANDS
from hrg_cli.reporting.json_shapes import SHAPES, Common
from hrg_cli.reporting.json_shapes.diagnosis import Effect

ROOT = Path(__file__).parent.parent.parent.parent
SAMPLE = ROOT / "sample_data"
CONFIGS = ROOT / "configs"
FORCED = """
[device]
frequency_hz = 1003.7
quality_factor = 40000
damping_split = 0.05
frequency_split_hz = 0.004
damping_axis_rad = 0.3
stiffness_axis_rad = 0.7
[control]
mode = "forced"
quadrature_loop = "finite"
quadrature_gain_1_s = 3
[readout]
noise = 1e-4
[recording]
sample_rate_hz = 6000
duration_s = 12
gyro_id = "SAMPLE-1"
[[run]]
run_id = "plus"
environment.rate_rad_s = 1.0
[[run]]
run_id = "minus"
environment.rate_rad_s = -1.0
[[run]]
run_id = "fast"
environment.rate_rad_s = 1.5
"""


def fits(command, text):
    """Problems of a command's output under its shapes; none where one of them takes it."""
    told = []
    for shape in SHAPES[command]:
        try:
            shape.model_validate_json(text)
            return []
        except ValidationError as error:
            told += [f"{'.'.join(map(str, e['loc']))}: {e['msg']}" for e in error.errors()]
    return told


def test_every_command_has_a_shape():
    assert set(SHAPES) == set(COMMANDS)


def test_every_key_has_a_meaning():
    models = [Common, *(shape for shapes in SHAPES.values() for shape in shapes)]
    for model in models:
        whole = model.model_json_schema(by_alias=True)
        for name, table in ({model.__name__: whole} | whole.get("$defs", {})).items():
            without = [
                k for k, entry in table["properties"].items() if not entry.get("description")
            ]
            assert not without, f"{name}: {without}"


def test_a_key_too_many_or_of_another_type_is_seen():
    """The shapes are not so loose that anything passes."""
    good = {"kind": "table", "status": "valid", "status_reasons": [], "output": "t", "elapsed_s": 1}
    assert fits("export", json.dumps(good)) == []
    for change in ({"more": 1}, {"status": "fine"}, {"elapsed_s": "1"}, {"output": 3}):
        assert fits("export", json.dumps(good | change))
    assert fits("export", json.dumps({k: v for k, v in good.items() if k != "status"}))


def test_the_schema_file_is_fresh():
    for name, make in pages.WHOLE.items():
        text = (ROOT / "docs" / "reference" / name).read_text(encoding="utf-8")
        assert text == make(), "run `python -m docs.handbook README.md docs`"
    for command in SHAPES:
        assert json_keys.make_schema(command)


def test_real_outputs_fit(hrg, tmp_path):
    """One chain through every command, free and forced, with and without the optional parts."""

    def told(command, *arguments):
        done = hrg(command, *arguments, "--json")
        assert done.status in (0, 3), (command, done.err)
        assert fits(command, done.out) == [], command
        return done.json

    here = lambda name: tmp_path / name  # noqa: E731
    told("import", SAMPLE / "lab_log.csv", "-o", here("log.h5"), "--to-s", 0.1)
    time_s = np.arange(0, 20, 0.01)
    decay = np.exp((2j * np.pi * 0.3 - 0.05) * time_s)
    rows = np.stack([time_s, decay.real, decay.imag, 0.5 * decay.real, 0.5 * decay.imag], 1)
    rows[:, 1:] += 1e-4 * np.random.default_rng(0).standard_normal((len(rows), 4))
    head = "time_s,c_i,c_q,s_i,s_q"
    np.savetxt(here("lockin.csv"), rows, delimiter=",", header=head, comments="")
    columns = ("--c-in-phase", "c_i", "--c-quadrature", "c_q")
    columns += ("--s-in-phase", "s_i", "--s-quadrature", "s_q", "--reference-frequency-hz", 5000)
    told("import", here("lockin.csv"), "--envelope", *columns, "-o", here("lockin.h5"))
    waves = []
    for k in (1, 2, 3):
        told("demodulate", SAMPLE / f"free-{k}.h5", "-o", here(f"p{k}.h5"))
        told("estimate", here(f"p{k}.h5"), "-o", here(f"w{k}.h5"))
        waves.append(here(f"w{k}.h5"))
    told("identify", *waves, "-o", here("resonator.h5"))
    told("diagnose", *waves, "-o", here("diagnosis.h5"), "--model", here("resonator.h5"))
    told("info", here("diagnosis.h5"))
    told("info", waves[0])
    told("effects")
    told("effects", "gain_mismatch")
    told("forecast", here("resonator.h5"), "--drive", "free", "--duration-s", 60)
    told("mismatch", waves[0], "-o", here("mismatch.csv"))
    told("plan", here("resonator.h5"), "--menu", CONFIGS / "menu.toml", "--runs", 1)
    told("check", here("resonator.h5"), here("diagnosis.h5"), "--limits", CONFIGS / "limits.toml")
    told("diff", here("resonator.h5"), here("resonator.h5"))
    told("verify", here("resonator.h5"))
    told("export", waves[0], "-o", here("wave.csv"))
    told("report", here("resonator.h5"), "-o", here("page.html"))
    told("rate", waves[0], "--resonator", here("resonator.h5"), "-o", here("rate.h5"))
    told("study", "gauss-newton", "--set", "vectors=100")
    told("rehearse", here("resonator.h5"), "--times", 2)
    book = ("--ledger", here("ledger.sqlite"))
    told("ledger", "add", here("resonator.h5"), here("diagnosis.h5"), *book)
    told("ledger", "show", *book)
    told("ledger", "history", "SAMPLE-1", *book)
    hidden = ("--effect", "gain_mismatch", "--set", "gain=0.01")
    told("inject", SAMPLE / "free-1.h5", *hidden, "-o", here("injected.h5"))

    here("forced.toml").write_text(FORCED)
    forced = []
    for path in told("simulate", here("forced.toml"), "-o", here("forced.h5"))["outputs"]:
        wave = Path(path).with_suffix(".wave.h5")
        told("demodulate", path, "-o", here("p.h5"), "--periods-per-window", 20, "--force")
        told("estimate", here("p.h5"), "-o", wave)
        forced.append(wave)
    told("calibrate", *forced, "-o", here("calibration.h5"), "--harmonics", 1, "--ladder")
    told("compensate", forced[0], "--calibration", here("calibration.h5"), "-o", here("comp.h5"))
    told("export", here("calibration.h5"), "-o", here("table.h"))
    own = ("--resonator", here("resonator.h5"))
    told("update", here("calibration.h5"), *own, "-o", here("updated.h5"))

    rate, degc = np.tile([-2.0, -1.0, 0.0, 1.0, 2.0], 40), np.repeat(np.linspace(10, 50, 10), 20)
    noise = np.random.default_rng(1).standard_normal(200)
    dwells = np.stack([rate, 1e5 * (1 - 4e-4 * degc) * rate + 5 * noise, degc], 1)
    np.savetxt(here("dwells.csv"), dwells, delimiter=",", header="rate,out,degc", comments="")
    columns = ("--rate-column", "rate", "--output-column", "out", "--temperature-column", "degc")
    told("calibrate", here("dwells.csv"), *columns, "-o", here("dwells.h5"))

    told("run", SAMPLE / "free-1.h5", "-o", here("results"), "--dry-run")
    lot = f'lot_id = "L"\nrecordings = "{SAMPLE}/free-1.h5"\nstages = ["identify"]\n'
    here("lot.toml").write_text(lot)
    told("batch", here("lot.toml"), "-o", here("lot"))
    few = ("--set", "demodulate.periods_per_window=20", "--set", "diagnose.most_effects=1")
    told("run", SAMPLE / "free-1.h5", SAMPLE / "free-2.h5", "-o", here("results"), *few)


@pytest.mark.parametrize("frequency_hz", [990.0, 50.0])  # beside the oscillation, and far from it
def test_a_cause_told_from_the_samples_fits(frequency_hz):
    """Its entry has other keys than that of a cause told from the motion."""
    tone = {"c_cos": 1e-3, "frequency_hz": frequency_hz}
    config = {
        "device": {"frequency_hz": 1000.0, "quality_factor": 20_000.0},
        "effects": {"mains_tone": tone},
        "readout": {"noise": 1e-4},
        "recording": {"sample_rate_hz": 8000.0, "duration_s": 4.0},
        "run": [
            {"run_id": name, "environment": {"rate_rad_s": rate}}
            for name, rate in (("left", 1.0), ("right", -1.0), ("slow", 0.5))
        ],
    }
    samples = [collect(simulate(config, run=run["run_id"])) for run in config["run"]]
    waves = [collect(estimate(collect(demodulate(r, periods_per_window=20)))) for r in samples]
    causes = json.loads(diagnose(waves, most_effects=1).report)["effects"]
    assert [cause["name"] for cause in causes] == ["mains_tone"]
    assert Effect.model_validate_json(json.dumps(causes[0])).view == "waveform"


@pytest.mark.slow
def test_a_diagnosis_with_causes_fits(hrg, tmp_path):
    """The demonstration: causes, forecast, stability."""
    made = hrg("simulate", CONFIGS / "demonstration_free.toml", "-o", tmp_path / "f.h5", "--json")
    done = hrg("run", *made.json["outputs"], "-o", tmp_path / "out", "--json")
    assert fits("run", done.out) == []
    waves = sorted((tmp_path / "out").glob("*.wave.h5"))
    done = hrg("diagnose", *waves, "-o", tmp_path / "d.h5", "--json")
    assert done.json["effects"] and fits("diagnose", done.out) == []
