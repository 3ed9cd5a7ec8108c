"""The command line as a contract: every command documented, JSON alone on standard output, exit
statuses, provenance."""

import dataclasses
import json

import h5py
import numpy as np
import pytest
import typer.main
from conftest import ringing

from docs.handbook.man_page import list_commands
from hrg_cli import store
from hrg_cli.cli import app
from hrg_cli.pipeline import STAGES
from hrg_cli.records import Periods, Wave

COMMANDS = list_commands(typer.main.get_command(app))


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_is_documented_with_an_example(name, hrg):
    result = hrg(*name.split(), "--help")
    assert result.status == 0 and COMMANDS[name].help and f"hrg {name}" in COMMANDS[name].epilog
    taken = {option for parameter in COMMANDS[name].params for option in parameter.opts}
    for option in (
        "--output",
        "--force",
        "--config",
        "--set",
        "--show-config",
        "--json",
        "--quiet",
        "--verbose",
        "--seed",
        "--jobs",
        "--strict",
    ):
        # the same everywhere; one without effect in a command is not in its help
        assert option in taken
    for parameter in COMMANDS[name].params:
        assert parameter.param_type_name == "argument" or parameter.help, (
            f"{name} {parameter.name} says nothing"
        )


def test_bare_hrg_prints_help_and_version_is_said(hrg):
    assert "demodulate" in hrg().out + hrg().err
    assert hrg("--version").out.startswith("hrg ")
    assert hrg("no-such-command").status == 2


@pytest.fixture
def recording(tmp_path):
    store.write(tmp_path / "a.h5", ringing())
    return tmp_path / "a.h5"


def test_chain_with_provenance(hrg, recording, tmp_path):
    first = hrg(
        "demodulate", recording, "-o", tmp_path / "p.h5", "--set", "periods_per_window=5", "--json"
    )
    assert (
        first.status == 0
        and first.json["kind"] == "periods"
        and first.json["output"] == str(tmp_path / "p.h5")
    )
    assert {"kind", "status", "status_reasons", "output", "elapsed_s"} <= set(first.json)
    second = hrg("estimate", tmp_path / "p.h5", "-o", tmp_path / "w.h5", "-q")
    assert second.status == 0 and second.out == ""
    wave = store.read(tmp_path / "w.h5", Wave)
    assert len(wave.provenance.history) == 2 and "demodulate" in wave.provenance.history[0]
    assert (
        wave.provenance.sources[0].sha256 == store.compute_sha256(tmp_path / "p.h5")
        and wave.provenance.sources[0].kind == "periods"
    )
    assert "periods_per_window = 5" in store.read(tmp_path / "p.h5", Periods).provenance.settings
    info = hrg("info", tmp_path / "w.h5", "--json").json
    assert (
        info["kind"] == "wave" and info["facts"]["rows"] == len(wave) and len(info["history"]) == 2
    )
    assert (
        "wave_angle" in hrg("info", tmp_path / "w.h5").out
        or "rows" in hrg("info", tmp_path / "w.h5").out
    )


def test_info_tells_the_last_commands_of_a_long_history(hrg, recording, tmp_path):
    hrg("demodulate", recording, "-o", tmp_path / "p.h5", "-q")
    periods = store.read(tmp_path / "p.h5", Periods)
    long = tuple(f"hrg step number {k} of many" for k in range(20))
    store.write(
        tmp_path / "long.h5",
        periods.replace(provenance=dataclasses.replace(periods.provenance, history=long)),
    )
    said, whole = (hrg("info", tmp_path / "long.h5", *flags).out for flags in ((), ("--full",)))
    assert [line for line in said.splitlines() if "step number" in line] == list(long[-3:])
    assert "history: 20 commands, the last 3 of them (--full: all)" in said
    assert [line for line in whole.splitlines() if "step number" in line] == list(long)
    assert len(hrg("info", tmp_path / "long.h5", "--json").json["history"]) == 20


def test_a_streams_json_tells_of_all_its_blocks(hrg, recording, tmp_path):
    first = hrg(
        "demodulate", recording, "-o", tmp_path / "p.h5", "--set", "block_samples=500", "--json"
    ).json
    assert first["windows"] == len(store.read(tmp_path / "p.h5", Periods)) > 100 and first[
        "duration_s"
    ] == pytest.approx(0.4, abs=0.01)
    second = hrg("estimate", tmp_path / "p.h5", "-o", tmp_path / "w.h5", "--json").json
    assert second["windows"] == first["windows"] and second["usable"] > 0.9 * first["windows"]


def test_force_and_show_config(hrg, recording, tmp_path):
    out = tmp_path / "p.h5"
    shown = hrg("demodulate", "--show-config", "--periods-per-window", 7)
    assert shown.status == 0 and "periods_per_window = 7" in shown.out
    (tmp_path / "c.toml").write_text(shown.out)
    assert hrg("demodulate", recording, "-o", out, "--config", tmp_path / "c.toml").status == 0
    assert "periods_per_window = 7" in store.read(out, Periods).provenance.settings
    assert hrg("demodulate", recording, "-o", out).status == 1
    assert hrg("demodulate", recording, "-o", out, "--force").status == 0


def test_truth_is_never_read(hrg, recording, tmp_path):
    """A recording with its truth stripped, and one with a false truth, give the same rows."""
    rows = []
    for k, truth in enumerate((None, np.zeros(5), np.full(5, 3.0))):
        store.write(tmp_path / f"r{k}.h5", ringing(truth_time_s=truth, truth_wave_angle_rad=truth))
        assert hrg("demodulate", tmp_path / f"r{k}.h5", "-o", tmp_path / f"p{k}.h5").status == 0
        assert hrg("estimate", tmp_path / f"p{k}.h5", "-o", tmp_path / f"w{k}.h5").status == 0
        with h5py.File(tmp_path / f"w{k}.h5") as file:
            rows.append({name: item[()].tobytes() for name, item in file["wave"].items()})
    assert rows[0] == rows[1] == rows[2]


def test_json_never_holds_nan(hrg, recording, tmp_path):
    result = hrg("demodulate", recording, "-o", tmp_path / "p.h5", "--json")
    json.loads(result.out, parse_constant=lambda name: pytest.fail(f"{name} in JSON"))


def test_stages_and_records_agree():
    for stage in STAGES.values():
        function = stage.load_function()
        assert function.__name__ == stage.name and function.__doc__
