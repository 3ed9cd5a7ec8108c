"""Files in the layouts that oscilloscopes and lock-ins document, and two channels in two files,
become the same recording."""

from pathlib import Path

import h5py
import numpy as np
import pytest
import soundfile
from test_text_logs import mutated

from hrg_cli import settings as hrg_settings
from hrg_cli.errors import HrgError
from hrg_cli.formats import import_log
from hrg_cli.lots.batch import run_lot
from hrg_cli.records import Recording, collect

RATE, N, FIRST = 2e4, 600, -0.015
T = FIRST + np.arange(N) / RATE
C, S = np.cos(2 * np.pi * 1300 * T), 0.5 * np.sin(2 * np.pi * 1300 * T)
STEP = f"{1 / RATE:.6e}"


def whole(path: Path, **settings: object) -> Recording:
    return collect(import_log(path, **settings))  # type: ignore[arg-type]


def lines(form: str, *columns: np.ndarray) -> str:
    return "".join(form.format(*row) + "\r\n" for row in zip(*columns))


def keyed(separator: str, *pairs: tuple[str, object]) -> str:
    return "".join(f"{key}{separator}{value}\r\n" for key, value in pairs)


def tektronix_tds(values: np.ndarray, channel: str) -> str:
    """TDS1000/2000: the keys stand beside the first samples, one channel a file."""
    keys = [
        ("Record Length", f"{N:.6e}"),
        ("Sample Interval", STEP),
        ("Trigger Point", "3.000000000000e+02"),
        *[("", "")] * 3,
    ]
    keys += [
        ("Source", channel),
        ("Vertical Units", "V"),
        ("Vertical Scale", "5.000000e-01"),
        ("Vertical Offset", "0.000000e+00"),
    ]
    keys += [
        ("Horizontal Units", "s"),
        ("Horizontal Scale", "1.000000e-02"),
        ("Pt Fmt", "Y"),
        ("Yzero", "0.000000e+00"),
    ]
    keys += [
        ("Probe Atten", "1.000000e+00"),
        ("Model Number", "TDS2024"),
        ("Serial Number", "C1"),
        ("Firmware Version", "FV:v5.06"),
    ]
    keys += [("", "")] * (N - len(keys))
    return "".join(
        f"{key},{told},,{t:018.12f},{v:9.5f},\r\n" for (key, told), t, v in zip(keys, T, values)
    )


def lecroy(values: np.ndarray) -> str:
    head = f"LECROYHDO4104,19359,Waveform\r\nSegments,1,SegmentSize,{N}\r\nSegment,TrigTime,TimeSinceSegment1\r\n"
    return (
        head
        + "#1,03-Apr-2017 14:53:22,0                 \r\nTime,Ampl\r\n"
        + lines("{:.10g},{:.6g}", T, values)
    )


def rohde_schwarz_rtc(values: np.ndarray, channel: str) -> str:
    return f"in s,{channel} in V\r\n" + lines("{:.8E},{:.5E}", T, values)


def labone(x: np.ndarray, y: np.ndarray, first: int = 7_000_000_000) -> str:
    ticks = first + np.arange(N) * 3000
    return "chunk;timestamp;x;y;freq;phase;dio;trigger;auxin0;auxin1\n" + lines(
        "0;{};{:.9g};{:.9g};1300;0.1;0;0;0;0", ticks, x, y
    )


MSO_HEAD = keyed(
    ",",
    ("Model", "MSO24"),
    ("Firmware Version", "1.38.4\r\n"),
    ("Waveform Type", "ANALOG,,"),
    ("Horizontal Units", "s,,"),
    ("Sample Interval", f"{STEP},,"),
    ("Record Length", f"{N},,"),
    ("Probe Attenuation", "1,1,"),
    ("Vertical Units", "V,V,"),
    ("Vertical Scale", "0.5,0.5,\r\n,,,"),
    ("Label", ",,"),
    ("TIME", "CH1,CH2,"),
)
INFINIIUM_HEAD = keyed(
    ":,",
    ("Revision", 0),
    ("Type", "raw"),
    ("Start", 0),
    ("Points", N),
    ("Count", 1),
    ("XDispRange", "3E-02,3E-02"),
    ("XDispOrg", "-1.5E-02,-1.5E-02"),
    ("XInc", f"{STEP},{STEP}"),
    ("XOrg", "-1.5E-02,-1.5E-02"),
    ("XUnits", "second,second"),
    ("YDispRange", "4,4"),
    ("YUnits", "volt,volt"),
    ("Max Bandwidth", "2.5E+09,2.5E+09"),
    ("Data", ""),
)
TWO = {
    "keysight infiniivision": (
        "x-axis,1,2\r\nsecond,Volt,Volt\r\n" + lines("{:+.6E},{:+.5E},{:+.5E}", T, C, S)
    ),
    "keysight infiniium": INFINIIUM_HEAD + lines("{:.9E},{:.6E},{:.6E}", T, C, S),
    "rigol ds1000z": (
        f"X,CH1,CH2,Start,Increment,\r\nSequence,Volt,Volt,{FIRST:e},{STEP}\r\n"
        + lines("{},{:.5e},{:.5e},", np.arange(N), C, S)
    ),
    "rigol ds1000e": (
        "Time,X(CH1),X(CH2),\r\nSecond,Volt,Volt,\r\n" + lines("{:.6e},{:.5e},{:.5e},", T, C, S)
    ),
    "rigol mso5000": (
        f"CH1(V),CH2(V),t0 ={FIRST:e},tInc = {STEP},\r\n" + lines("{:.6e},{:.6e},,", C, S)
    ),
    "rigol dho": "Time(s),CH1(V),CH2(V)\r\n" + lines("{:.6e},{:.6e},{:.6e}", T, C, S),
    "rohde-schwarz rtc": "in s,CH1 in V,CH2 in V\r\n" + lines("{:.8E},{:.5E},{:.5E}", T, C, S),
    "rohde-schwarz rtm": "[s],CH1[V],CH2[V]\r\n" + lines("{:.8E},{:.5E},{:.5E}", T, C, S),
    "tektronix mso": MSO_HEAD + lines("{:.7e},{:.6g},{:.6g}", T, C, S),
    "picoscope": (
        "Time,Channel A,Channel B\r\n(ms),(V),(V)\r\n\r\n"
        + lines("{:.8f},{:.8f},{:.8f}", 1e3 * T, C, S)
    ),
    "siglent": (
        keyed(
            ",",
            ("Record Length", f"Analog:{N}"),
            ("Sample Interval", "CH1:0.00005,CH2:0.00005"),
            ("Model Number", "SDS"),
        )
        + "Source,CH1,CH2\r\nSecond,Volt,Volt\r\n"
        + lines("{:.9f},{:.5f},{:.5f}", T, C, S)
    ),
}


@pytest.mark.parametrize("name", TWO)
def test_two_channels_in_one_file(tmp_path, name):
    (tmp_path / "log").write_bytes(TWO[name].encode())
    r = whole(tmp_path / "log")
    assert (r.sample_rate_hz, r.time_s, r.c_units, r.status, len(r)) == (
        RATE,
        None,
        "V",
        "valid",
        N,
    )
    np.testing.assert_allclose(r.c, C, atol=1e-5)
    np.testing.assert_allclose(r.s, S, atol=1e-5)


@pytest.mark.parametrize("timed", [True, False])
def test_rohde_schwarz_values_and_header_in_two_files(tmp_path, timed):
    head = keyed(
        ":",
        ("Type", "TEST:0:"),
        ("Resolution", f"{STEP}:"),
        ("XStart", f"{FIRST}:"),
        ("MultiChannelSource", "C1W1:C2W1:"),
    )
    (tmp_path / "run.csv").write_text(head)
    values = lines("{:.9g};{:.6g};{:.6g}", T, C, S) if timed else lines("{:.6g};{:.6g}", C, S)
    (tmp_path / "run.Wfm.csv").write_text(values)
    r = whole(tmp_path / "run.Wfm.csv")
    assert r.sample_rate_hz == RATE
    np.testing.assert_allclose(r.s, S, atol=1e-5)
    with pytest.raises(HrgError, match="no line of numbers"):
        whole(tmp_path / "run.csv")


PAIRS = {
    "tektronix tds": (
        "F01CH1.CSV",
        "F01CH2.CSV",
        "CH1=CH2",
        tektronix_tds(C, "CH1"),
        tektronix_tds(S, "CH2"),
        {},
    ),
    "lecroy": ("C1gyro00000.csv", "C2gyro00000.csv", "C1=C2", lecroy(C), lecroy(S), {}),
    "rohde-schwarz": (
        "one.csv",
        "two.csv",
        "two.csv",
        rohde_schwarz_rtc(C, "CH1"),
        rohde_schwarz_rtc(S, "CH2"),
        {},
    ),
    "labone": (
        "dev1_demods_0_sample_00000.csv",
        "dev1_demods_1_sample_00000.csv",
        "demods_0=demods_1",
        labone(C, 0 * C),
        labone(S, 0 * C),
        {"c": "x", "clock_hz": 60e6},
    ),
}


@pytest.mark.parametrize("name", PAIRS)
def test_a_file_a_channel(tmp_path, name, monkeypatch):
    first, second, rule, one, two, settings = PAIRS[name]
    (tmp_path / first).write_text(one)
    (tmp_path / second).write_text(two)
    monkeypatch.setattr("hrg_cli.formats.text_logs.BLOCK_BYTES", 5000)
    r = whole(tmp_path / first, s_file=rule, **settings)
    assert (r.sample_rate_hz, r.status, len(r)) == (RATE, "valid", N)
    assert r.c_units == ("1" if name in ("lecroy", "labone") else "V")
    np.testing.assert_allclose(r.c, C, atol=1e-5)
    np.testing.assert_allclose(r.s, S, atol=1e-5)
    with pytest.raises(HrgError, match="s_file"):
        (
            whole(tmp_path / first, **{k: v for k, v in settings.items() if k != "c"})
            if name != "labone"
            else whole(tmp_path / first, s_file="nothing.csv")
        )


def test_a_sound_file_a_channel(tmp_path):
    for name, values in (("left", C), ("right", S)):
        soundfile.write(tmp_path / f"{name}.wav", values, int(RATE), subtype="DOUBLE")
    soundfile.write(tmp_path / "slow.wav", S, int(RATE / 2), subtype="DOUBLE")
    soundfile.write(tmp_path / "short.wav", S[:-9], int(RATE), subtype="DOUBLE")
    r = whole(tmp_path / "left.wav", s_file="left=right")
    np.testing.assert_array_equal(r.c, C)
    np.testing.assert_array_equal(r.s, S)
    with pytest.raises(HrgError, match="10000 Hz"):
        whole(tmp_path / "left.wav", s_file="slow.wav")
    with pytest.raises(HrgError, match=r"short\.wav"):
        whole(tmp_path / "left.wav", s_file="short.wav")


def test_two_demodulators_of_labone_in_two_hdf5_files(tmp_path):
    for demodulator, values in ((0, C), (1, S)):
        with h5py.File(tmp_path / f"demod{demodulator}.h5", "w") as f:
            g = f.create_group(f"000/dev1/demods/{demodulator}/sample")
            g["timestamp"], g["x"], g["y"] = (np.arange(N) * 3000).astype("u8"), values, 0 * values
            f["000/dev1"].attrs["clockbase"] = 60e6
    r = whole(tmp_path / "demod0.h5", s_file="demod1.h5")
    assert r.sample_rate_hz == RATE and r.status == "valid"
    np.testing.assert_array_equal(r.s, S)


def test_times_of_both_files_must_agree(tmp_path):
    (tmp_path / "c.csv").write_text(rohde_schwarz_rtc(C, "CH1"))
    shifted = f"in s,CH2 in V\r\n{lines('{:.8E},{:.5E}', T + 0.3 / RATE, S)}"
    wrong = {
        "shifted": (shifted, r"s\.csv: line 2: its time is"),
        "drifting": (
            f"in s,CH2 in V\r\n{lines('{:.8E},{:.5E}', T * (1 + 1e-4), S)}",
            "same acquisition",
        ),
        "shorter": (rohde_schwarz_rtc(S[:-5], "CH2"), r"s\.csv: ends after 595 samples"),
        "without times": ("CH2\r\n" + lines("{:.5E}", S), "has no times"),
        "the log itself": (None, "names the log itself"),
    }
    for text, expected in wrong.values():
        if text is not None:
            (tmp_path / "s.csv").write_text(text)
        with pytest.raises(HrgError, match=expected):
            whole(tmp_path / "c.csv", s_file="c.csv" if text is None else "s.csv")
    with pytest.raises(HrgError, match="'CH9' is not part of its name"):
        whole(tmp_path / "c.csv", s_file="CH9=CH2")
    (tmp_path / "s.csv").write_text(shifted)
    np.testing.assert_allclose(
        whole(tmp_path / "c.csv", s_file="s.csv", time="none", sample_rate_hz=RATE).s, S, atol=1e-5
    )


def test_mutated_files_never_give_anything_but_a_sentence(tmp_path):
    rng = np.random.default_rng(0)
    texts = [(text, None) for text in TWO.values()] + [
        (one, two) for _, _, _, one, two, _ in PAIRS.values()
    ]
    refused = 0
    for _ in range(4):
        for one, two in texts:
            # the first lines are where a layout stands
            (tmp_path / "one").write_bytes(mutated(rng, one[:1500].encode()) + one[1500:].encode())
            (tmp_path / "two").write_bytes(mutated(rng, (two or one).encode()))
            try:
                r = whole(tmp_path / "one", s_file=None if two is None else "two")
                assert len(r.c) == len(r.s) and (r.sample_rate_hz is None) == (r.time_s is not None)
            except HrgError as error:
                refused += 1
                assert "\n" not in str(error)
    assert refused > 10


def test_a_saved_mapping_serves_a_lot_of_pairs(tmp_path, hrg):
    """One mapping, kept as TOML, for every gyro's two files: by `hrg import`, in a lot, and both
    files in the provenance."""
    t = np.arange(12_000) / 4000.0
    for gyro, split in (("A", 0.2), ("B", 0.3)):
        (tmp_path / gyro).mkdir()
        for run, theta in enumerate((0.1, 0.5)):
            envelope = np.exp(-0.4 * t)
            for channel, part in (
                ("CH1", np.cos(2 * theta + split * t)),
                ("CH2", np.sin(2 * theta + split * t)),
            ):
                noise = 1e-4 * np.random.default_rng(run).standard_normal(len(t))
                body = lines(
                    "{:.8E},{:.6E}", t, envelope * part * np.cos(2 * np.pi * 503 * t) + noise
                )
                (tmp_path / gyro / f"r{run}{channel}.CSV").write_text(
                    f"in s,{channel} in V\r\n{body}"
                )
    shown = hrg("import", "--s-file", "CH1=CH2", "--mode", "free", "--show-config").out
    (tmp_path / "lab.toml").write_text(shown)
    one = hrg(
        "import",
        tmp_path / "A" / "r0CH1.CSV",
        "--config",
        tmp_path / "lab.toml",
        "-o",
        tmp_path / "one.h5",
        "--json",
    )
    assert one.status == 0 and one.json["samples"] == len(t)
    sources = hrg("info", tmp_path / "one.h5", "--json").json["sources"]
    assert [source["name"] for source in sources] == ["r0CH1.CSV", "r0CH2.CSV"]
    mapping = hrg_settings.load_toml(tmp_path / "lab.toml")["import"]
    assert mapping["s_file"] == "CH1=CH2"
    (tmp_path / "lot.toml").write_text(f'recordings = "*/*.CSV"\nstages = []\n{shown}')
    report = run_lot(tmp_path / "lot.toml", tmp_path / "out")
    assert report["recordings"] == 4 and report["recordings_failed"] == 0
    assert sorted(p.name for p in (tmp_path / "out" / "A").glob("*.wave.h5")) == [
        "r0CH1.wave.h5",
        "r1CH1.wave.h5",
    ]
    wave = tmp_path / "out" / "B" / "r0CH1.wave.h5"
    before = wave.stat().st_mtime_ns
    run_lot(tmp_path / "lot.toml", tmp_path / "out")
    assert wave.stat().st_mtime_ns == before
    (tmp_path / "B" / "r0CH2.CSV").write_text(
        (tmp_path / "B" / "r0CH2.CSV").read_text().replace("E-01\r\n", "E-02\r\n", 1)
    )
    run_lot(tmp_path / "lot.toml", tmp_path / "out")
    assert wave.stat().st_mtime_ns != before
