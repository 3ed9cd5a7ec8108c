"""Values are held to their declaration: at reading whole, at reading block by block, and before a
file is written."""

import h5py
import numpy as np
import pytest
from test_store import small

from hrg_cli import store
from hrg_cli.errors import HrgError
from hrg_cli.records import KINDS, Calibration, Periods, Record, Recording, Wave
from hrg_cli.store import handles
from hrg_cli.store.layout import find_place

DAMAGES = {
    "nan": (
        lambda v: _put(v, np.nan),
        lambda valid: valid.missing != "anywhere" and not valid.raw,
        "finite",
    ),
    "infinity": (
        lambda v: _put(v, np.inf),
        lambda valid: not (valid.raw or valid.infinite),
        "finite",
    ),
    "negative": (
        lambda v: _put(v, -3),
        lambda valid: any(b is not None and b > -3 for b in (valid.at_least, valid.above)),
        "was expected",
    ),
    "equal rows": (lambda v: _put(v, v.flat[0]), lambda valid: valid.rising, "increase"),
    "backwards": (lambda v: v[::-1], lambda valid: valid.rising, "increase"),
    "booleans": (lambda v: np.ones(v.shape, bool), lambda valid: True, "numbers were expected"),
    "complex": (lambda v: v.astype(complex), lambda valid: True, "numbers were expected"),
}
WHOLE_NUMBERS = ("u1", "i2", "i4", "i8")


def _put(values, what):
    changed = np.array(values, dtype=float if np.isnan(what) or np.isinf(what) else None)
    if what == -3 and changed.dtype.kind == "u":
        changed = changed.astype("i2")
    changed[1] = what
    return changed


def _cases():
    for kind in KINDS:
        for name, spec in kind.columns().items():
            if spec.dims is None or spec.dtype == "str":
                continue
            for damage, (_, applies, _) in DAMAGES.items():
                fractions = (
                    damage in ("nan", "infinity") and spec.dtype in WHOLE_NUMBERS
                )  # refused by their type
                if applies(spec.valid) and not fractions:
                    yield pytest.param(kind, name, damage, id=f"{kind.kind}-{name}-{damage}")
            if spec.dtype in WHOLE_NUMBERS:
                yield pytest.param(kind, name, "fractions", id=f"{kind.kind}-{name}-fractions")


def _damaged(folder, kind, name, damage):
    path = folder / "a.h5"
    record = small(kind)
    if name == "time_s" and kind is Recording:
        record = record.replace(time_s=np.arange(7) / 10.0, sample_rate_hz=None)
    if name == "frequency_hz" and kind is Calibration:
        record = record.replace(axis="frequency", frequency_hz=np.array([1.0, 2.0, 3.0]))
    if hasattr(record, "flags") and damage == "nan":
        record = record.replace(flags=np.zeros(len(record), "u1"))
    store.write(path, record)
    spec = kind.columns()[name]
    place = find_place(kind, name, spec)
    with h5py.File(path, "r+") as file:
        before = file[place][()]
        change = (lambda v: v + 0.5) if damage == "fractions" else DAMAGES[damage][0]
        attributes = {key: file[place].attrs[key] for key in ("units", "long_name")}
        if spec.dims[0] in file[place].parent and file[place].name.endswith("/" + spec.dims[0]):
            pytest.skip("a column that is its own scale")
        del file[place]
        file[place] = change(before)
        file[place].attrs.update(attributes)
    return path, place


@pytest.mark.parametrize(("kind", "name", "damage"), list(_cases()))
def test_every_column_is_held_to_its_declaration(kind, name, damage, tmp_path):
    path, place = _damaged(tmp_path, kind, name, damage)
    says = "whole numbers were expected" if damage == "fractions" else DAMAGES[damage][2]
    with pytest.raises(HrgError) as whole:
        store.read(path, kind)
    assert says in str(whole.value) and place in str(whole.value) and str(path) in str(whole.value)
    with pytest.raises(HrgError) as by_blocks, store.open_record(path, kind) as record:
        for block in record.blocks(2):
            assert isinstance(block, Record)
        assert not record.columns()[name].valid.raw
    assert place in str(by_blocks.value)


@pytest.mark.parametrize("through", ["dataset", "group", "soft links"])
def test_a_link_into_another_file_is_refused_before_it_is_followed(through, tmp_path):
    """HDF5 waits for ever where the other file is a pipe that nobody writes; here it is none."""
    path = tmp_path / "run.h5"
    store.write(path, small(Recording))
    away = h5py.ExternalLink("gone.h5", "/recording/s")
    with h5py.File(path, "r+") as file:
        if through == "group":
            del file["/recording"]
            file["/recording"] = away
        else:
            del file["/recording/s"]
            file["/recording/s"] = h5py.SoftLink("/a/t") if through == "soft links" else away
            file["/a/t"] = h5py.SoftLink("u")
            file["/a/u"] = away
    for ask in (
        store.read_any,
        store.find_kind,
        lambda p: store.read_texts(p, "/recording/s", ["x"]),
    ):
        with pytest.raises(HrgError, match=r"lies in another file; copy it into this one$") as told:
            ask(path)
        assert str(path) in str(told.value)


@pytest.mark.parametrize("number", [-1, 256, 70000])
def test_whole_numbers_that_their_type_cannot_hold_are_refused(number, tmp_path):
    """A wider integer from another program: kept as eight bits it would be another number."""
    store.write(tmp_path / "a.h5", small(Wave))
    with h5py.File(tmp_path / "a.h5", "r+") as file:
        flags = file["wave/flags"]
        values, attributes = flags[()].astype("i8"), {"long_name": flags.attrs["long_name"]}
        values[-1] = number
        del file["wave/flags"]
        file["wave/flags"] = values
        file["wave/flags"].attrs.update(attributes)
    with pytest.raises(HrgError, match=f"/wave/flags holds {number} .*a number from 0 to 255"):
        store.read(tmp_path / "a.h5", Wave)


@pytest.mark.parametrize("kind", KINDS, ids=lambda k: k.kind)
def test_nothing_that_breaks_its_promise_is_written(kind, tmp_path):
    record = small(kind)
    for name, spec in kind.columns().items():
        if (
            spec.dims is None
            or spec.dtype != "f8"
            or getattr(record, name) is None
            or spec.valid.missing == "anywhere"
        ):
            continue
        with pytest.raises(HrgError, match=f"a.h5: was not written: {name} holds inf"):
            store.write(
                tmp_path / "a.h5", record.replace(**{name: _put(getattr(record, name), np.inf)})
            )
    assert not list(tmp_path.iterdir())


def test_a_stream_that_stops_rising_is_not_written(tmp_path):
    record = small(Wave)
    with pytest.raises(HrgError, match=r"row 8 after .* increase from row to row"):
        store.write(tmp_path / "a.h5", iter([record, record]))
    assert not list(tmp_path.iterdir())


def test_nan_may_stand_where_a_flag_says_so(tmp_path):
    record = small(Wave).replace(
        flags=np.array([0, 0, 4, 0, 0, 0, 0], "u1"),
        iterations=np.array([0, 0, 0, -1, 0, 0, 0], "i2"),
    )
    angle = np.array(record.wave_angle_rad)
    angle[[2, 3]] = np.nan
    store.write(tmp_path / "a.h5", record.replace(wave_angle_rad=angle))
    assert np.isnan(store.read(tmp_path / "a.h5", Wave).wave_angle_rad[2:4]).all()
    with store.open_record(tmp_path / "a.h5", Wave) as opened:
        assert np.isnan(opened.rows(2, 4).wave_angle_rad).all()
    angle[0] = np.nan
    with pytest.raises(HrgError, match="where no flag is set"):
        store.write(tmp_path / "b.h5", record.replace(wave_angle_rad=angle))


ATTRIBUTES = [
    (Recording, "recording", "sample_rate_hz", 1e300, "at most"),
    (Recording, "recording", "sample_rate_hz", np.nan, "finite"),
    (Recording, "recording", "mode_number", 0, "1 or more"),
    (Recording, "recording", "mode_number", 10**9, "at most"),
    (Wave, "wave", "reference_frequency_hz", -1.0, "positive"),
    (Wave, "wave", "window_s", 0.0, "positive"),
    (Wave, "wave", "mode", "loose", '"free" or "forced" was expected'),
    (Calibration, "calibration", "details", "[1, 2]", "no object"),
    (Calibration, "calibration", "details", "{" * 100_000, "no JSON object"),
    (Calibration, "calibration", "axis", "frequency", "has no nodes of it"),
    (Calibration, "calibration", "rate_min_rad_s", 1e6, "above its highest"),
]


@pytest.mark.parametrize(("kind", "group", "name", "value", "says"), ATTRIBUTES)
def test_every_attribute_is_held_to_its_declaration(kind, group, name, value, says, tmp_path):
    store.write(tmp_path / "a.h5", small(kind))
    with h5py.File(tmp_path / "a.h5", "r+") as file:
        if isinstance(value, str) and len(value) > 60_000:
            value = value[:60_000]
        file[group].attrs[name] = value
    with pytest.raises(HrgError, match=says):
        store.read(tmp_path / "a.h5", kind)


@pytest.mark.parametrize(
    ("signals", "readout"), [(3, "direct"), (5, "direct"), (8, "direct"), (4, "carrier")]
)
def test_signals_are_as_many_as_the_read_out_has(signals, readout, tmp_path):
    record = small(Periods).replace(
        readout=readout, signals=np.ones((7, signals)), signals_std=np.ones((7, signals))
    )
    store.write(tmp_path / "a.h5", small(Periods))
    with h5py.File(tmp_path / "a.h5", "r+") as file:
        file["periods"].attrs["readout"] = readout
        for name in ("signals", "signals_std"):
            del file["periods"][name]
            file["periods"][name] = getattr(record, name)
    with pytest.raises(HrgError, match=r"signals"):
        store.read(tmp_path / "a.h5", Periods)


def test_a_column_that_unpacks_to_far_more_than_its_file_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr("hrg_cli.store.dataset_checks.UNPACKED_BYTES", 1 << 20)
    store.write(tmp_path / "a.h5", small(Wave))
    with h5py.File(tmp_path / "a.h5", "r+") as file:
        for name in list(file["wave"]):
            if file["wave"][name].shape == (7,) and "NAME" not in file["wave"][name].attrs:
                values = np.resize(file["wave"][name][()], 400_000) * 0
                del file["wave"][name]
                file["wave"].create_dataset(
                    name, data=values, compression="gzip", chunks=(1 << 15,)
                )
    with pytest.raises(HrgError, match="would unpack"):
        store.read(tmp_path / "a.h5", Wave)


def test_more_records_may_be_open_than_files(tmp_path, monkeypatch):
    """Files are closed to make room and opened again; what they hold is the same, and a changed one
    is noticed."""
    monkeypatch.setattr(handles, "MOST_OPEN", 3)
    from contextlib import ExitStack

    paths = [tmp_path / f"{n}.h5" for n in range(9)]
    for n, path in enumerate(paths):
        store.write(path, small(Wave).replace(run_id=f"{n}", main_amplitude=np.full(7, float(n))))
    with ExitStack() as stack:
        records = [stack.enter_context(store.open_record(path, Wave)) for path in paths]
        for start in (0, 3):
            for n, record in enumerate(records):
                assert record.rows(start, start + 2).main_amplitude.tolist() == [n, n]
                assert len(handles._in_use) <= 3
        store.write(paths[0], small(Wave, 9), force=True)
        with pytest.raises(HrgError, match=r"0\.h5: changed while it was read"):
            records[0].rows(0, 2)
    assert not handles._in_use


def test_rows_that_fall_between_two_blocks_are_seen(tmp_path):
    """Each block rises by itself; the second begins before the first ended."""
    path = tmp_path / "wave.h5"
    store.write(path, small(Wave, 40))
    with h5py.File(path, "r+") as file:
        time = file["wave/time_s"]
        time[20:] = time[20:] - (time[20] - time[15])
    with store.open_record(path, Wave) as record:
        blocks = record.blocks(20)
        next(blocks)
        with pytest.raises(HrgError, match=r"time_s holds .* in row 21 after .* must increase"):
            next(blocks)


@pytest.mark.parametrize("stored", [">f8", "<f4", ">i4"])
def test_rows_read_lazily_have_the_declared_type(stored, tmp_path):
    """Another program's byte order or width: what is computed with is the machine's double."""
    path = tmp_path / "wave.h5"
    store.write(path, small(Wave, 12))
    values = np.arange(1, 13)
    with h5py.File(path, "r+") as file:
        units = file["wave/main_amplitude"].attrs["units"]
        del file["wave/main_amplitude"]
        made = file.create_dataset("wave/main_amplitude", data=values.astype(stored))
        made.attrs["units"] = units
    with store.open_record(path, Wave) as record:
        read = next(record.blocks(12)).main_amplitude
        assert read.dtype == np.dtype(float) and read.dtype.isnative
        assert (record.main_amplitude[3:7] * 2.5).dtype == np.dtype(float)
    np.testing.assert_array_equal(read, values)
