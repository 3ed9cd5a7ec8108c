"""The lot page: self-contained, the worst gyros and why first, every gyro with cause and share,
limits in the distributions, hostile names harmless, the same bytes for the same rows; in a browser
it sorts and filters by mouse and keyboard."""

import re
from html.parser import HTMLParser

import lots_by_hand
import numpy as np
import pytest

from hrg_cli.lots.groups import Origin
from hrg_cli.lots.lot_diagnosis import diagnose_lot
from hrg_cli.lots.lot_report import MOST_TOLD, make_lot_report, read_measured
from hrg_cli.lots.lot_settings import LotSettings
from hrg_cli.lots.lot_table import judge_rows
from hrg_cli.reporting.figures.lot import plot_distribution, plot_pareto
from hrg_cli.reporting.lot_page import find_limits, list_parameters, make_lot_page, make_sentence
from hrg_cli.reporting.text import format_signed

HOSTILE = '../<script>alert("x")</script>\x1b[31m'
GYROS = 60
LIMITS = {
    "resonator": {
        "frequency_split_rad_s": {"maximum": "0.3 rad/s"},
        "frequency_hz": {"minimum": 3000.0},
    }
}
TABLE = "table.sortable"


def lot():
    """A lot whose station 2 has a gain mismatch of 2 σ a gyro, with a gyro of 190 °/h, one over its
    limit, one refused, one hostile name, one lost recording, and K of one 17 robust σ off."""
    rng = np.random.default_rng(5)
    special = {
        4: {"fault": ("nonlinear_damping", "0.21(1) 1/s", 0.97, 190.2)},
        5: {"fault": ("phase_mismatch", "2.1(1) mrad", 0.7, 12.0)},
        6: {"fault": ("phase_mismatch", "2.0(1) mrad", 0.7, 11.0)},
        7: {"moved": {"frequency_split_rad_s": 0.4}},
        9: {"status": "refused"},
        11: {"moved": {"scale_factor": 17e-4}},
    }
    gyros, origins = [], {}
    for k in range(GYROS):
        name = HOSTILE if k == 20 else f"SN-{k:03}"
        station = "12"[k % 2]
        own = {"gain_mismatch.gain": 2.0} if station == "2" else None
        gyros.append(lots_by_hand.gyro(rng, name, sizes=own, **special.get(k, {})))
        origins[name] = Origin({"station": station}, f"2026-{1 + k // 8:02d}-10")
    over = gyros[7]["results"]["identify"]["parameters"]["frequency_split_rad_s"]["value"]
    gyros[7]["checks"] = [
        {"name": "x", "passed": False, "sentence": f"the split is {over:.3g}, at most 0.3"}
    ]
    gyros[7]["answer"]["missed"] = ["frequency split Δf 160 mHz, limit ≤ 95.5 mHz"]
    recordings = [
        {"gyro_id": g["gyro_id"], "name": f"{k}.h5", "status": "valid"} for k, g in enumerate(gyros)
    ]
    lost = {
        "status": "failed",
        "unreadable": True,
        "error": "bad.h5: is truncated",
        "name": "bad.h5",
    }
    recordings.append({**lost, "gyro_id": "SN-013", "told_by": "by its file's name"})
    recordings.append({**lost, "gyro_id": "", "told_by": ""})
    settings = LotSettings(recordings=["x"], lot_id="L<7>", limits=LIMITS)
    rows = judge_rows(settings, recordings, gyros)
    whole = diagnose_lot(gyros, read_measured(rows, gyros), origins, settings.common_rate)
    for row in rows:
        origin = origins.get(row["gyro_id"], Origin({}))
        row |= {**origin.groups, "day": origin.day}
    return make_lot_report(settings, rows, recordings) | whole


@pytest.fixture(scope="module")
def report():
    return lot()


def drawn(report):
    pages = {
        row["gyro_id"]: f"folder of {k}/report.html"
        for k, row in enumerate(report["rows"])
        if row["gyro_id"]
    }
    return make_lot_page(report, pages, LIMITS)


@pytest.fixture(scope="module")
def page(report):
    return drawn(report)


class Tags(HTMLParser):
    """Tags that stay open, links, and everything that would load from elsewhere."""

    def __init__(self, text):
        super().__init__()
        self.open, self.links, self.loads, self.ids = [], [], [], []
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        given = dict(attributes)
        self.links += [given["href"]] if tag == "a" else []
        self.loads += [given[k] for k in ("src", "data", "poster", "action") if k in given] + (
            [tag] if tag in ("link", "iframe") else []
        )
        self.ids += [given["id"]] if "id" in given else []
        if tag not in ("meta", "link", "br", "input"):
            self.open.append(tag)

    def handle_startendtag(self, tag, attributes):
        self.ids += [dict(attributes)["id"]] if "id" in dict(attributes) else []

    def handle_endtag(self, tag):
        assert self.open.pop() == tag


def test_page_is_whole_and_loads_nothing(page):
    tags = Tags(page)
    assert tags.open == [] and tags.loads == [] and len(tags.ids) == len(set(tags.ids))
    assert (
        "default-src 'none'" in page
        and not re.search(r"url\((?!#)", page)
        and "@import" not in page
    )
    inner = {link[1:] for link in tags.links if link.startswith("#")}
    assert inner <= set(tags.ids)
    outer = [link for link in tags.links if not link.startswith("#")]
    assert len(set(outer)) == GYROS and all(
        link.startswith("./folder%20of%20") and link.endswith("/report.html") for link in outer
    )


def test_the_worst_are_told_first_with_the_reason(page, report):
    first = page[page.index('<ol class="worst">') : page.index("</ol>")]
    told = re.findall(r"<li>.*?</li>", first, re.S)
    assert len(told) == 3 and report["worst"] == ["SN-007", "SN-009", ""]
    assert "SN-007" in told[0] and "frequency split Δf 160 mHz, limit ≤ 95.5 mHz" in told[0]
    assert "SN-009" in told[1] and "identify is refused: too few runs" in told[1]
    by_rank = {row["rank"]: row for row in report["rows"]}
    assert by_rank[4]["gyro_id"] == "SN-004"
    assert by_rank[4]["reason"] == "nonlinear damping of 0.21(1) 1/s, 97 % of 190 °/h"
    assert [by_rank[k]["gyro_id"] for k in (5, 6, 7, 8)] == ["SN-005", "SN-006", "SN-013", "SN-011"]
    assert "scale factor K +1" in by_rank[8]["reason"]


def test_a_lost_recording_is_told_with_its_gyro(page, report):
    rows = {row["gyro_id"]: row for row in report["rows"]}
    assert not rows["SN-013"]["passed"] and rows["SN-013"]["why"] == "bad.h5: is truncated"
    assert "SN-013 <span" in page and "by its file&#39;s name" in page and "not known" in page
    assert report["status"] == "refused" and len(report["unreadable"]) == 2


def test_the_common_cause_is_the_second_half_of_the_sentence(page, report):
    (one,) = report["lot_causes"]
    assert one["sentence"].startswith("all gyros of station 2: gain mismatch")
    assert make_sentence(report).endswith(f"In common: {one['sentence']}.")
    assert 'id="common-1"' in page and "none of them show it alone" in page
    assert "is 2 % at most" in page or "is 2 % at most" in page.replace("\n", " ")


def test_hostile_names_are_text(page):
    assert (
        "<script>alert" not in page
        and "&lt;script&gt;alert" in page
        and "\x1b" not in page
        and "Lot L&lt;7&gt;" in page
    )


def test_every_distribution_has_its_limits(report):
    names = list_parameters(report["rows"])
    assert names[:2] == ["frequency_hz", "damping_rate_1_s"] and len(names) == 7
    plot = plot_distribution(
        report["rows"],
        "frequency_split_rad_s",
        find_limits("frequency_split_rad_s", LIMITS),
    )
    assert "Limit ≤ 95.493 mHz: 1 outside." in plot.words and "1 outlier: SN-007." in plot.words
    (axis,) = plot.figure.axes
    assert any("limit ≤ 95.493 mHz" in line.get_label() for line in axis.lines)
    assert any(
        abs(line.get_xdata()[0] - 95.493) < 1e-3 for line in axis.lines if len(line.get_xdata())
    )
    far = plot_distribution(report["rows"], "frequency_hz", find_limits("frequency_hz", LIMITS))
    assert "Limit ≥ 3000 Hz: none outside." in far.words
    assert far.figure.axes[0].get_xlim()[0] > 4900  # an arrow, so that the gyros stay apart
    assert "No limit is set." in plot_distribution(report["rows"], "scale_factor").words


def test_limits_are_found_by_the_columns_name():
    limits = {
        "calibration": {"drift_rms_rad_s.held_out": "5 deg/h", "scale_factor": {"minimum": 0.5}}
    }
    assert find_limits("drift_rms_rad_s_held_out", limits)[1] == pytest.approx(
        5 * np.pi / 180 / 3600
    )
    assert find_limits("calibrated_scale_factor", limits) == (0.5, None)
    assert find_limits("frequency_hz", limits) == (None, None)


def test_pareto_counts_gyros(report, page):
    assert plot_pareto([], 3) is None
    plot = plot_pareto([("phase mismatch", 2), ("nonlinear damping", 1)], 60)
    assert "phase mismatch is the most frequent, in 2 of 60 gyros" in plot.words
    assert "2 (67 % so far)" in page and 'data-filter="phase mismatch"' in page


def test_same_rows_same_bytes(page, report):
    assert drawn(report) == page


def test_a_recording_of_no_known_gyro_is_no_gyro(report, page):
    """60 gyros and a recording that nobody can attribute: of 60, not of 61."""
    told = make_sentence(report)
    assert f" of {GYROS} gyros did not pass; 1 recording is of no known gyro" in told
    assert (
        f"{report['passed']} of {GYROS} gyros passed" in page
        and f"of {GYROS + 1} gyros" not in page
    )
    assert all(f"of {GYROS + 1} gyros" not in reason for reason in report["status_reasons"])
    assert report["gyros"] == GYROS and "" in {row["gyro_id"] for row in report["rows"]}


@pytest.mark.parametrize("faulty", [1, 2])
def test_one_gyro_has_and_two_have(faulty):
    """One "have a fault", and one in doubt had one."""
    sound = {
        "passed": True,
        "rank": 1,
        "outliers": "",
        "runs_undiagnosed": 0,
        "status": "valid",
        "health": "sound",
    }
    rows = [sound | {"gyro_id": f"G{k}", "cause": "", "runs_failed": 0} for k in range(3)]
    for row in rows[:faulty]:
        row["health"] = "in doubt"
    told = make_lot_report(LotSettings(recordings=["x"]), rows, [])
    said = "has a fault or is in doubt" if faulty == 1 else "have a fault or are in doubt"
    names = ", ".join(f"G{k}" for k in range(faulty))
    assert told["status_reasons"] == [f"{faulty} of 3 gyros {said}: {names}"]
    assert f"; {faulty} {said}." in make_sentence(told)


def test_no_gyro_is_missed_in_words():
    """More gyros than have a sentence, and a recording of none of them: the rest is counted without
    it."""
    rows = [
        {
            "gyro_id": f"G{k}",
            "passed": False,
            "why": "x",
            "reason": "x",
            "rank": k,
            "outliers": "",
            "runs_undiagnosed": 0,
            "status": "failed",
        }
        for k in range(MOST_TOLD + 5)
    ]
    stray = rows[0] | {"gyro_id": "", "rank": len(rows)}
    told = make_lot_report(LotSettings(recordings=["x"]), [*rows, stray], [])
    assert told["status_reasons"][-1].startswith("5 more gyros did not pass")
    assert told["gyros"] == len(rows)


def test_lots_without_results_have_a_page(report):
    empty = {**report, "rows": [], "gyros": 0, "passed": 0, "outliers": [], "lot_causes": []}
    assert "No gyro has a parameter." in make_lot_page({**empty, "populations": {}}, {})
    assert make_sentence({**empty, "lot_tests": None}).startswith("No gyro is known")
    few = {**report, "rows": [r for r in report["rows"] if not r["gyro_id"]], "lot_causes": []}
    Tags(make_lot_page(few, {}))


def test_a_page_of_many_gyros_takes_time_in_proportion():
    """Drawing is by figure, not by gyro: four times the rows cost less than four times as long."""
    import time

    def taken(copies):
        report = lot()
        rows = [
            dict(row, gyro_id=f"{row['gyro_id']}{k}")
            for k in range(copies)
            for row in report["rows"]
        ]
        started = time.process_time()
        make_lot_page({**report, "rows": rows}, {})
        return time.process_time() - started

    taken(1)
    assert taken(8) < 8 * taken(2)


@pytest.fixture(scope="module")
def window(page, tmp_path_factory):
    import browser

    if browser.programs() is None:
        pytest.skip("chromium and chromium-driver are not installed")
    folder = tmp_path_factory.mktemp("lot")
    (folder / "lot.html").write_text(page, encoding="utf-8")
    with browser.session(folder / "profile") as opened:
        opened.size(1280, 900)
        opened.scheme("light")
        opened.open((folder / "lot.html").as_uri())
        yield opened


FIRST = f"return [...document.querySelectorAll('{TABLE}')[%d].tBodies[0].rows].filter(r => !r.hidden).map(r => r.cells[0].textContent)"
HEAD = f"[...document.querySelectorAll('{TABLE}')[%d].tHead.rows[0].cells].find(c => c.textContent.startsWith('%s'))"


@pytest.mark.browser
@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("width", [375, 768, 1280])
def test_page_fits_every_screen(window, scheme, width):
    window.size(width, 900)
    window.scheme(scheme)
    shown = window.run(
        "return [...document.querySelectorAll('figure svg')].map(s =>"
        " s.getBoundingClientRect().height)"
    )
    assert len(shown) == 9 and min(shown) > 100
    assert window.run("return document.documentElement.scrollWidth <= innerWidth + 1")
    answer = window.run("return document.querySelector('.worst li').getBoundingClientRect().bottom")
    assert answer < 900, "the worst gyro is on the first screen"
    assert window.picture()[:4] == b"\x89PNG"
    window.scheme("light")
    window.size(1280, 900)


@pytest.mark.browser
def test_the_table_sorts_by_mouse_and_keyboard(window):
    assert window.run(FIRST % 0)[0] == "SN-007"
    window.run(f"{HEAD % (0, 'gyro')}.querySelector('button').click()")
    names = window.run(FIRST % 0)
    assert [name for name in names if name.startswith("SN")][:3] == ["SN-000", "SN-001", "SN-002"]
    window.run(f"{HEAD % (1, 'scale factor')}.querySelector('button').focus()")
    window.keys("\ue007")
    assert (
        window.run(f"return {HEAD % (1, 'scale factor')}.getAttribute('aria-sort')") == "ascending"
    )
    window.keys(" ")
    assert (
        window.run(f"return {HEAD % (1, 'scale factor')}.getAttribute('aria-sort')") == "descending"
    )
    assert window.run(FIRST % 1)[0] == "SN-011"  # the largest K, and what has none comes last
    assert window.run(FIRST % 1)[-1] == "a recording"
    window.run(f"{HEAD % (0, 'place')}.querySelector('button').click()")


@pytest.mark.browser
def test_the_table_filters_by_keyboard(window):
    window.run("document.getElementById('filter').focus()")
    window.keys(*"phase mis")
    assert window.run(FIRST % 0) == window.run(FIRST % 1) == ["SN-005", "SN-006"]
    shown = "return document.getElementById('shown').textContent"
    assert window.run(shown) == f"2 of {GYROS} gyros are shown."
    window.run("document.querySelector('#controls button').click()")
    window.run("return new Promise(done => setTimeout(done, 50))")
    assert len(window.run(FIRST % 0)) == GYROS + 1
    assert window.run(shown) == f"All {GYROS} gyros and 1 recording of no known gyro are shown.", (
        "a recording of nobody's is no gyro"
    )
    window.run("document.querySelector('[data-filter=\"nonlinear damping\"]').focus()")
    window.keys("\ue007")
    assert window.run(FIRST % 0) == ["SN-004"]
    assert window.run("return document.activeElement.id") == "filter"
    window.run("document.querySelector('#controls button').click()")
    window.run(
        "const s = document.getElementById('show'); s.value = 'outlier';"
        " s.dispatchEvent(new Event('change'));"
    )
    window.run("return new Promise(done => setTimeout(done, 50))")
    window.run(
        "const s = document.getElementById('show'); s.value = 'outlier';"
        " s.dispatchEvent(new Event('change'));"
    )
    assert set(window.run(FIRST % 0)) == {"SN-007", "SN-011"}
    window.run("document.querySelector('#controls button').click()")


@pytest.mark.browser
def test_nothing_is_loaded_and_nothing_said(window):
    assert [entry for entry in window.log() if "favicon" not in entry["message"]] == []
    assert window.run("return performance.getEntriesByType('resource').length") == 0
    stuck = window.run(
        """return [...document.querySelectorAll('*')].filter(e => e.scrollWidth > e.clientWidth + 1
        && ['auto', 'scroll'].includes(getComputedStyle(e).overflowX) && e.tabIndex < 0).map(e => e.outerHTML.slice(0, 80))"""
    )
    assert stuck == []


@pytest.mark.browser
def test_labels_of_a_figure_do_not_overlap(window):
    overlaps = window.run("""
        const found = [];
        for (const figure of document.querySelectorAll('figure')) {
          const texts = [...figure.querySelectorAll('svg text')].map(t => [t.textContent, t.getBoundingClientRect()])
            .filter(([, b]) => b.width);
          texts.forEach(([a, p], i) => texts.slice(i + 1).forEach(([b, q]) => {
            const x = Math.min(p.right, q.right) - Math.max(p.left, q.left), y = Math.min(p.bottom, q.bottom) - Math.max(p.top, q.top);
            const turned = p.height > 1.6 * q.height || q.height > 1.6 * p.height;
            if (!turned && x > 2 && y > 4) found.push(figure.id + ': ' + a + ' / ' + b);
          }));
        }
        return found;""")
    assert overlaps == []


def test_a_distance_is_said_alike_in_the_reason_and_on_its_badge_without_an_exponent():
    assert [format_signed(z) for z in (1439.7, -17.23, 0.52, 0.0)] == [
        "+1440",
        "−17.2",
        "+0.52",
        "0",
    ]
