"""The report page: what it says, that it loads nothing and trusts nothing, and that the same files
give the same bytes."""

from __future__ import annotations

import html.parser
import re

import numpy as np
import pytest
import records_by_hand as by_hand

from hrg_cli import store
from hrg_cli.errors import HrgError
from hrg_cli.records import Provenance
from hrg_cli.reporting import page, page_figures
from hrg_cli.reporting.page_content import list_steps, translate_parameter
from hrg_cli.reporting.surface import gather_surface_data
from hrg_cli.units import DEGREE_PER_HOUR


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    return by_hand.write_all(tmp_path_factory.mktemp("files"))


@pytest.fixture(scope="module")
def whole(files):
    return page.build_report(files, truth=True)


class Elements(html.parser.HTMLParser):
    """Tags with attributes, checked to close in order."""

    EMPTY = ("meta", "link", "br", "img", "hr", "input")

    def __init__(self, text: str) -> None:
        super().__init__()
        self.found: list[tuple[str, dict[str, str | None]]] = []
        self.open: list[str] = []
        self.feed(text)
        assert self.open == []

    def handle_starttag(self, tag, attrs):
        self.found.append((tag, dict(attrs)))
        if tag not in self.EMPTY:
            self.open.append(tag)

    def handle_startendtag(self, tag, attrs):
        self.found.append((tag, dict(attrs)))

    def handle_endtag(self, tag):
        assert self.open and self.open[-1] == tag, (tag, self.open[-3:])
        self.open.pop()

    def all(self, tag):
        return [attrs for name, attrs in self.found if name == tag]


def test_page_holds_every_kind_and_loads_nothing(whole, files):
    elements = Elements(whole)
    ids = [a["id"] for _, a in elements.found if a.get("id")]
    assert len(ids) == len(set(ids))
    for kind in by_hand.RECORDS:
        assert kind in ids
    assert len(elements.all("svg")) == len(elements.all("figure")) >= 20
    addresses = [
        a.get(key)
        for _, a in elements.found
        for key in ("src", "href", "xlink:href", "action")
        if a.get(key)
    ]
    assert all(a.startswith(("#", "data:image/png;base64,")) for a in addresses)
    assert "@import" not in whole and not re.search(r"url\((?!#)", whole)
    for path in files:
        assert store.compute_sha256(path) in whole


def test_figures_say_their_numbers_in_words(whole):
    elements = Elements(whole)
    named = {a["id"] for a in elements.all("figcaption")}
    assert all(a["role"] == "img" and a["aria-labelledby"] in named for a in elements.all("svg"))
    for words in (
        "strongest line is at 431.0",
        "pickoff nonlinearity at 48.2 σ",
        "scale factor K with damping split ν·δμ −0.72",
        "drift left, °/h rms: nothing 6.1",
        "Allan deviation",
    ):
        assert words in whole


def test_page_follows_both_modes(whole):
    assert "prefers-color-scheme: dark" in whole
    figures = re.findall(r"<svg.*?</svg>", whole, flags=re.S)
    assert all("var(--ink)" in figure and "#1a2028" not in figure for figure in figures)


def test_same_files_same_bytes(files):
    some = [files[2], files[4]]
    assert page.build_report(some, full=True) == page.build_report(some, full=True)


def test_truth_is_read_only_when_asked(files, whole):
    hidden = page.build_report(files[:1], full=True)
    assert "Truth of the simulation" in whole and "Truth of the simulation" not in hidden
    assert "frequency_hz = 431.0" in whole and "frequency_hz = 431.0" not in hidden


def test_page_stays_small(files, whole, monkeypatch):
    assert len(whole.encode()) < 3_000_000
    monkeypatch.setattr(page_figures, "PAGE_BYTES", 60_000)
    small = page.build_report(files[2:4], full=True)
    assert len(small.encode()) < 60_000 + 60_000 and "to keep the page small" in small


def test_hostile_text_stays_text(tmp_path):
    attack = (
        "</title><script>alert(1)</script><img src=x onerror=alert(1)> \x00\x1b[31m \u202e"
        " $\\frac{1}{0}$ {{ 7*7 }}"
    )
    path = tmp_path / "wave.h5"
    record = by_hand.wave(run=attack).replace(
        gyro_id=attack.replace("\x00", ""),
        units="<b>V</b> & $x^",
        status="suspect",
        status_reasons=(attack,),
        provenance=Provenance(
            (attack.replace("\x00", ""),),
            attack.replace("\x00", ""),
            (),
            "now",
            attack.replace("\x00", ""),
        ),
    )
    store.write(path, record.replace(run_id=attack.replace("\x00", "")))
    text = page.build_report([path], full=True)
    elements = Elements(text)
    assert len(elements.all("script")) == 1 and not elements.all("img") and not elements.all("b")
    assert "\x1b" not in text and "\x00" not in text and "\u202e" not in text
    assert "{{ 7*7 }}" in text


def test_hostile_results_stay_text(tmp_path):
    attack = "<script>alert(1)</script> $\\bad{"
    resonator = by_hand.resonator()
    diagnosis = by_hand.diagnosis()
    store.write(
        tmp_path / "a.h5",
        resonator.replace(
            name=np.array([attack + str(i) for i in range(7)], object),
            run=np.array([attack] * 3, object),
        ),
    )
    report = diagnosis.report.replace(
        "pickoff_nonlinearity", "<script>alert(1)</script> $"
    ).replace("two amplitudes", "<img src=x>")
    store.write(
        tmp_path / "b.h5", diagnosis.replace(report=report, series='["<script>x</script>", "$_{"]')
    )
    elements = Elements(page.build_report([tmp_path / "a.h5", tmp_path / "b.h5"], full=True))
    assert len(elements.all("script")) == 1 and not elements.all("img")


@pytest.mark.parametrize(
    "report",
    [
        "{}",
        '{"effects": [], "gain": {"before": null}, "tested": [1], "remainder": "x"}',
        '{"effects": [{"name": "x", "z": null}]}',
    ],
)
def test_any_diagnosis_json_gives_a_page(tmp_path, report):
    store.write(tmp_path / "d.h5", by_hand.diagnosis().replace(report=report, series="[]"))
    assert "Diagnosis" in page.build_report([tmp_path / "d.h5"], full=True)


@pytest.mark.parametrize(
    "details",
    [
        "{}",
        (
            '{"ladder": [1, {"stage": null}], "drift_rms_rad_s": 3, "scale_factor_rms_ppm":'
            ' {"before": "x"}}'
        ),
        '{"a": {"b": {"c": [1, 2]}}, "n": 1e400}',
    ],
)
def test_any_details_json_gives_a_page(tmp_path, details):
    store.write(tmp_path / "c.h5", by_hand.calibration().replace(details=details))
    store.write(tmp_path / "r.h5", by_hand.resonator().replace(details=details))
    assert "Calibration" in page.build_report([tmp_path / "c.h5", tmp_path / "r.h5"], full=True)


def test_short_flagged_and_empty_series(tmp_path):
    wave = by_hand.wave()
    for name, record in {
        "one": wave.rows(0, 1),
        "none": wave.rows(0, 0),
        "bad": wave.replace(
            flags=np.full(len(wave), 4, "u1"), wave_angle_rad=np.full(len(wave), np.nan)
        ),
        "still": wave.replace(
            wave_angle_rad=np.zeros(len(wave)),
            main_amplitude=np.ones(len(wave)),
            quadrature_amplitude=np.zeros(len(wave)),
            temperature_degc=None,
            rate_rad_s=None,
        ),
        "periods": by_hand.periods().rows(0, 2),
        "compensated": by_hand.compensated().rows(0, 3),
        "node": by_hand.calibration(1),
    }.items():
        store.write(tmp_path / f"{name}.h5", record)
        assert name in page.build_report([tmp_path / f"{name}.h5"], full=True)


@pytest.mark.parametrize(
    "change",
    [
        {"c": np.zeros(40000), "s": np.zeros(40000)},
        {"c": np.full(40000, np.nan), "s": np.full(40000, np.nan)},
        {"c": np.arange(10.0), "s": np.arange(10.0)},
        {"sample_rate_hz": None, "time_s": np.cumsum(1 + 0.3 * np.sin(np.arange(40000.0))) / 5000},
        {"readout": "carrier", "carrier_hz": 1200.0},
        {"mode_number": 1},
        {"auxiliary_time_s": None, "temperature_degc": None, "rate_rad_s": None},
    ],
    ids=["zeros", "nan", "short", "uneven", "carrier", "pendulum", "no-log"],
)
def test_any_recording_gives_a_page(tmp_path, change):
    store.write(tmp_path / "r.h5", by_hand.recording().replace(**change))
    assert "Recording" in page.build_report([tmp_path / "r.h5"], full=True)


def test_of_many_files_the_first_are_drawn(tmp_path, monkeypatch):
    monkeypatch.setattr(page_figures, "DRAWN_OF_A_KIND", 1)
    paths = [tmp_path / f"wave-{k:02}.h5" for k in range(12)]
    for k, path in enumerate(paths):
        store.write(path, by_hand.wave(run=f"run-{k}", count=40))
    text = page.build_report(paths, full=True)
    assert all(path.name in text for path in paths) and text.count("many files of this kind") == 11


def test_long_recording_is_read_in_looks(tmp_path, monkeypatch):
    store.write(tmp_path / "r.h5", by_hand.recording(seconds=120.0, truth=False))
    read = []
    original = by_hand.Recording.physical
    monkeypatch.setattr(
        by_hand.Recording,
        "physical",
        lambda self, start=0, stop=None: read.append(stop - start) or original(self, start, stop),
    )
    page.build_report([tmp_path / "r.h5"], full=True)
    assert max(read) <= 1 << 13 and sum(read) < 0.7 * 120 * by_hand.RATE_HZ


def test_png_figures(files, tmp_path):
    written = page.write_figures(files[3:5], tmp_path / "figures")
    assert len(written) == len(set(written)) >= 5
    assert all(
        p.read_bytes()[:8] == b"\x89PNG\r\n\x1a\n" and p.parent == tmp_path / "figures"
        for p in written
    )


def test_a_picture_that_is_there_is_replaced_only_when_asked(files, tmp_path):
    """The last of the figures is somebody's: none is written beside it."""
    others = page.write_figures(files[3:5], tmp_path)
    somebodys = others.pop()
    somebodys.write_text("somebody's")
    for path in others:
        path.unlink()
    with pytest.raises(HrgError, match="exists already; give --force"):
        page.write_figures(files[3:5], tmp_path)
    assert list(tmp_path.iterdir()) == [somebodys] and somebodys.read_text() == "somebody's"
    assert somebodys in page.write_figures(files[3:5], tmp_path, force=True)
    assert somebodys.read_bytes()[:4] == b"\x89PNG"


def test_the_answer_comes_first(files):
    """Sentence, the two words, one figure, causes, parameters and methods before anything else;
    figures of files only when asked."""
    text = page.build_report(files)
    order = [
        text.index(mark)
        for mark in (
            'class="sentence"',
            "gyro: fault found",
            "<svg",
            "<h3>Causes</h3>",
            "<h3>Parameters",
            "<h3>Methods",
            'class="behind"',
        )
    ]
    assert (
        order == sorted(order)
        and text.count("<svg") == 2
        and len(text) < len(page.build_report(files, full=True)) / 3
    )
    assert (
        text.count("pickoff nonlinearity") >= 2 and "False" not in text and "0.00e+00" not in text
    )


def test_errors_are_sentences(tmp_path, files):
    (tmp_path / "text.h5").write_text("no")
    for paths, word in (
        ([], "no file"),
        ([tmp_path / "none.h5"], "no such file"),
        ([files[0], tmp_path / "text.h5"], "not an HDF5 file"),
    ):
        with pytest.raises(HrgError, match=word):
            page.build_report(paths, full=True)


def test_steps_from_files_and_history():
    found = {
        s.name: s.state
        for s in list_steps(
            [("wave", "valid"), ("wave", "suspect"), ("resonator", "refused")],
            ["2026-01-01T00:00:00Z hrg 0.1.0 hrg demodulate a.h5 -o b.h5"],
        )
    }
    assert found == {
        "record, import or simulate": "skipped",
        "demodulate": "run",
        "estimate": "suspect",
        "identify": "failed",
        "calibrate": "skipped",
        "diagnose": "skipped",
        "compensate": "skipped",
    }


def test_parameters_for_people():
    assert translate_parameter("damping_rate_1_s", 1.57e-3, 1e-6, 5000.0).startswith("τ = 636.9")
    assert translate_parameter("damping_rate_1_s", 1.57e-3, 1e-6, 5000.0).endswith("Q = 1.001×10⁷")
    assert (
        translate_parameter("frequency_split_rad_s", 3.14159265e-3, 3.14e-5, None)
        == "Δf = 1 ± 0.01 mHz"
    )
    assert translate_parameter("damping_split_1_s", np.pi / 180 / 3600, 0.0, None).startswith(
        "1 ± 0 °/h"
    )


def test_a_changed_source_is_named(tmp_path, files):
    changed = tmp_path / "recording.h5"
    store.write(changed, by_hand.recording(seconds=1.0))
    text = page.build_report([changed, files[1]], full=True)
    assert "a file of this name on this page has other content" in text


def test_the_same_source_is_named(whole):
    assert "is recording.h5 on this page" in whole


def test_the_surface_holds_the_tables_of_the_calibration(files):
    record = by_hand.calibration()
    data = gather_surface_data(record)
    drift, scale = data["quantities"]
    rows, columns = len(data["node"]), len(data["angle"])
    assert (rows, columns) == np.shape(drift["values"]) == np.shape(scale["values"])
    at = np.argmin(abs(np.degrees(record.wave_angle_rad) - data["angle"][20]))
    assert drift["values"][3][20] == pytest.approx(
        record.drift_rad_s[3, at] / DEGREE_PER_HOUR, rel=1e-5
    )
    assert gather_surface_data(by_hand.calibration(nodes=1)) is None  # a line is no surface
