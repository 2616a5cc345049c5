"""The page's scripts without a browser: what they make of the data, and where they put it (node)."""

from __future__ import annotations

import json
import shutil
import subprocess
from itertools import pairwise

import numpy as np
import pytest

import warpedfoam as wf

from .io_foams import sphere_foam, torus_foam, with_pressures
from .test_view import PAGE, read_page

WHOLE, PIXEL = (-1.0, 1.0, -1.0, 1.0), (0.1, 0.12, -0.3, -0.28)
NODE = shutil.which("node")
pytestmark = pytest.mark.skipif(NODE is None, reason="needs node")


def run(code, *scripts):
    """JSON that code prints with ``tell(value)``, after these scripts of the page."""
    source = "\n".join((PAGE / name).read_text(encoding="utf-8") for name in scripts)
    source = f'"use strict";\nconst tell = (x) => console.log(JSON.stringify(x));\n{source}\n{code}'
    done = subprocess.run([str(NODE), "-"], input=source, capture_output=True, text=True, encoding="utf-8")
    assert done.returncode == 0, done.stderr
    return [json.loads(line) for line in done.stdout.splitlines()]


def camera(view=(25.0, -60.0), zoom=1.0, target=(0.0, 0.0, 0.0), radius=2.0):
    return (
        f"{{ axes: axesFromAngles({view[0]}, {view[1]}), zoom: {zoom}, target: {list(target)}, "
        f"centre: [0, 0, 0], radius: {radius} }}"
    )


def test_frames_are_unpacked_as_python_packed_them(tmp_path):
    foam = with_pressures(sphere_foam(320, even=True))
    path = wf.write_view(tmp_path / "v.html", foam)
    facts, (arrays,) = read_page(path)
    text = path.read_text(encoding="utf-8").split('id="frame-0">')[1].split("</script>")[0]
    (tmp_path / "facts.json").write_text(json.dumps(facts))
    (tmp_path / "frame.txt").write_text(text)
    code = f"""
    const fs = require("fs");
    const facts = JSON.parse(fs.readFileSync({json.dumps(str(tmp_path / "facts.json"))}, "utf8"));
    const text = fs.readFileSync({json.dumps(str(tmp_path / "frame.txt"))}, "utf8");
    new Frames(facts, () => text).get(0).then((frame) => tell({{
      pressure: [...frame.values.pressure], ids: [...frame.ids], neighbours: frame.neighbours,
      meshes: frame.meshes.map((m) => ({{
        triangles: [...m.triangles],
        owner: [...m.owner], beside: [...m.beside], lines: [...m.linePoints], quads: [...m.quads] }})),
    }}));
    """
    (told,) = run(code, "frames.js")
    np.testing.assert_array_equal(told["pressure"], foam.pressures)
    np.testing.assert_array_equal(told["ids"], foam.bubble_ids)
    beside = [set() for _ in range(foam.n_bubbles)]
    for a, b in zip(foam.network.left.tolist(), foam.network.right.tolist(), strict=True):
        beside[a].add(b)
        beside[b].add(a)
    assert [set(near) for near in told["neighbours"]] == beside
    assert len(told["meshes"]) == 2
    for k, mesh in enumerate(told["meshes"]):
        np.testing.assert_array_equal(np.reshape(mesh["triangles"], (-1, 3)), arrays[f"mesh{k}:triangles"])
        np.testing.assert_array_equal(mesh["owner"], arrays[f"mesh{k}:owner"])
        np.testing.assert_array_equal(np.reshape(mesh["beside"], (-1, 2))[::4], arrays[f"mesh{k}:beside"])
        low, side = np.array(facts["cube"]["low"]), facts["cube"]["side"]
        ends = low + side * np.reshape(mesh["lines"], (-1, 4, 2, 4))[..., :3] / 65535.0
        assert np.ptp(ends, axis=1).max() == 0.0  # the same at all corners of a quad
        ends = ends[:, 0]
        corners = np.reshape(mesh["quads"], (-1, 6))
        assert (np.sort(np.unique(corners)) == np.arange(4 * len(ends))).all()
        assert (corners // 4 == np.arange(len(ends))[:, None]).all()
        np.testing.assert_allclose(
            ends, arrays[f"mesh{k}:line_points"][arrays[f"mesh{k}:segments"]], atol=1e-12
        )


def test_only_frames_used_last_stay_unpacked():
    code = """
    const facts = { frames: Array.from({ length: 5 }, () => ({})) };
    const frames = new Frames(facts, (k) => String(k));
    const made = [];
    globalThis.atob = (text) => (made.push(Number(text)), "");
    inflated = async () => null;
    frameFrom = () => ({ bytes: 100e6 });
    (async () => {
      for (const k of [0, 1, 0, 2, 0, 1]) await frames.get(k);
      tell([made, [...frames.kept.keys()]]);
    })();
    """
    ((made, kept),) = run(code, "frames.js")
    assert made == [0, 1, 2, 1]
    assert kept == [0, 1]


def test_points_land_where_a_pinhole_puts_them():
    """The clip matrix and `projected` against a pinhole camera written down here."""
    points = np.random.default_rng(0).uniform(-2, 2, (40, 3)) / np.sqrt(3)
    width, height, zoom, target = 500, 800, 1.7, (0.2, -0.1, 0.3)
    code = f"""
    const camera = {camera(zoom=zoom, target=target)}, points = {points.tolist()};
    const m = clipMatrix(camera, {width}, {height});
    tell(points.map((p) => projected(camera, {width}, {height}, p)));
    const clip = (p, r) => m[r] * p[0] + m[4 + r] * p[1] + m[8 + r] * p[2] + m[12 + r];
    tell(points.map((p) => [0, 1, 2, 3].map((r) => clip(p, r))));
    tell(pixelSize(camera, {width}, {height}));
    """
    places, clips, pixel = run(code, "maths.js")
    e, a = np.radians([25.0, -60.0])
    towards = np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
    right = np.array([-np.sin(a), np.cos(a), 0.0])
    up = np.cross(towards, right)
    distance = 1.04 * 2.0 / np.sin(np.pi / 12)
    focal = zoom * 0.5 * min(width, height) / np.tan(np.pi / 12)
    arm = points - (np.array(target) + distance * towards)
    depth = -(arm @ towards)
    expected = np.stack(
        [width / 2 + focal * (arm @ right) / depth, height / 2 - focal * (arm @ up) / depth], axis=1
    )
    np.testing.assert_allclose(places, expected, rtol=1e-9)
    clips = np.array(clips)
    device = clips[:, :3] / clips[:, 3:]
    flat = np.stack([(device[:, 0] + 1) * width / 2, (1 - device[:, 1]) * height / 2], axis=1)
    np.testing.assert_allclose(flat, expected, atol=0.01)
    assert (np.abs(device[:, 2]) < 1.0).all()
    # nearer is smaller
    assert (np.diff(device[np.argsort(depth), 2]) > 0).all()
    assert pixel == pytest.approx(distance / focal)


@pytest.mark.parametrize("closed", [True, False])
def test_only_what_is_out_of_sight_is_left_out(tmp_path, closed):
    """Balls on a sphere, by brute force: what is left out faces away or is beside the window."""
    rng = np.random.default_rng(3)
    n = 3000
    axes = rng.standard_normal((n, 3))
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    radii, angles = rng.uniform(0.02, 0.3, n), rng.uniform(0.02, 0.5, n)
    balls = np.column_stack([2.0 * axes, radii])
    cones = np.column_stack([axes, np.cos(angles)])
    views = [
        ((25.0, -60.0), 1.2, WHOLE),
        ((70.0, 10.0), 4.0, WHOLE),
        ((-10.0, 100.0), 1.3, PIXEL),
    ]
    width, height = 500, 800
    for view, zoom, share in views:
        code = f"""
        const camera = {camera(view=view, zoom=zoom)};
        const parts = {{ balls: {balls.ravel().tolist()}, cones: {cones.ravel().tolist()} }};
        tell(partsInSight(camera, {width}, {height}, parts, {json.dumps(closed)}, {list(share)}));
        tell(lens(camera, {width}, {height}));
        """
        runs, lens = run(code, "maths.js")
        assert all(a < b for a, b in runs)
        assert all(one[1] < two[0] for one, two in pairwise(runs))
        drawn = np.zeros(n, dtype=bool)
        for first, last in runs:
            drawn[first:last] = True
        # points on each ball, each with a normal in its cone
        m = 200
        inside = rng.standard_normal((m, 3))
        inside /= np.linalg.norm(inside, axis=1, keepdims=True)
        points = balls[:, None, :3] + radii[:, None, None] * inside
        aside = rng.standard_normal((n, m, 3))
        aside -= np.einsum("nmi,ni->nm", aside, axes)[..., None] * axes[:, None]
        aside /= np.linalg.norm(aside, axis=2, keepdims=True)
        tilt = angles[:, None, None] * rng.uniform(0, 1, (n, m, 1)) ** 0.2
        normals = np.cos(tilt) * axes[:, None] + np.sin(tilt) * aside
        e, a = np.radians(view)
        towards = np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
        right = np.array([-np.sin(a), np.cos(a), 0.0])
        arm = points - np.array(lens["eye"])
        depth = -(arm @ towards)
        x = arm @ right / (lens["across"] * depth)
        y = arm @ np.cross(towards, right) / (lens["upright"] * depth)
        seen = (share[0] < x) & (x < share[1]) & (share[2] < y) & (y < share[3])
        if closed:
            seen &= np.einsum("nmi,nmi->nm", normals, arm) < 0.0
        assert not (seen.any(axis=1) & ~drawn).any()
        # and little is drawn in vain
        assert drawn.sum() <= 1.35 * seen.any(axis=1).sum() + 6


def test_a_drag_takes_the_near_side_along():
    code = """
    const camera = new Camera([0, 0, 0], 2, { elevation: 25, azimuth: -60 });
    const w = 900, h = 700, near = camera.axes[2].map((x) => 2 * x);
    const before = projected(camera, w, h, near);
    camera.turn(12, 7, w, h);
    const after = projected(camera, w, h, near);
    tell([after[0] - before[0], after[1] - before[1]]);
    tell(camera.axes);
    camera.home();
    const fixed = [0.5, 0.3, -0.2], start = projected(camera, w, h, fixed);
    camera.move(30, -20, w, h);
    const moved = projected(camera, w, h, fixed);
    tell([moved[0] - start[0], moved[1] - start[1]]);
    camera.home();
    const depth = [0, 1, 2].map((k) => 0.4 * camera.axes[0][k] + 0.3 * camera.axes[1][k]);
    const [x, y] = projected(camera, w, h, depth);
    camera.zoomBy(3, x - w / 2, y - h / 2, w, h);
    const again = projected(camera, w, h, depth);
    tell([again[0] - x, again[1] - y]);
    camera.faceTo([1, 1, 1], [3, 3, 3]);
    tell(camera.axes);
    """
    turned, axes, moved, fixed, faced = run(code, "maths.js", "gestures.js")
    np.testing.assert_allclose(np.array(turned) / [12, 7], (np.array(turned) / [12, 7])[0], rtol=1e-2)
    assert 0.8 < turned[0] / 12 < 2.5
    np.testing.assert_allclose(np.array(axes) @ np.transpose(axes), np.eye(3), atol=1e-12)
    assert np.linalg.det(axes) == pytest.approx(1.0)
    np.testing.assert_allclose(moved, [30, -20], rtol=0.2)
    np.testing.assert_allclose(fixed, 0.0, atol=1e-6)
    np.testing.assert_allclose(faced[2], np.ones(3) / np.sqrt(3), atol=1e-12)
    assert np.linalg.det(faced) == pytest.approx(1.0)


def test_numbers_for_readers():
    code = "tell([0, -3, 1234567, 0.1234567891, 1.23456789e-5, 5.5e9, NaN, -2.5, 123456.7].map(written));"
    (told,) = run(code, "maths.js")
    assert told == ["0", "−3", "1234567", "0.123457", "1.2346e−5", "5500000000", "–", "−2.5", "123457"]


def test_legend_counts_are_the_foams(tmp_path):
    foam = torus_foam()
    charges, rgb = foam.network.charges, np.zeros((foam.n_bubbles, 3), dtype=int)
    code = f"""
    globalThis.document = {{}};
    tell(counted({charges.tolist()}, {rgb.ravel().tolist()}, {foam.network.bubble_euler.tolist()}));
    tell(counted([1, 0, 1, 5], Array(12).fill(7), [1, 1, 1, 0]));
    """
    torus, mixed = run(code, "maths.js", "panel.js")
    assert [(row["value"], row["bubbles"]) for row in torus] == [(0, foam.n_bubbles)]
    assert [(row["value"], row["bubbles"]) for row in mixed] == [(0, 1), (1, 2)]
