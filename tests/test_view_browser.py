"""The viewer in a real browser: it draws, a click reads the right bubble, fingers and frames work."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

import warpedfoam as wf

from . import browser as driver
from .browser import COMING, Browser, awaited_browser
from .io_foams import bubble_on_torus, sphere_foam, torus_foam, with_pressures
from .test_view import repeating, rimmed

WHITE = np.array([255, 255, 255])
ACCENT = np.array([0xD4, 0x00, 0x9F])
CANVAS = "document.getElementById('scene').getBoundingClientRect().toJSON()"


@pytest.fixture(scope="module")
def running():
    if awaited_browser() is None:
        pytest.skip("needs Chromium")
    browser = Browser()
    yield browser
    browser.close()


@pytest.fixture
def browser(running):
    """A window of a desktop in the light; the page must not have complained, nor asked for anything."""
    running.window(740, 420)
    running.dark(False)
    yield running
    assert running.complaints == []
    assert all(url.startswith(("file:", "data:", "blob:")) for url in running.requests)


def shown(browser, path, *args, **kwargs):
    browser.open(wf.write_view(path / "view.html", *args, **kwargs))


def scene(browser):
    """Pixels of the canvas."""
    box = browser.ask(CANVAS)
    pixels = browser.screenshot()
    scale = pixels.shape[1] / browser.ask("innerWidth")
    x, y, w, h = (round(scale * box[k]) for k in ("x", "y", "width", "height"))
    return pixels[y : y + h, x : x + w].astype(int)


def front(foam, towards):
    """Bubbles whose centres face the eye most, foremost first."""
    normals = foam.cell.surface.normals(foam.bubble_centres)
    return np.argsort(-(normals @ np.asarray(towards)))


def axis(elevation, azimuth):
    e, a = np.radians([elevation, azimuth])
    return np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])


def where(browser, point):
    return tuple(browser.ask(f"foamViewer.where({list(map(float, point))})"))


def numbers(browser):
    """The table of the picked bubble: caption, and rows by name."""
    code = """[document.querySelector('#numbers caption')?.textContent ?? null,
      Object.fromEntries(
        [...document.querySelectorAll('#numbers td')].map((c) => [c.dataset.name, c.textContent]))]"""
    return browser.ask(code)


def number(text):
    return float(text.replace("−", "-"))


def check_numbers(browser, foam, bubble):
    caption, rows = numbers(browser)
    assert caption == f"Bubble {foam.bubble_ids[bubble]}"
    assert number(rows["sides"]) == foam.network.sides[bubble]
    assert number(rows["charge"]) == foam.network.charges[bubble]
    assert number(rows["area"]) == pytest.approx(foam.bubble_areas[bubble], rel=1e-5)
    assert number(rows["volume"]) == pytest.approx(foam.bubble_volumes[bubble], rel=1e-5)
    assert number(rows["target volume"]) == pytest.approx(foam.target_volumes[bubble], rel=1e-5)
    if foam.pressures is not None:
        assert number(rows["pressure"]) == pytest.approx(foam.pressures[bubble], rel=1e-4)
    mean = foam.bubble_curvatures[bubble] / foam.bubble_areas[bubble]
    assert number(rows["mean Gaussian curvature"]) == pytest.approx(mean, rel=1e-4)


def test_an_installation_is_waited_for(monkeypatch, tmp_path):
    """Until it says that it has ended, and no longer than that: with a browser or without."""
    there, found = tmp_path / "there", []
    monkeypatch.setenv(COMING, str(there))
    monkeypatch.setattr(driver.time, "sleep", lambda _: (found.append("chromium"), there.touch()))
    monkeypatch.setattr(driver, "browser_path", lambda: found[0] if found else None)
    assert awaited_browser() == "chromium"
    assert len(found) == 1
    found.clear()
    assert awaited_browser() is None


# ------------------------------------------------------------------ drawing


def test_a_sphere_is_a_disk_in_its_bubbles_colours(browser, tmp_path):
    foam = sphere_foam(60)
    shown(browser, tmp_path, foam)
    pixels = scene(browser)
    filled = (pixels != WHITE).any(axis=2)
    height, width = filled.shape
    rows, columns = np.flatnonzero(filled.any(axis=1)), np.flatnonzero(filled.any(axis=0))
    # the ball fills the narrower side but for 4 %, and is round
    across, upright = np.ptp(columns) + 1, np.ptp(rows) + 1
    assert upright == pytest.approx(min(width, height) / 1.04, rel=0.02)
    assert across == pytest.approx(upright, abs=4)
    assert filled.sum() == pytest.approx(np.pi / 4 * across * upright, rel=0.01)
    # at the middle of each bubble in front: its own colour, between the darkest and the brightest light
    rgb = wf.io.colours.bubble_colours(foam, "charge").rgb.astype(float)
    box = browser.ask(CANVAS)
    for bubble in front(foam, axis(25.0, -60.0))[:12]:
        x, y = where(browser, foam.bubble_centres[bubble])
        pixel = pixels[int(y - box["y"]), int(x - box["x"])]
        light = pixel / rgb[bubble]
        assert 0.7 <= light.min() <= light.max() <= 1.01
        assert np.ptp(light * rgb[bubble] - light.mean() * rgb[bubble]) < 4.0


def test_the_far_side_is_hidden(browser, tmp_path):
    """Bubbles that face away are not what a click in their place picks."""
    foam = with_pressures(sphere_foam(60))
    shown(browser, tmp_path, foam)
    order = front(foam, axis(25.0, -60.0))
    for bubble in order[-6:]:
        browser.mouse(where(browser, foam.bubble_centres[bubble]))
        caption, _ = numbers(browser)
        seen = {f"Bubble {k}" for k in foam.bubble_ids[order[:30]]}
        assert caption in seen


@pytest.mark.parametrize(
    ("foam", "view"),
    [
        (with_pressures(sphere_foam(80)), (25.0, -60.0)),
        (with_pressures(torus_foam()), (48.0, -60.0)),
        (repeating(), (90.0, -90.0)),
        (rimmed(), (25.0, -60.0)),
    ],
    ids=["sphere", "torus", "periodic", "rim"],
)
def test_a_click_reads_the_bubbles_numbers(browser, tmp_path, foam, view):
    shown(browser, tmp_path, foam)
    for bubble in front(foam, axis(*view))[:5]:
        browser.mouse(where(browser, foam.bubble_centres[bubble]))
        check_numbers(browser, foam, bubble)
    assert (np.abs(scene(browser) - ACCENT).max(axis=2) < 12).sum() > 100
    browser.key("Escape")
    assert numbers(browser) == [None, {}]
    assert (np.abs(scene(browser) - ACCENT).max(axis=2) < 12).sum() == 0


def test_beside_the_foam_nothing_is_picked(browser, tmp_path):
    shown(browser, tmp_path, sphere_foam(20))
    box = browser.ask(CANVAS)
    browser.mouse((box["x"] + 5, box["y"] + 5))
    assert numbers(browser) == [None, {}]


def test_what_is_no_disk_lies_under_its_bubbles(browser, tmp_path):
    foam = bubble_on_torus()
    shown(browser, tmp_path, foam)
    browser.ask("foamViewer.pick(0)")
    browser.mouse(where(browser, foam.bubble_centres[0]))
    check_numbers(browser, foam, 0)
    browser.ask("foamViewer.pick(1)")
    _, rows = numbers(browser)
    assert rows["area"] == "–"
    assert rows["Euler number"] == "−1"


def test_backs_are_paler(browser, tmp_path):
    """A dome from below: its inside, with less colour than its outside."""
    browser.window(900, 600)
    foam = rimmed()
    shown(browser, tmp_path, foam)

    def colourfulness():
        pixels = scene(browser)
        filled = (pixels != WHITE).any(axis=2)
        return np.ptp(pixels[filled], axis=1).mean()

    outside = colourfulness()
    for _ in range(12):
        browser.ask("document.getElementById('scene').focus()")
        browser.key("ArrowUp")
    assert colourfulness() < 0.5 * outside


# ------------------------------------------------------------------ controls


def test_turning_zooming_moving_and_home(browser, tmp_path):
    foam = sphere_foam(40)
    shown(browser, tmp_path, foam)
    near = 2.0 * axis(25.0, -60.0)
    start, first = where(browser, near), scene(browser)
    browser.mouse(start, *((start[0] + 8 * k, start[1]) for k in range(1, 11)))
    assert where(browser, near)[0] > start[0] + 40
    assert numbers(browser) == [None, {}]  # a drag is no click
    assert (scene(browser) != first).any()
    browser.key("Home")
    assert where(browser, near) == pytest.approx(start, abs=1e-6)
    inner = slice(6, -6)  # without the mark of the keyboard's focus
    np.testing.assert_array_equal(scene(browser)[inner, inner], first[inner, inner])
    browser.wheel((start[0] + 60, start[1]), -120)
    filled = (scene(browser) != WHITE).any(axis=2).sum()
    assert filled > 1.1 * (first != WHITE).any(axis=2).sum()
    browser.key("Home")
    browser.mouse(start, *((start[0] + 8 * k, start[1] + 4 * k) for k in range(1, 11)), button="right")
    x, y = where(browser, near)
    # nearer than the middle, so it goes a little farther
    assert x - start[0] == pytest.approx(80, rel=0.5)
    assert y - start[1] == pytest.approx(40, rel=0.5)


def test_colours_films_and_defects(browser, tmp_path):
    foam = with_pressures(sphere_foam(60))
    shown(browser, tmp_path, foam, color_by="sides")
    options = browser.ask("[...document.getElementById('color-by').options].map((o) => o.value)")
    assert options == ["charge", "sides", "area", "volume", "pressure", "curvature", "surface", "id"]
    legend = "[...document.querySelectorAll('#legend .swatch')].map((s) => s.textContent)"
    counts = np.bincount(foam.network.sides)
    assert browser.ask(legend) == [f"{n}× {counts[n]}" for n in np.flatnonzero(counts)]
    pictures = []
    for name in options:
        browser.ask(f"foamViewer.colourBy('{name}')")
        pictures.append(scene(browser))
    # on a sphere volumes go with areas, and the curvature is one number
    alike = {"area": "volume", "curvature": "surface"}
    for k, name in enumerate(options):
        for j in range(k):
            same = np.abs(pictures[j] - pictures[k]).max() <= 2  # the surface's is read off a ramp of bytes
            assert same == (alike.get(options[j]) == name), (options[j], name)
    browser.ask("foamViewer.colourBy('pressure')")
    ends = browser.ask("[...document.querySelectorAll('.ends span')].map((s) => s.textContent)")
    assert [number(ends[0]), number(ends[-1])] == pytest.approx(
        [foam.pressures.min(), foam.pressures.max()], rel=1e-3
    )
    browser.ask("foamViewer.colourBy('charge')")
    before = scene(browser)
    dark = (before.max(axis=2) < 60).sum()
    browser.ask("document.getElementById('films').click()")
    assert (scene(browser).max(axis=2) < 60).sum() < 0.2 * dark
    browser.ask("document.getElementById('charged').click(); foamViewer.colourBy('pressure')")
    pixels, box = scene(browser), browser.ask(CANVAS)
    for bubble in front(foam, axis(25.0, -60.0))[:15]:
        x, y = where(browser, foam.bubble_centres[bubble])
        pixel = pixels[int(y - box["y"]), int(x - box["x"])]
        assert (np.ptp(pixel) < 3) == (foam.network.charges[bubble] == 0)


def test_find_by_id_and_neighbours(browser, tmp_path):
    foam = with_pressures(sphere_foam(40))
    shown(browser, tmp_path, foam)
    hidden = front(foam, axis(25.0, -60.0))[-1]
    browser.ask(f"document.getElementById('find-id').value = '{foam.bubble_ids[hidden]}'")
    browser.ask("document.getElementById('find').requestSubmit()")
    check_numbers(browser, foam, hidden)
    links = browser.ask("[...document.querySelectorAll('.links button')].map((b) => Number(b.textContent))")
    network = foam.network
    near = {*network.right[network.left == hidden], *network.left[network.right == hidden]}
    assert links == sorted(foam.bubble_ids[list(near)])
    # it has turned to the front: a click in its place picks it
    browser.key("Escape")
    browser.mouse(where(browser, foam.bubble_centres[hidden]))
    check_numbers(browser, foam, hidden)
    browser.ask("document.querySelector('.links button').click()")
    check_numbers(browser, foam, int(np.flatnonzero(foam.bubble_ids == links[0])[0]))


def test_a_trajectory_plays(browser, tmp_path):
    frames = [sphere_foam(n, seed=n) for n in (20, 24, 30)]
    shown(browser, tmp_path, frames, labels=["one", "two", "three"])
    facts = "document.getElementById('frame-facts').textContent"
    assert browser.ask(facts).startswith("20 bubbles")
    browser.ask("foamViewer.pick(22)")
    assert "no bubble 22" in browser.ask("document.getElementById('numbers').textContent")
    first = scene(browser)
    browser.ask("foamViewer.show(1)")
    check_numbers(browser, frames[1], 22)  # followed by its id
    assert (scene(browser) != first).any()
    browser.ask("document.getElementById('speed').value = '25'")
    browser.ask("document.getElementById('play').click()")
    arrived = """new Promise((done) => {
      const look = () => document.getElementById('frame').value === '2' ? done(true) : setTimeout(look, 20);
      look();
    })"""
    assert browser.ask(arrived)
    assert browser.ask(facts).startswith("30 bubbles")
    assert browser.ask("document.getElementById('frame-label').textContent") == "three (3/3)"
    browser.ask("new Promise((r) => setTimeout(r, 100))")
    assert browser.ask("document.getElementById('play').getAttribute('aria-label')") == "Play"
    check_numbers(browser, frames[2], 22)


def test_lost_graphics_come_back(browser, tmp_path):
    shown(browser, tmp_path, sphere_foam(20))
    first = scene(browser)
    browser.ask(
        """new Promise((done) => {
          const canvas = document.getElementById('scene');
          const lose = canvas.getContext('webgl2').getExtension('WEBGL_lose_context');
          canvas.addEventListener('webglcontextrestored', () => setTimeout(() => done(true), 50));
          canvas.addEventListener('webglcontextlost', () => setTimeout(() => lose.restoreContext(), 50));
          lose.loseContext();
        })"""
    )
    np.testing.assert_array_equal(scene(browser), first)


# ------------------------------------------------------------------ phones, darkness, many bubbles


def test_on_a_phone(browser, tmp_path):
    foam = with_pressures(sphere_foam(40))
    browser.window(360, 640, dots=3, phone=True)
    shown(browser, tmp_path, foam)
    assert browser.ask("document.documentElement.scrollWidth") <= 360
    assert browser.ask("document.getElementById('scene').width") == 3 * 360
    box = browser.ask(CANVAS)
    assert box["height"] > 0.4 * 640
    sizes = browser.ask(
        "[...document.querySelectorAll('button, select')].filter((b) => b.checkVisibility())"
        ".map((b) => Math.min(b.offsetWidth, b.offsetHeight))"
    )
    assert min(sizes) >= 32  # for fingers
    near = 2.0 * axis(25.0, -60.0)
    start = where(browser, near)
    bubble = front(foam, axis(25.0, -60.0))[0]
    browser.touch((where(browser, foam.bubble_centres[bubble]),))
    check_numbers(browser, foam, bubble)
    browser.touch(tuple((start[0] + 6 * k, start[1]) for k in range(12)))
    assert where(browser, near)[0] > start[0] + 30
    browser.key("Home")
    middle = (box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    edge = 2.0 * np.array([-np.sin(np.radians(-60.0)), np.cos(np.radians(-60.0)), 0.0])
    before = where(browser, edge)[0] - middle[0]
    browser.touch(
        tuple((middle[0] - 30 - 3 * k, middle[1]) for k in range(11)),
        tuple((middle[0] + 30 + 3 * k, middle[1]) for k in range(11)),
    )
    assert (where(browser, edge)[0] - middle[0]) / before == pytest.approx(2.0, rel=0.1)


def test_in_the_dark(browser, tmp_path):
    browser.dark(True)
    shown(browser, tmp_path, sphere_foam(20))
    assert scene(browser)[3, 3].tolist() == [0x17, 0x18, 0x1C]
    browser.ask("document.getElementById('theme').click()")
    assert scene(browser)[3, 3].tolist() == [255, 255, 255]


def test_on_paper(browser, tmp_path):
    """One page, white, with the picture in it and none of the controls."""
    browser.dark(True)
    shown(browser, tmp_path, sphere_foam(40))
    raw = browser.paper()
    assert raw.count(b"/Type /Page\n") == 1
    box = browser.ask(CANVAS)
    width, height = browser.ask("(({ width, height }) => [width, height])(document.getElementById('paper'))")
    assert [width, height] == pytest.approx([2 * box["width"], 2 * box["height"]], abs=1)
    assert re.search(rb"/Subtype /Image\s/Width %d\s/Height %d\s" % (width, height), raw)
    copied = """(() => {
      const paper = document.getElementById('paper'), at = paper.getContext('2d');
      const { data } = at.getImageData(0, 0, paper.width, paper.height);
      let white = 0;
      for (let k = 0; k < data.length; k += 4) white += data[k] + data[k + 1] + data[k + 2] === 765;
      return [white / (data.length / 4), [...data.slice(0, 4)]];
    })()"""
    white, corner = browser.ask(copied)
    assert corner == [255, 255, 255, 255]
    # the ball fills the narrower side but for 4 %
    narrow, wide = sorted((box["width"], box["height"]))
    assert 1 - white == pytest.approx(np.pi / 4 * narrow / wide / 1.04**2, rel=0.15)
    assert scene(browser)[3, 3].tolist() == [0x17, 0x18, 0x1C]


def test_long_labels_do_not_push_controls_out(browser, tmp_path):
    browser.window(390, 844, dots=3, phone=True)
    words = "a step of which there is very much more to say than a phone has room for"
    title = "</script><script>document.title = 'broken'</script>"
    shown(browser, tmp_path, [sphere_foam(12), sphere_foam(14)], labels=[words, "<b>2</b>"], title=title)
    inside = """['play', 'frame', 'speed', 'frame-label'].map((id) => {
      const box = document.getElementById(id).getBoundingClientRect();
      return box.left >= 0 && box.right <= innerWidth && box.width > 30 && box.bottom <= innerHeight;
    })"""
    assert browser.ask(inside) == [True] * 4
    assert browser.ask("document.documentElement.scrollWidth") <= 390
    label = "document.getElementById('frame-label').textContent"
    assert browser.ask(label) == f"{words} (1/2)"
    assert browser.ask("[document.title, document.querySelector('h1').textContent]") == [title, title]
    browser.ask("foamViewer.show(1)")
    assert browser.ask(label) == "<b>2</b> (2/2)"


def test_gaps_that_vary_are_told(browser, tmp_path):
    cell = wf.HeleShawCell(wf.Torus(3.0, 1.2), gap=lambda x: 0.2 + 0.02 * x[:, 0])
    foam = wf.voronoi_foam(cell, n_bubbles=40, seeds="lattice")
    shown(browser, tmp_path, foam, color_by="gap")
    at_centres = 0.2 + 0.02 * foam.bubble_centres[:, 0]
    ends = browser.ask("[...document.querySelectorAll('.ends span')].map((s) => s.textContent)")
    assert number(ends[0]) == pytest.approx(at_centres.min(), rel=1e-3)
    assert number(ends[-1]) == pytest.approx(at_centres.max(), rel=1e-3)
    browser.ask("foamViewer.pick(3)")
    assert number(numbers(browser)[1]["gap"]) == pytest.approx(at_centres[3], rel=1e-4)
    least, most = re.findall(
        r"gap ([\d.]+) to ([\d.]+)", browser.ask("document.getElementById('frame-facts').textContent")
    )[0]
    assert float(least) == pytest.approx(0.2 - 0.02 * 4.2, rel=0.01)
    assert float(most) == pytest.approx(0.2 + 0.02 * 4.2, rel=0.01)


def test_every_control_has_a_name_and_can_be_reached(browser, tmp_path):
    """What a screen reader is told of the page, and the way of the tab key through it."""
    shown(browser, tmp_path, [with_pressures(sphere_foam(30)), with_pressures(sphere_foam(32))])
    browser.ask("foamViewer.pick(1000)")
    nodes = browser.accessibility()
    roles = ("button", "checkbox", "combobox", "slider", "textbox", "image", "img", "link")
    controls = [(role, name) for role, name in nodes if role in roles]
    assert len(controls) > 12
    assert all(name for _, name in controls), controls
    names = {name for _, name in controls}
    assert {"Play", "Frame", "Colour by", "Films", "First view", "Bubble", "Unpick"} <= names
    seen = []
    browser.ask("document.activeElement.blur()")
    for _ in range(30):
        browser.key("Tab", code=9)
        seen.append(browser.ask("document.activeElement.id"))
    assert {"scene", "color-by", "films", "charged", "find-id", "unpick", "frame", "play", "speed"} <= set(
        seen
    )
    # what has the focus is outlined
    browser.ask("document.getElementById('films').focus()")
    browser.key("Tab", code=9)
    assert browser.ask("getComputedStyle(document.activeElement).outlineStyle") == "solid"


@pytest.mark.parametrize("dark", [False, True])
def test_letters_stand_out(browser, tmp_path, dark):
    """Contrast of every text with what is behind it: at least 4.5, as WCAG 2.1 asks of such letters."""
    browser.dark(dark)
    shown(browser, tmp_path, [with_pressures(sphere_foam(30)), with_pressures(sphere_foam(32))])
    browser.ask("foamViewer.pick(1000)")
    code = """(() => {
      const parts = (text) => text.match(/[\\d.]+/g).map(Number);
      const light = (text) => parts(text).slice(0, 3).map((x) => x / 255)
        .map((x) => (x <= 0.03928 ? x / 12.92 : ((x + 0.055) / 1.055) ** 2.4))
        .reduce((sum, x, k) => sum + x * [0.2126, 0.7152, 0.0722][k], 0);
      const behind = (node) => {
        for (let at = node; at; at = at.parentElement) {
          const found = getComputedStyle(at).backgroundColor, [,,, share = 1] = parts(found);
          if (share === 1) return found;
        }
      };
      const out = [];
      const kinds = 'h1, p, label, select, button, input, th, td, caption, span, output';
      for (const node of document.querySelectorAll(kinds))
        if (node.checkVisibility() && node.textContent.trim()) {
          const [a, b] = [light(getComputedStyle(node).color), light(behind(node))].sort((x, y) => y - x);
          out.push([(a + 0.05) / (b + 0.05), node.textContent.trim().slice(0, 20)]);
        }
      return out;
    })()"""
    found = browser.ask(code)
    assert len(found) > 25
    assert min(found)[0] >= 4.5, min(found)


def rested(browser):
    """Once the picture has stopped and been drawn in all detail."""
    browser.ask("new Promise((r) => setTimeout(r, 250))")
    browser.settle()
    return browser.ask("foamViewer.drawn()")


def held(browser, *path):
    """Drag along a path and do not let go; what a picture meanwhile was drawn of, or None."""
    browser.ask(
        """(() => {
          window.told = [];
          const look = () => {
            foamViewer.drawn().then((one) => told.push(one));
            window.watching = requestAnimationFrame(look);
          };
          look();
        })()"""
    )
    for kind, place in zip(["mousePressed"] + ["mouseMoved"] * len(path), (path[0], *path), strict=True):
        browser.mouse_event(kind, place)
    browser.settle()
    return browser.ask("(cancelAnimationFrame(watching), told.filter((one) => !one.smooth).pop())")


def test_two_thousand_bubbles(browser, tmp_path):
    """Right where it is clicked and small in triangles; `benchmarks/view_frames.py` has the times."""
    foam = sphere_foam(2000, even=True)
    path = wf.write_view(tmp_path / "view.html", foam)
    assert Path(path).stat().st_size < 5e6
    browser.open(path)
    for bubble in front(foam, axis(25.0, -60.0))[:3]:
        browser.mouse(where(browser, foam.bubble_centres[bubble]))
        check_numbers(browser, foam, bubble)
    # drawn when something changes, and only then
    drawn = "Number(document.getElementById('scene').dataset.drawn)"
    count = browser.ask(drawn)
    browser.ask("new Promise((r) => setTimeout(r, 300))")
    assert browser.ask(drawn) == count
    times = browser.ask("foamViewer.time(3)")
    assert len(times) == 3
    cost = browser.ask("foamViewer.cost()")
    assert 0.0 < cost["picture"] < cost["frame"]


def test_a_moving_picture_is_drawn_in_less(browser, tmp_path):
    """Fewer triangles and no smoothing while it moves; all of it at rest; picking does not mind."""
    foam = sphere_foam(2000, even=True)
    shown(browser, tmp_path, foam)
    first, pixels = rested(browser), scene(browser)
    all_triangles = 2 * foam.network.n_films * 2
    # what faces away is not drawn: somewhat more than half of the sphere's bubbles are left
    assert 0.45 * all_triangles < first["triangles"] < 0.7 * all_triangles
    assert first["smooth"]
    assert not first["moving"]
    x, y = where(browser, 2.0 * axis(25.0, -60.0))
    during = held(browser, *((x + 8 * k, y + 3 * k) for k in range(8)))
    assert during is not None
    assert during["level"] > first["level"]
    assert during["triangles"] <= 0.6 * first["triangles"]
    # at most one picture for each that the window shows, however many events
    burst = browser.ask(
        """new Promise(async (done) => {
          const before = (await foamViewer.drawn()).pictures;
          const canvas = document.getElementById('scene');
          let shown = 0, k = 0;
          const step = () => {
            for (let j = 0; j < 20; j++)
              canvas.dispatchEvent(new WheelEvent('wheel', { deltaY: j % 2 ? 3 : -3 }));
            if (++k < 6) { shown++; requestAnimationFrame(step); }
            else requestAnimationFrame(async () => {
              done([(await foamViewer.drawn()).pictures - before, shown]);
            });
          };
          step();
        })"""
    )
    assert burst[0] <= burst[1] + 2
    # still held, at rest: all detail again, and then nothing more
    after = rested(browser)
    assert not after["moving"]
    assert after["smooth"]
    assert after["triangles"] > 1.6 * during["triangles"]
    assert (after["width"], after["height"]) == (first["width"], first["height"])
    assert rested(browser)["pictures"] == after["pictures"]
    browser.mouse_event("mouseReleased", (x, y))
    for bubble in front(foam, axis(25.0, -60.0))[:2]:
        browser.mouse(where(browser, foam.bubble_centres[bubble]))
        check_numbers(browser, foam, bubble)
    # a tap right after a drag, before it has rested
    held(browser, (x, y), (x + 30, y), (x + 60, y))
    browser.mouse_event("mouseReleased", (x, y))
    bubble = front(foam, axis(25.0, -60.0))[4]
    browser.mouse(where(browser, foam.bubble_centres[bubble]))
    check_numbers(browser, foam, bubble)
    browser.key("Escape")
    browser.ask("document.getElementById('home').click()")
    rested(browser)
    # but for the outline of what has the focus
    np.testing.assert_array_equal(scene(browser)[3:-3, 3:-3], pixels[3:-3, 3:-3])


def test_what_is_out_of_the_window_is_not_drawn(browser, tmp_path):
    """Zoomed in: all detail, of the few bubbles in sight."""
    foam = sphere_foam(2000, even=True)
    shown(browser, tmp_path, foam)
    box = browser.ask(CANVAS)
    middle = (box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    for _ in range(6):
        browser.wheel(middle, -200.0)
    told = rested(browser)
    assert told["level"] == 0
    assert told["triangles"] < 0.1 * 2 * foam.network.n_films * 4 * 3
    assert (scene(browser) != WHITE).any(axis=2).all()
    for bubble in front(foam, axis(25.0, -60.0))[:3]:
        browser.mouse(where(browser, foam.bubble_centres[bubble]))
        check_numbers(browser, foam, bubble)
