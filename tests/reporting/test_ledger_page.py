"""The ledger's pages: self-contained, a chart for every figure with what is out of control and the
limits in it, hostile names harmless, the same bytes for the same ledger; in a browser they fit,
sort and filter."""

import re
from html.parser import HTMLParser

import browser
import numpy as np
import pytest
from production import entry, production

from hrg_cli.ledger import database
from hrg_cli.ledger.entry import Figure
from hrg_cli.ledger.history import tell_history
from hrg_cli.ledger.overview import make_overview
from hrg_cli.reporting.figures.drawing import write_svg
from hrg_cli.reporting.figures.ledger import draw_capability
from hrg_cli.reporting.ledger_page import MOST, make_history_page, make_overview_page

SPLIT = "frequency_split_rad_s"
LIMITS = {"resonator": {SPLIT: {"minimum": 0.085, "maximum": 0.11}}}
HOSTILE = '<script>alert("x")</script>\x1b[31m'
OUTLIER = 0.16


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Sixty gyros and a golden unit whose station 2 drifts; one gyro far off, with a hostile
    name."""
    rows = production(tmp_path_factory.mktemp("ledger") / "l.sqlite", gyros=60)
    return [*rows, entry(HOSTILE, 70.0, OUTLIER)]


@pytest.fixture(scope="module")
def pages(made):
    """The page of all gyros, and that of the golden unit."""
    whole = make_overview(made, limits=LIMITS, golden="G-000")
    one = tell_history(made, "G-000", limits=LIMITS)
    return make_overview_page(whole, "refused"), make_history_page(one, "valid")


class Tags(HTMLParser):
    """Tags that stay open, ids, and everything that would load from elsewhere."""

    def __init__(self, text):
        super().__init__()
        self.open, self.loads, self.ids, self.inner = [], [], [], set()
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        given = dict(attributes)
        self.loads += [given[k] for k in ("src", "data", "poster", "action") if k in given]
        self.loads += [tag] if tag in ("link", "iframe") else []
        self.ids += [given["id"]] if "id" in given else []
        self.inner |= {given["href"][1:]} if tag == "a" else set()
        if tag not in ("meta", "link", "br", "input"):
            self.open.append(tag)

    def handle_startendtag(self, tag, attributes):
        self.ids += [dict(attributes)["id"]] if "id" in dict(attributes) else []

    def handle_endtag(self, tag):
        assert self.open.pop() == tag


def test_pages_are_whole_and_load_nothing(pages):
    for page in pages:
        tags = Tags(page)
        assert tags.open == [] and tags.loads == [] and len(tags.ids) == len(set(tags.ids))
        assert tags.inner <= set(tags.ids)
        assert "default-src 'none'" in page and "@import" not in page
        assert not re.search(r"url\((?!#)", page)


def test_the_answer_says_what_is_missed_and_who_moved_most(pages):
    whole, one = (re.search(r'class="sentence">([^<]*)', page)[1] for page in pages)
    assert whole.startswith("1 limit is missed; ") and "most moved G-000" in whole
    assert "No limit is missed; 1 in doubt; frequency split Δf moved most" in one
    assert "is 50.930(32) mHz, the limit is" in pages[0]


def test_every_figure_has_its_chart_and_those_out_of_control_come_first(pages):
    whole, one = pages
    drawn = re.findall(r'<figure id="(?!capability)([^"]*)"', whole)
    assert drawn == ["figure-0", "golden-1", "golden-0"], "station 1 alone is in control"
    assert re.findall(r'<figure id="([^"]*)"', one) == ["figure-0"]
    words = whole[whole.index('id="figure-0-title"') :]
    assert "61 gyros, one value each" in words, "without the golden unit"
    assert "1 beyond 3 σ (&lt;script&gt;" in words
    assert "mean ± 3 σ between neighbours" in whole and "limit ≤ 35.0141 mHz" in whole


def test_hostile_names_are_text(pages):
    assert "<script>alert" not in pages[0] and "\x1b" not in pages[0]
    assert "&lt;script&gt;alert" in pages[0]


def test_the_same_ledger_gives_the_same_bytes(made, pages):
    again = make_history_page(tell_history(made, "G-000", limits=LIMITS), "valid")
    assert again == pages[1]


@pytest.mark.parametrize("count", [1, 2, 7, 8, 300])
@pytest.mark.parametrize("std", [None, 1e-4])
def test_charts_of_any_length(count, std):
    """One measurement, too few for control limits, too many for bars; with and without σ."""
    rng = np.random.default_rng(count)
    rows = [entry("SN-1", d, 0.1 + 1e-4 * rng.standard_normal(), std) for d in range(count)]
    page = make_history_page(tell_history(rows, "SN-1", names=[SPLIT]), "valid")
    assert ("No control limits" in page) == (1 < count < 8)
    assert ("a chart begins with the second" in page) == (count == 1)
    assert ("change, σ of both" in page) == (count > 1 and std is not None)
    gyros = [entry(f"SN-{k}", k, 0.1 + 1e-4 * rng.standard_normal(), std) for k in range(count)]
    page = make_overview_page(make_overview(gyros, names=[SPLIT]), "valid")
    assert ("moving range, " in page) == (count > 1) and f"{count} gyro" in page


def test_equal_values_have_no_control_limits():
    rows = [entry("SN-1", d, 0.1) for d in range(9)]
    page = make_history_page(tell_history(rows, "SN-1"), "valid")
    assert "neighbours do not differ" in page


def test_an_empty_ledger_is_a_page():
    assert "No figure was measured" in make_overview_page(make_overview([]), "valid")


def test_the_capability_is_drawn_where_the_table_has_it(made):
    told = make_overview(made, limits=LIMITS)
    plot = draw_capability(told.figures, ["split"])
    (line,) = plot.figure.axes[0].lines[:1]
    assert line.get_xdata()[0] == pytest.approx(told.figures[0].capability.cpk)
    assert "split" in write_svg(plot, plot.key)
    assert draw_capability(make_overview(made).figures, ["split"]) is None


def test_more_figures_than_a_page_holds_are_asked_for_by_name():
    names = [f"drift_{n}_rad_s" for n in range(MOST + 3)]
    figures = {name: Figure(0.1, 1e-4, "rad s-1") for name in names}
    rows = [entry("SN-1", k, 0.1, figures=figures) for k in range(2)]
    page = make_history_page(tell_history(rows, "SN-1"), "valid")
    assert page.count("<figure ") == MOST and "3 more by" in page


def test_the_command_writes_pages(hrg, tmp_path):
    ledger = tmp_path / "l.sqlite"
    database.add_entries(ledger, [entry("SN-1", float(d), 0.1 + 1e-4 * (d % 3)) for d in range(9)])
    for words in (("show",), ("history", "SN-1")):
        page = tmp_path / f"{words[0]}.html"
        asked = ("ledger", *words, "--ledger", ledger, "-o", page)
        told = hrg(*asked, "--json")
        assert told.status == 0 and told.json["output"] == str(page)
        assert page.read_text(encoding="utf-8").startswith("<!DOCTYPE html>")
        again = hrg(*asked)
        assert again.status == 1 and page.name in again.err and "--force" in again.err
        assert hrg(*asked, "--force", "-q").status == 0


needs_browser = pytest.mark.skipif(
    browser.programs() is None, reason="chromium and chromium-driver are not installed"
)
NAMES = """return [...document.querySelector('table.sortable').tBodies[0].rows].filter(r => !r.hidden)
    .map(r => r.cells[0].textContent)"""
OVERLAPS = """
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
    return found;"""
STUCK = """return [...document.querySelectorAll('*')].filter(e => e.scrollWidth > e.clientWidth + 1
    && ['auto', 'scroll'].includes(getComputedStyle(e).overflowX) && e.tabIndex < 0).map(e => e.outerHTML.slice(0, 80))"""


@pytest.fixture(scope="module")
def window(tmp_path_factory, pages):
    folder = tmp_path_factory.mktemp("pages")
    for name, page in zip(("show", "history"), pages, strict=True):
        (folder / f"{name}.html").write_text(page, encoding="utf-8")
    with browser.session(folder / "profile") as opened:
        opened.folder = folder
        yield opened


@pytest.mark.browser
@needs_browser
@pytest.mark.parametrize("name", ["show", "history"])
@pytest.mark.parametrize("width", [375, 768, 1280])
def test_pages_fit_every_screen(window, name, width):
    window.size(width, 900)
    window.open((window.folder / f"{name}.html").as_uri())
    for scheme in ("light", "dark"):
        window.scheme(scheme)
        assert window.run("return document.documentElement.scrollWidth <= innerWidth + 1")
        assert window.run(OVERLAPS) == [] and window.run(STUCK) == []
        assert window.picture()[:4] == b"\x89PNG"
    assert window.log() == []
    assert window.run("return performance.getEntriesByType('resource').length") == 0


@pytest.mark.browser
@needs_browser
def test_the_table_sorts_and_filters_by_keyboard(window):
    window.size(1280, 900)
    window.open((window.folder / "show.html").as_uri())
    assert window.run(NAMES)[0].startswith("<script>"), "misses its limit"
    head = "[...document.querySelectorAll('th')].find(c => c.textContent.startsWith('%s'))"
    window.run(f"{head % 'moved most'}.querySelector('button').focus()")
    window.keys("\ue007")
    assert window.run(NAMES)[0] == "G-000" and window.run(NAMES)[-1].startswith(("<script", "SN"))
    window.run("document.getElementById('filter').focus()")
    window.keys(*"sn-03")
    assert sorted(window.run(NAMES)) == [f"SN-03{k}" for k in range(10)]
    shown = "return document.getElementById('shown').textContent"
    assert window.run(shown) == "10 of 62 rows are shown."
    window.run("document.querySelector('#controls button').click()")
    window.run(
        "const s = document.getElementById('show'); s.value = 'failed';"
        " s.dispatchEvent(new Event('change'));"
    )
    window.run("return new Promise(done => setTimeout(done, 50))")
    assert len(window.run(NAMES)) == 1 and window.run(shown) == "1 of 62 rows are shown."
