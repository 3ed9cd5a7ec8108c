"""WAV and FLAC files: integers stay integers, lengths are compared, damaged ones give a
sentence."""

import os
from pathlib import Path

import numpy as np
import pytest
import soundfile

from hrg_cli.errors import HrgError
from hrg_cli.formats import audio, import_log
from hrg_cli.records import Recording, collect

RNG = np.random.default_rng(3)
SAMPLES = RNG.integers(-30_000, 30_000, (5000, 2))


def whole(path: Path, **settings: object) -> Recording:
    return collect(import_log(path, **settings))  # type: ignore[arg-type]


@pytest.mark.parametrize("name", ["log.wav", "log.flac"])
def test_sixteen_bit_integers_stay_as_they_are(tmp_path, name):
    soundfile.write(tmp_path / name, SAMPLES.astype("i2"), 12_345, subtype="PCM_16")
    r = whole(tmp_path / name)
    assert r.c.dtype == np.int16 and r.sample_rate_hz == 12_345 and r.time_s is None
    np.testing.assert_array_equal(np.stack([r.c, r.s], 1), SAMPLES)
    assert r.physical()[0].max() <= 1 and r.c_scale_factor == 2.0**-15


@pytest.mark.parametrize("subtype", ["PCM_24", "PCM_32", "FLOAT", "DOUBLE", "PCM_U8"])
def test_every_sample_format_keeps_its_values(tmp_path, subtype):
    values = np.round(SAMPLES / 2**15 * 100) / 128
    soundfile.write(tmp_path / "log.wav", values, 8000, subtype=subtype)
    r = whole(tmp_path / "log.wav")
    np.testing.assert_allclose(np.stack(r.physical(), 1), values, atol=1e-6)


def test_the_suffix_is_not_trusted(tmp_path):
    soundfile.write(tmp_path / "log.csv", SAMPLES.astype("i2"), 8000, format="FLAC")
    assert len(whole(tmp_path / "log.csv")) == 5000


def test_channels_by_number_and_one_channel(tmp_path):
    four = RNG.integers(-9, 9, (100, 4)).astype("i2")
    soundfile.write(tmp_path / "log.wav", four, 8000)
    r = whole(tmp_path / "log.wav", c=4, s=2)
    np.testing.assert_array_equal(r.c, four[:, 3])
    np.testing.assert_array_equal(r.s, four[:, 1])
    soundfile.write(tmp_path / "mono.wav", four[:, 0], 8000)
    with pytest.raises(HrgError, match='s = "none"'):
        whole(tmp_path / "mono.wav")
    mono = whole(tmp_path / "mono.wav", s="none")
    assert mono.status == "suspect" and not mono.s.any() and mono.s.dtype == np.int16


def test_blocks_stream(tmp_path, monkeypatch):
    soundfile.write(tmp_path / "log.flac", SAMPLES.astype("i2"), 8000)
    monkeypatch.setattr(audio, "BLOCK_ROWS", 2048)
    blocks = list(import_log(tmp_path / "log.flac", constant_rate_rad_s=0.5))
    assert len(blocks) == 5
    joined = collect(iter(blocks))
    np.testing.assert_array_equal(joined.c, SAMPLES[:, 0])
    assert joined.auxiliary_time_s.tolist() == [0, 4999 / 8000] and joined.rate_rad_s.tolist() == [
        0.5,
        0.5,
    ]


@pytest.mark.parametrize("name", ["log.wav", "log.flac"])
@pytest.mark.parametrize("keep", [0.0, 0.001, 0.3, 0.9])
def test_a_truncated_file_is_a_sentence(tmp_path, name, keep):
    path = tmp_path / name
    soundfile.write(path, SAMPLES.astype("i2"), 8000)
    data = path.read_bytes()
    path.write_bytes(data[: int(keep * len(data))])
    with pytest.raises(HrgError, match=name):
        whole(path)


def fuzz(tmp_path: Path, count: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    for name in ("log.wav", "log.flac"):
        path = tmp_path / name
        soundfile.write(path, SAMPLES[:600].astype("i2"), 8000)
        data = path.read_bytes()
        for _ in range(count):
            mutated = bytearray(data)
            for place in rng.integers(
                0, 60 if rng.random() < 0.7 else len(data), rng.integers(1, 8)
            ):
                mutated[place] = rng.integers(0, 256)
            path.write_bytes(
                bytes(mutated[: rng.integers(1, len(data) + 1)])
                if rng.random() < 0.3
                else bytes(mutated)
            )
            try:
                r = whole(path)
                assert len(r.c) == len(r.s) <= 20_000 and r.sample_rate_hz > 0
            except HrgError as error:
                assert "\n" not in str(error)


def test_mutated_files_never_give_anything_but_a_sentence(tmp_path):
    fuzz(tmp_path, 150, 0)


@pytest.mark.slow
def test_many_mutated_files(tmp_path):
    fuzz(tmp_path, 2500, 1)


def test_the_bell(tmp_path):
    folder = os.environ.get("HRG_MEASURED_DATA")
    if not folder:
        pytest.skip("HRG_MEASURED_DATA does not name the folder of measured data")
    r = whole(Path(folder) / "bell" / "perc_bell.flac")
    assert r.c.dtype == np.int16 and r.sample_rate_hz == 44_100 and len(r) == 296_317
    spectrum = np.abs(np.fft.rfft(np.asarray(r.c, float)))
    frequency = np.fft.rfftfreq(len(r), 1 / 44_100)
    near = (frequency > 3400) & (frequency < 3800)
    assert 3610 < frequency[near][spectrum[near].argmax()] < 3626
