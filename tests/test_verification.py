"""`hrg verify`: what was written is recognised as whole, and every kind of change in a chain or a
lot is found and named."""

import json
import os
import shutil
from pathlib import Path

import h5py
import numpy as np
import pytest
from conftest import ringing
from cryptography.hazmat.primitives.asymmetric import ed25519
from lot_recordings import run_down, split_of
from small_records import small

from hrg_cli import signatures, store
from hrg_cli.errors import HrgError
from hrg_cli.lots.batch import run_lot
from hrg_cli.records import KINDS, Periods, Recording
from hrg_cli.store import checksums
from hrg_cli.verification import report, verify


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A recording's chain to a resonator."""
    from hrg_cli import pipeline, settings

    folder = tmp_path_factory.mktemp("made")
    for run, theta in enumerate((0.1, 0.6)):
        store.write(folder / f"r{run}.h5", run_down("G", f"{run}", theta, 0.4, run))
    steps = [("demodulate", [f"r{n}.h5"], f"p{n}.h5") for n in (0, 1)] + [
        ("estimate", [f"p{n}.h5"], f"w{n}.h5") for n in (0, 1)
    ]
    for name, inputs, output in [*steps, ("identify", ["w0.h5", "w1.h5"], "resonator.h5")]:
        values = settings.check_settings(pipeline.STAGES[name].load_function(), {})
        typed = f"hrg {name} {' '.join(inputs)} -o {output}"
        paths = [folder / i for i in inputs]
        pipeline.run_stage(name, paths, folder / output, values, command_line=typed)
    return folder


@pytest.fixture
def chain(made, tmp_path):
    """A copy of the chain to change."""
    return shutil.copytree(made, tmp_path / "chain")


def results(path):
    return {v.name.rsplit("/", 1)[-1]: v for v in verify([path])}


def test_an_untouched_chain_is_whole(chain, hrg):
    told = hrg("verify", chain, "--json")
    assert told.status == 0 and told.json["status"] == "valid" and len(told.json["files"]) == 7
    assert all(f["result"] == "whole" and not f["findings"] for f in told.json["files"])
    alone = hrg("verify", chain / "resonator.h5", "--json").json["files"]
    assert {f["kind"] for f in alone} == {"resonator", "wave", "periods", "recording"}, (
        "its sources are followed"
    )


def test_what_holds_of_many_sources_is_said_once(chain, tmp_path, hrg):
    """A file alone, away from its sources; then beside others of their names."""
    alone = tmp_path / "alone"
    alone.mkdir()
    shutil.copy(chain / "resonator.h5", alone)
    shown = hrg("verify", alone / "resonator.h5")
    assert shown.status == 0 and shown.out.count("followed") == 1
    assert "not in the folder, so not followed: w0.h5, w1.h5" in shown.out
    for name in ("w0.h5", "w1.h5"):
        shutil.copy(chain / "r0.h5", alone / name)
    (told,) = hrg("verify", alone / "resonator.h5", "--json").json["files"]
    assert told["result"] == "changed" and len(told["findings"]) == 1
    assert "was made from another w0.h5, w1.h5 than lies here" in told["findings"][0]


def test_a_file_that_many_were_made_from_is_looked_at_once(made, monkeypatch):
    """The runs of a chain meet again in their resonator: work in proportion to the files."""
    looked = []
    monkeypatch.setattr(store, "find_changes", lambda path: looked.append(path.name) or [])
    paths = [made / name for name in ("resonator.h5", "w0.h5", "w1.h5", "r0.h5")]
    assert len(verify(paths)) == 7
    assert len(looked) == len(set(looked)) == 7


def change_value(path):
    with h5py.File(path, "r+") as file:
        file["periods/signals"][3, 1] *= 1 + 1e-12


def change_attribute(path):
    with h5py.File(path, "r+") as file:
        file["periods"].attrs["gyro_id"] = "another"


def change_unit(path):
    with h5py.File(path, "r+") as file:
        file["periods/signals"].attrs["units"] = "mV"


def change_status(path):
    with h5py.File(path, "r+") as file:
        file.attrs["status_reasons"] = "[]"
        file.attrs["history"] = ""


def add_dataset(path):
    with h5py.File(path, "r+") as file:
        file["periods/notes"] = np.zeros(3)


def remove_dataset(path):
    with h5py.File(path, "r+") as file:
        del file["spectrum"]["density"]


def claim_more(path):
    with h5py.File(path, "r+") as file:
        del file["periods/time_s"]
        file.create_dataset("periods/time_s", shape=(1 << 40,), dtype="f8", chunks=(1 << 16,))


def add_link(path):
    with h5py.File(path, "r+") as file:
        file["spectrum/other"] = h5py.SoftLink("/periods/time_s")


def add_in_disguise(path):
    """A column that readers take and that says of itself to be a length."""
    with h5py.File(path, "r+") as file:
        rows = file["periods/time_s"].shape[0]
        added = file.create_dataset("periods/temperature_degc", data=np.linspace(0, 40, rows))
        added.attrs["units"] = "degC"
        added.attrs["NAME"] = b"This is a netCDF dimension but not a netCDF variable         7"


def spoil_checksums(path):
    with h5py.File(path, "r+") as file:
        file.attrs["checksums"] = "nan"


CHANGES = {
    "the checksums themselves": (spoil_checksums, "the checksums were changed"),
    "a dataset that claims a size": (claim_more, "the values of /periods/time_s were changed"),
    "a value in its last digits": (change_value, "the values of /periods/signals were changed"),
    "an attribute": (change_attribute, "the attributes of /periods were changed"),
    "a unit": (change_unit, "the attributes of /periods/signals were changed"),
    "the history": (change_status, "the attributes of / were changed"),
    "an added link": (add_link, "/spectrum/other was added, a link"),
    "a dataset added in disguise": (
        add_in_disguise,
        "the values of /periods/temperature_degc were added",
    ),
    "an added dataset": (add_dataset, "the values of /periods/notes were added"),
    "a removed dataset": (remove_dataset, "/spectrum/density was removed"),
}


@pytest.mark.parametrize("what", CHANGES)
def test_every_change_is_named(what, chain, hrg):
    change, says = CHANGES[what]
    change(chain / "p0.h5")
    told = hrg("verify", chain, "--json")
    assert told.status == 3 and told.json["status"] == "refused"
    found = {f["name"].rsplit("/", 1)[-1]: f for f in told.json["files"]}
    assert found["p0.h5"]["result"] in ("changed", "damaged") and says in found["p0.h5"]["findings"]
    assert (
        found["w0.h5"]["result"] == "changed"
        and "made from another p0.h5" in found["w0.h5"]["findings"][0]
    )
    assert (
        found["p1.h5"]["result"]
        == found["w1.h5"]["result"]
        == found["resonator.h5"]["result"]
        == "whole"
    )


def forge(path, change):
    """Change a file and seal it again, as anyone can who can write it."""
    with h5py.File(path, "r+") as file:
        change(file)
        del file.attrs["checksums"]
        checksums.seal(file, {})


def name_source(path, old, source):
    """Let a file say that it was made from another source than `old`, and seal it again."""

    def change(file):
        sources = json.loads(file.attrs["sources"])
        for one in sources:
            if one["name"] == old:
                one |= {"name": source.name, "sha256": store.compute_sha256(source)}
        file.attrs["sources"] = json.dumps(sources)

    forge(path, change)


def louder(file):
    file["periods/signals"][3, 1] *= 1.5


def test_a_forged_file_is_found_by_what_was_made_from_it(chain):
    """Sealed again it is whole; what was made from the one before tells."""
    forge(chain / "p0.h5", louder)
    told = results(chain)
    assert told["p0.h5"].result == "whole" and told["w0.h5"].result == "changed"
    name_source(chain / "w0.h5", "p0.h5", chain / "p0.h5")
    told = results(chain)
    assert told["w0.h5"].result == "whole" and told["resonator.h5"].result == "changed"


def test_a_chain_forged_to_its_end_is_found_by_its_signature_alone(chain):
    """What the pages say that checksums cannot tell."""
    key = ed25519.Ed25519PrivateKey.generate()
    signature = key.sign((chain / "resonator.h5").read_bytes())
    (chain / "resonator.h5.sig").write_bytes(signature)
    signatures.need_signed(chain / "resonator.h5", key.public_key())
    forge(chain / "p0.h5", louder)
    name_source(chain / "w0.h5", "p0.h5", chain / "p0.h5")
    name_source(chain / "resonator.h5", "w0.h5", chain / "w0.h5")
    assert all(state.result == "whole" for state in verify([chain]))
    with pytest.raises(HrgError, match=r"resonator\.h5: .*sign"):
        signatures.need_signed(chain / "resonator.h5", key.public_key())


def shorten(file):
    file.attrs["history"] = file.attrs["history"].splitlines()[-1]


def test_a_history_that_was_shortened_is_found_beside_its_sources(chain):
    """hrg hands on every line of what it takes."""
    forge(chain / "resonator.h5", shorten)
    (said, _) = results(chain)["resonator.h5"].findings
    assert "its history lacks 2 of 2 lines of its source w0.h5 (" in said
    assert results(chain / "resonator.h5")["resonator.h5"].result == "changed"


def test_a_source_exchanged_for_another_of_its_shape_is_found(chain):
    """The sources were written to name the other run, checksums and all."""
    name_source(chain / "w0.h5", "p0.h5", chain / "p1.h5")
    name_source(chain / "resonator.h5", "w0.h5", chain / "w0.h5")
    told = results(chain)
    assert "lines of its source p1.h5" in told["w0.h5"].findings[0]
    assert told["resonator.h5"].result == "whole"


def test_a_time_before_that_of_a_source_is_noted(chain):
    forge(chain / "resonator.h5", lambda file: file.attrs.update(created="2001-01-01T00:00:00Z"))
    told = results(chain)["resonator.h5"]
    assert told.result == "whole" and len(told.notes) == 2
    assert "was written 2001-01-01T00:00:00Z, its source w0.h5 later (" in told.notes[0]


def test_sources_that_changed_names_or_are_gone_from_the_file_are_noted(chain):
    (chain / "p0.h5").rename(chain / "p")
    (chain / "p1.h5").rename(chain / "p0.h5")
    (chain / "p").rename(chain / "p1.h5")
    told = results(chain)
    assert told["w0.h5"].result == "whole"
    assert told["w0.h5"].notes == ["its source p0.h5 lies here as p1.h5"]
    forge(chain / "resonator.h5", lambda file: file.attrs.update(sources="[]"))
    (said,) = results(chain)["resonator.h5"].notes
    assert said.startswith("names no sources")


def test_a_file_that_cannot_be_read_does_not_end_the_verification(chain, monkeypatch):
    """A bad sector in one of many files, and nothing was said of the others."""
    own = store.compute_sha256

    def unless(path):
        if path.name == "p0.h5":
            raise HrgError(f"{path}: is damaged (Input/output error); copy or record it again")
        return own(path)

    monkeypatch.setattr(store, "compute_sha256", unless)
    told = results(chain)
    assert told["w0.h5"].result == "damaged"
    assert told["w0.h5"].findings == ["its source p0.h5 cannot be read"]
    assert told["w1.h5"].result == told["resonator.h5"].result == "whole"


def test_a_source_made_again_with_other_settings_is_found(chain):
    from hrg_cli import pipeline, settings

    values = settings.check_settings(
        pipeline.STAGES["demodulate"].load_function(), {"periods_per_window": 3.0}
    )
    pipeline.run_stage("demodulate", [chain / "r0.h5"], chain / "p0.h5", values, force=True)
    verdicts = results(chain)
    assert verdicts["p0.h5"].result == "whole" and verdicts["w0.h5"].result == "changed"
    pipeline.run_stage(
        "estimate",
        [chain / "p0.h5"],
        chain / "w0.h5",
        settings.check_settings(pipeline.STAGES["estimate"].load_function(), {}),
        force=True,
    )
    assert results(chain)["resonator.h5"].result == "changed"


def test_settings_that_differ_between_runs_are_noted(chain):
    from hrg_cli import pipeline, settings

    values = settings.check_settings(
        pipeline.STAGES["estimate"].load_function(), {"solver": "levenberg-marquardt"}
    )
    pipeline.run_stage("estimate", [chain / "p0.h5"], chain / "w0.h5", values, force=True)
    inputs = [chain / "w0.h5", chain / "w1.h5"]
    pipeline.run_stage(
        "identify",
        inputs,
        chain / "resonator.h5",
        settings.check_settings(pipeline.STAGES["identify"].load_function(), {}),
        force=True,
    )
    verdict = results(chain)["resonator.h5"]
    assert (
        verdict.result == "whole"
        and "different settings (estimate.solver): w0.h5; w1.h5" in verdict.notes[0]
    )


def test_a_renamed_source_is_found_and_a_missing_one_is_noted(chain):
    (chain / "r0.h5").rename(chain / "kept.h5")
    (chain / "r1.h5").unlink()
    verdicts = results(chain)
    assert all(v.result == "whole" for v in verdicts.values()) and not verdicts["p0.h5"].notes
    assert verdicts["p1.h5"].not_followed == ["r1.h5"] and not verdicts["p1.h5"].notes


def test_a_laboratorys_file_is_not_called_whole(tmp_path, hrg):
    store.write(tmp_path / "a.h5", ringing())
    with h5py.File(tmp_path / "a.h5", "r+") as file:
        del file.attrs["checksums"]
    assert [v.result for v in verify([tmp_path / "a.h5"])] == ["without checksums"]
    assert (
        hrg("verify", tmp_path / "a.h5").status == 0
        and hrg("verify", tmp_path / "a.h5", "--strict").status == 3
    )


def test_a_pipe_is_no_lots_note(tmp_path, monkeypatch):
    """A pipe called x.json in the folder was waited for without end."""
    store.write(tmp_path / "run.h5", small(Recording))
    os.mkfifo(tmp_path / "x.json")
    monkeypatch.setattr(Path, "read_text", lambda *_, **__: pytest.fail("it was read"))
    assert [state.result for state in verify([tmp_path])] == ["whole"]


@pytest.mark.parametrize("text", ["", "nan", "[]", "{", "[" * 20_000, '{"/": ', 3.0, "{}"])
def test_checksums_that_are_none_were_changed(text, tmp_path):
    """Whoever spoilt them made of a changed file one that never had any, and exit 0 of 3."""
    store.write(tmp_path / "a.h5", ringing())
    with h5py.File(tmp_path / "a.h5", "r+") as file:
        file.attrs["checksums"] = text
    assert [v.result for v in verify([tmp_path / "a.h5"])] == ["changed"]


def test_values_that_cannot_be_read_are_damage_without_checksums_too(tmp_path):
    """They were "without checksums": nothing had read them."""
    path = tmp_path / "log.h5"
    store.write(path, ringing(seconds=2.0))
    with h5py.File(path, "r+") as file:
        del file.attrs["checksums"]
        place = file["recording/s"].id.get_chunk_info(0)
    raw = bytearray(path.read_bytes())
    raw[place.byte_offset + place.size // 2] ^= 0xFF
    path.write_bytes(raw)
    (state,) = verify([path])
    assert state.result == "damaged"
    assert any("/recording/s cannot be read" in found for found in state.findings)


@pytest.mark.parametrize("kind", KINDS, ids=lambda k: k.kind)
def test_every_kind_is_whole_as_it_is_written_and_read(kind, tmp_path):
    store.write(tmp_path / "a.h5", small(kind))
    assert store.find_changes(tmp_path / "a.h5") == []


def test_a_stream_keeps_the_checksums_of_the_whole(tmp_path):
    whole = small(Periods, 100)
    store.write(tmp_path / "a.h5", whole.blocks(7))
    store.write(tmp_path / "b.h5", ringing(seconds=2.0).blocks(1000))
    assert (
        store.find_changes(tmp_path / "a.h5") == [] and store.find_changes(tmp_path / "b.h5") == []
    )
    assert store.read(tmp_path / "b.h5", Recording).c.dtype == np.dtype("i2")


def test_a_lots_notes_are_compared(tmp_path, monkeypatch):
    (tmp_path / "data").mkdir()
    for run, theta in enumerate((0.1, 0.6)):
        store.write(
            tmp_path / "data" / f"{run}.h5", run_down("G", f"{run}", theta, split_of(1), run)
        )
    (tmp_path / "lot.toml").write_text('recordings = "data/*.h5"\nstages = ["identify"]\n')
    out = tmp_path / "out"
    run_lot(tmp_path / "lot.toml", out)
    assert report(verify([out]))["status"] == "valid"
    store.write(
        out / "G" / "0.wave.h5",
        store.read_any(out / "G" / "0.wave.h5").replace(run_id="9"),
        force=True,
    )  # and sealed anew
    (out / "G" / "1.periods.h5").unlink()
    unreadable = out / "G" / "0.periods.h5"
    own = store.compute_sha256
    monkeypatch.setattr(
        store, "compute_sha256", lambda path: own(path if path != unreadable else tmp_path / "gone")
    )
    verdicts = results(out)
    assert "cannot be read; 0.json notes it" in verdicts["0.periods.h5"].findings
    assert verdicts["0.wave.h5"].findings == [
        "its source 0.periods.h5 cannot be read",
        "is not what the lot wrote (0.json notes another SHA-256)",
    ]
    assert verdicts["1.periods.h5"].findings == ["was removed; 1.json notes it"]
    assert verdicts["resonator.h5"].result == "changed"


def test_nothing_to_verify_is_said(tmp_path, hrg):
    assert "holds no hrg files" in hrg("verify", tmp_path).err
    assert hrg("verify").status == 2
    (tmp_path / "a.h5").write_bytes(b"not HDF5")
    told = hrg("verify", tmp_path / "a.h5", "--json")
    assert told.status == 3 and json.loads(told.out)["files"][0]["result"] == "damaged"
