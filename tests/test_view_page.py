"""The viewer's page in a real browser: phones, darkness, paper, keys and readers, and many bubbles."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

import warpedfoam as wf

from .browser import CANVAS, WHITE, axis, check_numbers, front, number, numbers, scene, shown, where
from .io_foams import sphere_foam, with_pressures


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


# ------------------------------------------------------------------ many bubbles


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
