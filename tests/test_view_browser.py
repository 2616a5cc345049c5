"""The viewer in a real browser: it draws, a click reads the right bubble, frames play."""

from __future__ import annotations

import numpy as np
import pytest

import warpedfoam as wf

from . import browser as driver
from .browser import (
    ACCENT,
    CANVAS,
    COMING,
    WHITE,
    awaited_browser,
    axis,
    check_numbers,
    front,
    number,
    numbers,
    scene,
    shown,
    where,
)
from .io_foams import bubble_on_torus, sphere_foam, torus_foam, with_pressures
from .test_view import repeating, rimmed


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
