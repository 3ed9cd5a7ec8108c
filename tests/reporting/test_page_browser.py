"""The report in a real browser: nothing on the console, every figure there and inked, both modes,
keyboard, narrow screens."""

from __future__ import annotations

import io
import itertools
import json
import re
import time

import browser
import numpy as np
import pytest
import records_by_hand

from hrg_cli import store
from hrg_cli.reporting.page import build_report

pytestmark = [
    pytest.mark.browser,
    pytest.mark.skipif(
        browser.programs() is None, reason="chromium and chromium-driver are not installed"
    ),
]

BOXES = """return [...document.querySelectorAll('figure')].map(f => {
  const s = f.querySelector('svg').getBoundingClientRect();
  return {id: f.id, x: s.left + scrollX, y: s.top + scrollY, width: s.width, height: s.height};
});"""
BACKGROUND = "return getComputedStyle(document.body).backgroundColor"


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    folder = tmp_path_factory.mktemp("page")
    path = folder / "report.html"
    path.write_text(build_report(records_by_hand.write_all(folder), truth=True), encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def living(tmp_path_factory):
    """A page whose diagnosis can be switched: without the first cause a bend of 4 mrad is left,
    without the second one of 1 mrad."""
    folder = tmp_path_factory.mktemp("living")
    record = records_by_hand.diagnosis()
    t, theta = record.time_s, record.wave_angle_rad
    across = (
        np.stack([-np.sin(2 * theta), np.cos(2 * theta), 0 * t, 0 * t], 1)
        * record.main_amplitude[:, None]
    )
    bends = {"pickoff_nonlinearity": 4e-3, "gain_mismatch": 1e-3}
    sets = [list(bends), *([name] for name in bends)]
    rows = [
        record.simulated_after - sum(bends[n] for n in names) * np.sin(t / 5)[:, None] * across
        for names in sets
    ]
    record = record.replace(simulated_without=np.stack(rows, axis=-1), left_out=json.dumps(sets))
    store.write(folder / "d.h5", record)
    (folder / "page.html").write_text(build_report([folder / "d.h5"]), encoding="utf-8")
    return folder / "page.html"


@pytest.fixture(scope="module")
def window(page, tmp_path_factory):
    with browser.session(tmp_path_factory.mktemp("profile")) as opened:
        opened.size(1200, 900)
        opened.scheme("light")
        opened.open(page.as_uri())
        yield opened


def pixels(png: bytes) -> np.ndarray:
    image = pytest.importorskip("PIL.Image").open(io.BytesIO(png))
    return np.asarray(image.convert("RGB")).astype(int)


def ink(picture: np.ndarray, box: dict) -> float:
    """Share of a figure's box that stands out of its background."""
    top, left = int(box["y"]), int(box["x"])
    part = picture[top : top + int(box["height"]), left : left + int(box["width"])]
    assert part.size, box
    background = part[2, 2]
    return float((np.abs(part - background).sum(-1) > 60).mean())


def test_no_console_message_and_no_request(window):
    assert window.log() == []
    assert window.run("return performance.getEntriesByType('resource').length") == 0


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_every_figure_is_drawn(window, scheme):
    window.scheme(scheme)
    boxes = window.run(BOXES)
    assert len(boxes) >= 20
    assert all(b["width"] > 400 and b["height"] > 100 for b in boxes)
    picture = pixels(window.picture())
    dark = picture[5, 5].sum() < 300
    assert dark == (scheme == "dark")
    for box in boxes:
        assert ink(picture, box) > 0.01, box["id"]
    window.scheme("light")


def test_figures_follow_the_mode(window):
    colour = "return getComputedStyle([...document.querySelectorAll('figure svg text')][0]).fill"
    window.scheme("light")
    light = window.run(colour)
    window.scheme("dark")
    assert window.run(colour) != light
    window.scheme("light")


def test_the_button_turns_the_page_dark_by_keyboard(window, page):
    window.scheme("light")
    light = window.run(BACKGROUND)
    window.run("document.getElementById('theme').focus()")
    window.keys(" ")
    assert window.run(BACKGROUND) != light
    label = "return document.getElementById('theme').textContent"
    assert window.run(label) == "Light page"
    window.keys("\ue007")
    assert window.run(BACKGROUND) == light and window.run(label) == "Dark page"
    window.scheme("dark")
    assert window.run(label) == "Dark page", "chosen by hand, whatever the system says"
    window.scheme("light")
    window.run("localStorage.clear()")


def test_the_first_tab_stop_skips_to_the_content(window, page):
    window.open(page.as_uri())
    window.keys("\ue004")
    assert window.run("return document.activeElement.className") == "skip"
    assert window.run("return document.activeElement.getBoundingClientRect().left") >= 0
    window.keys("\ue007")
    assert window.run("return document.activeElement.id") == "main"


def test_every_scrolling_part_can_be_reached_by_keyboard(window):
    stuck = window.run(
        """return [...document.querySelectorAll('*')].filter(e => e.scrollWidth > e.clientWidth + 1
        && ['auto', 'scroll'].includes(getComputedStyle(e).overflowX) && e.tabIndex < 0).map(e => e.outerHTML.slice(0, 80))"""
    )
    assert stuck == []


@pytest.mark.parametrize("width", [320, 375, 768, 1280, 1920])
def test_no_screen_scrolls_sideways(window, width):
    window.size(width, 800)
    assert window.run("return document.documentElement.scrollWidth") <= width
    boxes = window.run(BOXES)
    assert all(b["width"] > 250 for b in boxes)
    window.size(1200, 900)


def test_what_scrolls_says_so_until_its_end(window):
    """On a telephone a figure that goes on beyond the screen fades there and says so; nothing does
    on a wide screen."""
    more = "return document.querySelectorAll('figure .scroll.more').length"
    hint = (
        "return getComputedStyle(document.querySelector('figure figcaption'), '::before').content"
    )
    window.size(390, 800)
    eventually(lambda: window.run(more) > 0)
    assert "sideways" in window.run(hint)
    window.run("document.querySelectorAll('figure .scroll').forEach(p => p.scrollLeft = 1e5)")
    eventually(lambda: window.run(more) == 0)
    assert window.run(hint) == "none"
    window.size(1200, 900)
    window.run("document.querySelectorAll('figure .scroll').forEach(p => p.scrollLeft = 0)")
    eventually(lambda: window.run(more) == 0)


def eventually(true):
    """Wait for what follows a browser's own events."""
    for _ in range(50):
        if true():
            return
        time.sleep(0.1)
    raise AssertionError("it did not come")


def test_text_inside_figures_does_not_overlap(window):
    """Labels of one figure may touch but not lie over each other."""
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
    assert [o for o in overlaps if "correlation" not in o] == []


def test_headings_and_ids_are_in_order(window):
    levels = window.run(
        "return [...document.querySelectorAll('h1,h2,h3,h4')].map(h => +h.tagName[1])"
    )
    assert levels[0] == 1 and levels.count(1) == 1
    assert all(b - a <= 1 for a, b in itertools.pairwise(levels))
    assert (
        window.run(
            "const ids = [...document.querySelectorAll('[id]')].map(e => e.id); return ids.length -"
            " new Set(ids).size"
        )
        == 0
    )
    missing = window.run("""return [...document.querySelectorAll('[aria-labelledby]')]
        .filter(e => !document.getElementById(e.getAttribute('aria-labelledby')))
        .map(e => e.getAttribute('aria-labelledby'))""")
    assert missing == []


SAID = "return document.querySelector('.living .figures').textContent"
MARKS = """return [...document.querySelectorAll('.living .plots svg')].flatMap(s => ['middle', 'end']
    .map(a => [...s.querySelectorAll(`text[text-anchor=${a}]`)].filter(t => /^[−\\d.×⁰-⁹]+$/.test(t.textContent)).length));"""
SPREAD = """const d = [...document.querySelectorAll('.living .plots svg')][0].querySelector('.trace').getAttribute('d');
    const y = [...d.matchAll(/ ([\\d.]+)/g)].map(m => +m[1]); return Math.max(...y) - Math.min(...y);"""


def drift(window) -> float:
    return float(re.search(r"drift error ([\d.]+)", window.run(SAID))[1])


def test_the_living_figure_follows_its_switches(window, living):
    """Each switch changes residual, drift and Allan curve; by keyboard too; nothing is loaded and
    nothing said on the console."""
    window.open(living.as_uri())
    assert window.run("return document.querySelectorAll('.living svg').length") == 2
    marks = window.run(MARKS)
    assert min(marks) >= 2, "an axis with one mark has no scale"
    with_all, flat = drift(window), window.run(SPREAD)
    window.run("document.querySelectorAll('.living input')[0].click()")
    without_first, bent = drift(window), window.run(SPREAD)
    assert without_first > 3 * with_all and bent > 5 * flat
    window.run("document.querySelectorAll('.living input')[1].focus()")
    window.keys(" ")
    assert (
        window.run("return document.querySelector('.living').dataset.state") == "00"
        and drift(window) > without_first
    )
    window.run("document.querySelectorAll('.living input')[0].click()")
    assert with_all < drift(window) < without_first
    assert (
        window.log() == []
        and window.run("return performance.getEntriesByType('resource').length") == 0
    )


HOST = "document.querySelector('[data-surface]')"
FACES = f"return [...{HOST}.querySelectorAll('.face')].map(f => f.getAttribute('d')).join()"


def turned(window) -> list[int]:
    return [int(part) for part in window.run(f"return {HOST}.dataset.seen").split()]


def test_the_surface_is_turned_by_keys_sliders_and_hand(window, page):
    """Every way of turning draws it anew; from above it is a map, in which the depth of a face is
    its height alone; nothing is loaded and nothing said on the console."""
    window.open(page.as_uri())
    window.run(f"{HOST}.scrollIntoView()")
    first, drawn = turned(window), window.run(FACES)
    assert drawn.count("M") == 4 * 48  # 5 nodes, 49 angles
    window.run(f"{HOST}.querySelector('.plot').focus()")
    window.keys("\ue014", "\ue014", "\ue013")  # right, right, up
    assert turned(window) == [first[0] + 10, first[1] + 5]
    keyed = window.run(FACES)
    assert keyed != drawn
    # at once: a page that still glides would have the mouse miss the plot
    box = window.run(
        f"const p = {HOST}.querySelector('.plot');"
        " p.scrollIntoView({behavior: 'instant', block: 'center'});"
        " const b = p.getBoundingClientRect();"
        " return [b.left + b.width / 2, b.top + b.height / 2]"
    )
    for kind, right, down in (("Pressed", 0, 0), ("Moved", 60, 30), ("Released", 60, 30)):
        window.devtools(
            "Input.dispatchMouseEvent",
            type=f"mouse{kind}",
            x=box[0] + right,
            y=box[1] + down,
            button="left",
            buttons=1,
            clickCount=1,
        )
    assert turned(window) == [first[0] + 40, first[1] + 15]
    window.run(
        f"const s = {HOST}.querySelectorAll('input[type=range]')[1]; s.value = 90;"
        " s.dispatchEvent(new Event('input'))"
    )
    assert turned(window)[1] == 90
    window.run(f"{HOST}.querySelectorAll('input[type=radio]')[1].click()")
    assert window.run(f"return {HOST}.querySelector('.figures').textContent").startswith(
        "scale factor K from"
    )
    assert window.log() == []
    assert window.run("return performance.getEntriesByType('resource').length") == 0


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("width", [320, 768, 1280])
def test_the_answer_fits_every_screen(window, living, scheme, width):
    window.open(living.as_uri())
    window.scheme(scheme)
    window.size(width, 800)
    assert window.run("return document.documentElement.scrollWidth") <= width
    first = window.run(
        "const b = document.querySelector('.sentence').getBoundingClientRect(); return [b.top,"
        " b.bottom]"
    )
    assert first[0] > 0 and first[1] < 800, "the answer is on the first screen"
    window.scheme("light")
    window.size(1200, 900)
