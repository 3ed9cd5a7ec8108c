"""The lot page: self-contained, every gyro, failures and outliers said, hostile names harmless, the
same bytes for the same rows."""

import re
import sys
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

from hrg_cli.lots.lot_settings import LotSettings
from hrg_cli.lots.lot_table import judged_rows
from hrg_cli.reporting.lot_page import distribution, lot_page, parameters

HOSTILE = '../<script>alert("x")</script>\x1b[31m'
GYROS = 24


def gyro(name, split, std=0.002, status="valid"):
    parameters = {
        "frequency_hz": {"value": 5000.0 + split, "std": 1e-4, "units": "Hz"},
        "frequency_split_rad_s": {"value": split, "std": std, "units": "rad s-1"},
        "stiffness_axis_rad": {"value": split % 1.5, "std": 0.01, "units": "rad"},
    }
    json = {
        "parameters": parameters,
        "chi2_per_dof": 1.0,
        "status": status,
        "status_reasons": ["too few runs"],
    }
    return {
        "gyro_id": name,
        "status": status,
        "results": {"identify": json},
        "checks": [],
        "error": "",
    }


@pytest.fixture(scope="module")
def report():
    """A lot of gyros whose split is normal about 0.3 ± 0.01, but for one; one refused, one hostile
    name, one damaged recording."""
    splits = 0.3 + 0.01 * np.random.default_rng(5).standard_normal(GYROS)
    splits[7] = 0.5
    gyros = [
        gyro(f"SN-{k:03}", float(x), status="refused" if k == 3 else "valid")
        for k, x in enumerate(splits)
    ]
    gyros.append(gyro(HOSTILE, 0.301))
    damaged = {"gyro_id": "", "name": "bad.h5", "status": "failed", "error": "bad.h5: is truncated"}
    rows = judged_rows(LotSettings(recordings=["x"]), [damaged], gyros)
    return {
        "kind": "lot",
        "status": "suspect",
        "lot_id": "L<7>",
        "gyros": len(rows),
        "passed": sum(r["passed"] for r in rows),
        "recordings": 1,
        "recordings_failed": 1,
        "outliers": [r["gyro_id"] for r in rows if r["outliers"]],
        "rows": rows,
    }


@pytest.fixture(scope="module")
def page(report):
    return lot_page(
        report,
        {
            row["gyro_id"]: f"folder of {k}"
            for k, row in enumerate(report["rows"])
            if row["gyro_id"]
        },
    )


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
        if tag not in ("meta", "link", "br"):
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
    assert len(outer) == GYROS + 1 and all(
        link.startswith("./folder%20of%20") and link.endswith("/") for link in outer
    )


def test_every_gyro_is_told_with_its_faults(page, report):
    for row in report["rows"]:
        assert not re.fullmatch(r"SN-\d+", row["gyro_id"]) or f">{row['gyro_id']}</a>" in page
    assert "SN-003</strong>: identify is refused: too few runs" in page
    assert "a recording</strong>: bad.h5" in page and "is truncated" in page
    assert (
        report["outliers"] == ["SN-007"]
        and "<strong>SN-007</strong>: frequency_split_rad_s = 0.5" in page
    )
    assert page.count('<td><span class="badge refused">not passed</span></td>') == 2


def test_hostile_names_are_text(page):
    assert (
        "<script>alert" not in page
        and "&lt;script&gt;alert" in page
        and "\x1b" not in page
        and "Lot L&lt;7&gt;" in page
    )


def test_distribution_says_the_lot(report):
    assert parameters(report["rows"]) == [
        "frequency_hz",
        "frequency_split_rad_s",
        "stiffness_axis_rad",
    ]
    plot = distribution(report["rows"], "frequency_split_rad_s")
    assert (
        f"{GYROS + 1} gyros from" in plot.words
        and "to 0.5 rad/s," in plot.words
        and "1 outlier: SN-007." in plot.words
    )
    (axis,) = plot.figure.axes
    assert any(text.get_text() == "SN-007" for text in axis.texts) and axis.get_xlim()[1] > 0.5


def test_same_rows_same_bytes(page, report):
    again = lot_page(
        report,
        {
            row["gyro_id"]: f"folder of {k}"
            for k, row in enumerate(report["rows"])
            if row["gyro_id"]
        },
    )
    assert again == page


def test_lots_without_results_have_a_page(report):
    empty = {**report, "rows": [], "gyros": 0, "passed": 0, "outliers": []}
    assert "No gyro has a parameter." in lot_page(empty, {})
    Tags(lot_page({**report, "rows": [r for r in report["rows"] if not r["gyro_id"]]}, {}))


@pytest.mark.browser
def test_page_in_a_browser(page, tmp_path):
    """No console message, every figure drawn, in both modes and on a narrow screen."""
    sys.path.insert(0, str(Path(__file__).parent))
    import browser

    if browser.programs() is None:
        pytest.skip("chromium and chromium-driver are not installed")
    path = tmp_path / "lot.html"
    path.write_text(page, encoding="utf-8")
    with browser.session(tmp_path / "profile") as window:
        for scheme, width in (("light", 1200), ("dark", 400)):
            window.size(width, 900)
            window.scheme(scheme)
            window.open(path.as_uri())
            shown = window.run(
                "return [...document.querySelectorAll('figure svg')].map(s =>"
                " s.getBoundingClientRect().height)"
            )
            assert len(shown) == 3 and min(shown) > 100
            assert window.run("return document.documentElement.scrollWidth <= innerWidth + 1")
            assert window.picture()[:4] == b"\x89PNG"
        assert [entry for entry in window.log() if "favicon" not in entry["message"]] == []
