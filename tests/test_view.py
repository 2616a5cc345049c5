"""The viewer's file: what is in it is the foam, and what cannot be shown is refused."""

from __future__ import annotations

import json
import re
from collections import Counter
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import warpedfoam as wf
from warpedfoam.cli.app import app
from warpedfoam.io.colours import COLOR_CHOICES, bubble_colours
from warpedfoam.io.patches import bubble_patches
from warpedfoam.plot import painting, projection
from warpedfoam.view.chunks import in_chunks, parts_of_bubbles
from warpedfoam.view.document import SCRIPTS
from warpedfoam.view.frames import packed, unpacked
from warpedfoam.view.geometry import OWN_IMAGE, WALL, detail, geometry
from warpedfoam.view.scalars import bubble_scalars

from .io_foams import bubble_on_torus, lone_bubble, sphere_foam, torus_foam, with_pressures
from .test_docs import run

PAGE = Path(wf.__file__).parent / "view" / "page"


def rimmed(n_bubbles=30):
    """The upper half of a sphere."""
    dome = wf.Revolution(lambda z: 1.0 - z**2, lambda z: -2.0 * z, 0.0, 1.0)
    return wf.voronoi_foam(wf.HeleShawCell(dome, gap=0.01), n_bubbles=n_bubbles, seed=1, lloyd=2)


def repeating(n_bubbles=24):
    return wf.voronoi_foam(wf.HeleShawCell(wf.FlatTorus(6.0, 4.0), gap=0.1), n_bubbles=n_bubbles, seed=2)


def read_page(path):
    """Facts and arrays of each frame, positions in space."""
    text = path.read_text(encoding="utf-8")
    (raw,) = re.findall(r'<script type="application/json" id="facts">(.*?)</script>', text, re.DOTALL)
    facts = json.loads(raw)
    low, side = np.array(facts["cube"]["low"]), facts["cube"]["side"]
    frames = []
    for k, frame in enumerate(facts["frames"]):
        (blob,) = re.findall(rf'id="frame-{k}">(.*?)</script>', text)
        arrays = unpacked(frame["layout"], blob)
        for name in list(arrays):
            part = name.split(":")[-1]
            if part in ("points", "line_points"):
                arrays[name] = low + side * arrays[name].reshape(-1, 4)[:, :3] / 65535.0
            if part in ("triangles", "segments", "beside", "pairs"):
                rows = 3 if part == "triangles" else 2
                arrays[name] = np.cumsum(arrays[name].reshape(rows, -1), axis=1).T
            if part == "owner":
                arrays[name] = np.cumsum(arrays[name])
        frames.append(arrays)
    return facts, frames


# ------------------------------------------------------------------ the file


def test_the_file_holds_the_foam(tmp_path):
    foam = with_pressures(sphere_foam(50))
    facts, (arrays,) = read_page(wf.write_view(tmp_path / "v.html", foam))
    np.testing.assert_array_equal(arrays["ids"], foam.bubble_ids)
    np.testing.assert_array_equal(arrays["value:area"], foam.bubble_areas)
    np.testing.assert_array_equal(arrays["value:volume"], foam.bubble_volumes)
    np.testing.assert_array_equal(arrays["value:pressure"], foam.pressures)
    np.testing.assert_array_equal(arrays["value:sides"], foam.network.sides)
    np.testing.assert_array_equal(arrays["targets"], foam.target_volumes)
    # a sphere of radius 2
    np.testing.assert_allclose(arrays["value:curvature"], 0.25, rtol=1e-9)
    np.testing.assert_array_equal(arrays["pairs"], np.stack([foam.network.left, foam.network.right], axis=1))
    assert facts["frames"][0]["energy"] == foam.energy


@pytest.mark.parametrize(
    "foam", [sphere_foam(400, even=True), torus_foam(), bubble_on_torus(), rimmed(), repeating()]
)
def test_triangles_cover_the_surface_once(tmp_path, foam):
    """At every degree of detail the areas of the bubbles' triangles are those of the bubbles."""
    facts, (arrays,) = read_page(wf.write_view(tmp_path / "v.html", foam))
    known = foam.network.bubble_euler == 1
    pieces, rings = detail(foam.n_bubbles)
    busy = foam.n_bubbles > 300 or 2 * foam.network.n_films * pieces * (2 * rings - 1) > 30_000
    assert facts["frames"][0]["meshes"] == (2 if busy else 1)
    assert facts["frames"][0]["pieces"] == [pieces, 2 if foam.n_bubbles > 300 else 4][: 1 + busy]
    for k in range(facts["frames"][0]["meshes"]):
        points, triangles = arrays[f"mesh{k}:points"], arrays[f"mesh{k}:triangles"]
        owner = arrays[f"mesh{k}:owner"]
        a, b, c = (points[triangles[:, j]] for j in range(3))
        normals = arrays[f"mesh{k}:normals"].reshape(-1, 4)[:, :3] / 127.0
        signed = 0.5 * np.einsum("ti,ti->t", np.cross(b - a, c - a), normals[triangles[:, 1]])
        areas = np.bincount(owner[triangles[:, 0]], signed, foam.n_bubbles)
        # flat triangles are smaller than the patch, and 8-bit normals are off by half a percent
        np.testing.assert_allclose(areas[known], foam.bubble_areas[known], rtol=0.05 if k == 0 else 0.15)


def test_film_pieces_are_the_films(tmp_path):
    """Lengths of the pieces beside each bubble, against the films' own lengths; on the surface."""
    foam = with_pressures(sphere_foam(40))
    _, (arrays,) = read_page(wf.write_view(tmp_path / "v.html", foam))
    points, segments, beside = (arrays[f"mesh0:{name}"] for name in ("line_points", "segments", "beside"))
    pieces = np.linalg.norm(points[segments[:, 1]] - points[segments[:, 0]], axis=1)
    network = foam.network
    for side, owners in ((0, network.left), (1, network.right)):
        drawn = np.bincount(beside[:, side], pieces, foam.n_bubbles)
        np.testing.assert_allclose(drawn, np.bincount(owners, foam.film_lengths, foam.n_bubbles), rtol=2e-3)
    np.testing.assert_allclose(np.linalg.norm(points, axis=1), 2.0, rtol=1e-4)


def test_walls_are_drawn_once_round_the_rim():
    foam = rimmed()
    drawn = geometry(foam, 12, 6)
    wall = drawn.beside[:, 1] == WALL
    ends = drawn.line_points[drawn.segments[wall]]
    # the unit circle
    assert np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).sum() == pytest.approx(2 * np.pi, rel=5e-3)
    np.testing.assert_allclose(ends[..., 2], 0.0, atol=1e-8)
    assert set(drawn.beside[wall, 0]) == set(foam.walls.bubble)
    assert set(np.bincount(drawn.segments[wall].ravel())) <= {0, 1, 2}


def test_bubbles_over_the_edge_have_their_own_films():
    """Where the surface repeats each bubble is drawn whole, with images of its films at its own rim."""
    foam = repeating()
    drawn = geometry(foam, 8, 4)
    assert (drawn.beside[:, 1] == OWN_IMAGE).all()
    assert len(drawn.segments) == 2 * foam.network.n_films * 8
    for bubble in range(foam.n_bubbles):
        patch = drawn.points[drawn.owner == bubble]
        ends = drawn.line_points[drawn.segments[drawn.beside[:, 0] == bubble].ravel()]
        gaps = np.linalg.norm(ends[:, None] - patch[None], axis=2).min(axis=1)
        assert gaps.max() < 1e-9


def test_sunk_triangles_lie_on_the_surface_with_their_depth():
    foam = bubble_on_torus()
    drawn = geometry(foam, 24, 10)
    low = drawn.sunk > 0.0
    assert set(drawn.owner[low]) == {1}
    np.testing.assert_allclose(foam.cell.surface.project(drawn.points), drawn.points, atol=1e-9)
    where_they_were = drawn.points - drawn.sunk[:, None] * drawn.normals
    np.testing.assert_allclose(
        where_they_were, bubble_patches(foam, curve_points=25, rings=10).points, atol=1e-9
    )


def test_the_file_is_one_and_the_same(tmp_path):
    foam = sphere_foam(20)
    one, two = (wf.write_view(tmp_path / name, foam).read_bytes() for name in ("a.html", "b.html"))
    assert one == two


class Links(HTMLParser):
    """Everything that a page would fetch, and the ids of its elements."""

    def __init__(self) -> None:
        super().__init__()
        self.found: list[str] = []
        self.ids: Counter[str] = Counter()
        self.labels: set[str] = set()
        self.open: list[str] = []

    def handle_starttag(self, tag, attrs):
        given = dict(attrs)
        self.found += [given[name] for name in ("src", "href", "srcset", "data", "action") if given.get(name)]
        if "id" in given:
            self.ids[given["id"]] += 1
        if tag == "label":
            self.labels.add(given.get("for", ""))
        if tag not in ("meta", "link", "input", "path", "circle"):
            self.open.append(tag)

    def handle_endtag(self, tag):
        if tag not in ("path", "circle", "input"):
            assert self.open.pop() == tag


def test_the_page_is_whole_and_fetches_nothing(tmp_path):
    text = wf.write_view(tmp_path / "v.html", [sphere_foam(12), lone_bubble()]).read_text(encoding="utf-8")
    parser = Links()
    parser.feed(text)
    assert parser.open == []
    assert parser.found == ["data:,"]  # the icon: none
    assert "default-src 'none'" in text
    assert not re.search(r"https?://|\bimport\(|\bfetch\(|XMLHttpRequest|WebSocket", text)
    assert max(parser.ids.values()) == 1
    asked = set(re.findall(r'byId\("([\w-]+)"\)', text))
    assert asked <= set(parser.ids)
    assert {"frame-0", "frame-1"} <= set(parser.ids)
    assert set(SCRIPTS) == {p.name for p in PAGE.glob("*.js")}


def test_a_title_stays_a_title(tmp_path):
    evil = "</script><script>alert('ü')</script>{{style}} & <b>"
    path = wf.write_view(tmp_path / "v.html", sphere_foam(12), title=evil)
    facts, _ = read_page(path)
    assert facts["title"] == evil
    assert "<script>alert" not in path.read_text(encoding="utf-8")


def test_packing_is_undone():
    rng = np.random.default_rng(0)
    arrays = {
        "a": rng.integers(0, 255, 7).astype(np.uint8),
        "b": rng.standard_normal((3, 2)),
        "c": rng.integers(-9, 9, (5, 3)).astype(np.int32),
        "d": np.zeros(0, dtype=np.float32),
    }
    layout, text = packed(arrays)
    assert all(start % 8 == 0 for _, _, start, _ in layout)
    for name, array in unpacked(layout, text).items():
        np.testing.assert_array_equal(array, arrays[name].ravel())


@pytest.mark.parametrize("foam", [sphere_foam(120), torus_foam(), bubble_on_torus(), rimmed(), repeating()])
def test_parts_hold_what_is_drawn(foam):
    """Each triangle and line piece in one part, inside its ball and its cone; the rest stays as it was."""
    normals = foam.cell.surface.normals(foam.bubble_centres)
    disks = foam.network.bubble_euler == 1
    part = parts_of_bubbles(foam.bubble_centres, normals, disks)
    assert (np.bincount(part) > 0).all()
    assert np.bincount(part[disks]).max() < 24
    assert set(part[~disks]).isdisjoint(part[disks])
    plain = geometry(foam, 6, 3)
    mesh, chunks = in_chunks(plain, part)
    order = np.lexsort(plain.triangles.T)
    np.testing.assert_array_equal(mesh.triangles[np.lexsort(mesh.triangles.T)], plain.triangles[order])
    pairs = [np.hstack([m.segments, m.beside]) for m in (plain, mesh)]
    np.testing.assert_array_equal(*(rows[np.lexsort(rows.T)] for rows in pairs))
    of_triangle = np.repeat(np.arange(part.max() + 1), np.diff(chunks.triangles))
    of_segment = np.repeat(np.arange(part.max() + 1), np.diff(chunks.segments))
    np.testing.assert_array_equal(of_triangle, part[mesh.owner[mesh.triangles[:, 0]]])
    np.testing.assert_array_equal(of_segment, part[mesh.beside[:, 0]])
    below = mesh.points - mesh.sunk[:, None] * mesh.normals
    for points, places, of in (
        (mesh.points, mesh.triangles, of_triangle),
        (below, mesh.triangles, of_triangle),
        (mesh.line_points, mesh.segments, of_segment),
    ):
        apart = np.linalg.norm(points[places] - chunks.balls[of, None, :3], axis=2)
        assert (apart <= chunks.balls[of, None, 3]).all()
    for normals, places, of in (
        (mesh.normals, mesh.triangles, of_triangle),
        (mesh.line_normals, mesh.segments, of_segment),
    ):
        assert (
            np.einsum("tki,ti->tk", normals[places], chunks.cones[of, :3]) >= chunks.cones[of, None, 3]
        ).all()


def test_many_bubbles_have_small_parts():
    """Two thousand bubbles: parts of a dozen or two, whose normals are within 15 degrees."""
    foam = sphere_foam(2000, even=True)
    normals = foam.cell.surface.normals(foam.bubble_centres)
    part = parts_of_bubbles(foam.bubble_centres, normals, np.ones(2000, dtype=bool))
    _, chunks = in_chunks(geometry(foam, 2, 1), part)
    assert len(chunks.balls) == 128
    assert np.degrees(np.arccos(chunks.cones[:, 3])).max() < 20.0


# ------------------------------------------------------------------ colours


# the colours of curvature reach as far as the surface's own, which the viewer shows too
@pytest.mark.parametrize("name", [name for name in COLOR_CHOICES if name != "curvature"])
@pytest.mark.parametrize("foam", [with_pressures(sphere_foam(60)), with_pressures(torus_foam())])
def test_colours_are_those_of_the_pictures(foam, name):
    scalars = {s.name: s for s in bubble_scalars([foam], [np.ones(1)])}
    expected = bubble_colours(foam, name)
    np.testing.assert_array_equal(scalars[name].rgb[0], expected.rgb)
    assert scalars[name].limits == expected.limits


def test_shading_is_that_of_the_pictures():
    """The shader repeats numbers of `plot`, which it cannot import."""
    text = (PAGE / "shaders.js").read_text(encoding="utf-8")
    painter = (PAGE / "painter.js").read_text(encoding="utf-8")
    assert f"mix(vec3({painting.BACK_GREY}), colour, {painting.BACK_SHARE})" in text
    assert f"{projection._AMBIENT} + {1 - projection._AMBIENT:.2f} * clamp" in text
    assert f"unit({projection._LIGHT.tolist()})" in painter


def test_colours_mean_the_same_in_all_frames():
    small, large = sphere_foam(30), sphere_foam(90)
    (area,) = [s for s in bubble_scalars([small, large], [np.ones(1)] * 2) if s.name == "area"]
    both = np.concatenate([small.bubble_areas, large.bubble_areas])
    assert area.limits == (both.min(), both.max())
    order = np.argsort(both)
    # from dark violet to yellow the green rises all the way
    assert (np.diff(np.concatenate(area.rgb)[order, 1].astype(int)) >= 0).all()


def test_curvature_diverges_about_zero():
    foam = torus_foam()
    g = foam.cell.surface.gaussian_curvature(geometry(foam, 6, 3).points)
    (mean,) = [s for s in bubble_scalars([foam], [g]) if s.name == "curvature"]
    low, high = mean.limits
    assert low == -high
    assert high == pytest.approx(np.abs(g).max())
    outer = mean.values[0] > 0.2 * high
    inner = mean.values[0] < -0.2 * high
    red, blue = mean.rgb[0][:, 0].astype(int), mean.rgb[0][:, 2].astype(int)
    assert (red > blue)[outer].all()
    assert (red < blue)[inner].all()
    assert outer.any()
    assert inner.any()


def test_what_an_exterior_has_not_is_not_shown(tmp_path):
    foam = bubble_on_torus()
    _, (arrays,) = read_page(wf.write_view(tmp_path / "v.html", foam))
    for name in ("area", "volume", "curvature"):
        np.testing.assert_array_equal(np.isnan(arrays[f"value:{name}"]), [False, True])
    np.testing.assert_array_equal(arrays["rgb:area"].reshape(-1, 3)[1], [0xC4, 0xC4, 0xC4])


def test_clusters_are_counted_and_seen_from_their_front(tmp_path):
    cell = wf.HeleShawCell(wf.Torus(3.0, 1.2), 0.1)
    foam = wf.cluster_foam(cell, 3, volumes=0.1, centre=[0.0, -4.2, 0.0])
    facts, _ = read_page(wf.write_view(tmp_path / "v.html", foam))
    assert facts["title"] == "3 bubbles, torus"
    assert facts["frames"][0]["held"] == 3
    e, a = np.radians([facts["view"]["elevation"], facts["view"]["azimuth"]])
    towards = np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
    held = np.delete(foam.bubble_centres, foam.exterior, axis=0)
    assert (cell.surface.normals(held) @ towards > 0.5).all()


def test_detail_falls_with_bubbles_and_frames():
    sizes = [np.prod(detail(n)) for n in (5, 50, 200, 900, 50_000)]
    assert (np.diff(sizes) < 0).all()
    assert np.prod(detail(200, 400)) < np.prod(detail(200))


# ------------------------------------------------------------------ refusals and the command


@pytest.mark.parametrize(
    ("arguments", "fault", "words"),
    [
        ({"foams": []}, ValueError, "at least one foam"),
        ({"foams": 3}, TypeError, "foams must be a Foam or a sequence"),
        ({"foams": "foam.npz"}, TypeError, "got str"),
        ({"foams": [lone_bubble(), None]}, TypeError, r"foams\[1\] must be a Foam"),
        ({"color_by": "taste"}, ValueError, "color_by"),
        ({"color_by": "pressure"}, ValueError, "relax them first"),
        ({"color_by": "gap"}, ValueError, "not parallel"),
        ({"title": 5}, TypeError, "title must be a string"),
        ({"labels": ["a", "b"]}, ValueError, "1 foams, 2 labels"),
        ({"labels": "a"}, TypeError, "labels must be a sequence"),
        ({"labels": [1]}, TypeError, r"labels\[0\]"),
        ({"path": "foam.png"}, ValueError, ".html"),
    ],
)
def test_refusals(tmp_path, arguments, fault, words):
    given = {"path": "v.html", "foams": lone_bubble(), **arguments}
    with pytest.raises(fault, match=words):
        wf.write_view(tmp_path / given.pop("path"), **given)
    assert list(tmp_path.iterdir()) == []


def test_command(tmp_path):
    one, two = sphere_foam(12), sphere_foam(14)
    files = [str(wf.save(tmp_path / f"{n}.npz", foam)) for n, foam in (("first", one), ("second", two))]
    done = CliRunner().invoke(app, ["view", files[0], "--json"])
    assert done.exit_code == 0, done.output
    assert json.loads(done.stdout)["bubbles"] == [12]
    assert (tmp_path / "first.html").exists()
    target = tmp_path / "both.html"
    done = CliRunner().invoke(app, ["view", *files, "-o", str(target), "--color-by", "area"])
    assert done.exit_code == 0, done.output
    assert "both.html" in done.stdout.replace("\n", "")
    facts, frames = read_page(target)
    assert [frame["label"] for frame in facts["frames"]] == ["first", "second"]
    assert [len(arrays["ids"]) for arrays in frames] == [12, 14]
    assert facts["colorBy"] == "area"


@pytest.mark.parametrize("extra", [["--color-by", "pressure"], ["-o", "foam.png"], ["-o", "no/such/v.html"]])
def test_command_refuses_in_one_line(tmp_path, extra):
    file = str(wf.save(tmp_path / "foam.npz", sphere_foam(12)))
    done = CliRunner().invoke(app, ["view", file, *extra])
    assert done.exit_code == 2
    assert done.stderr.startswith("warpedfoam: ")
    assert len(done.stderr.splitlines()) == 1


def test_the_page_of_the_docs(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    space = run(Path(__file__).parents[1] / "docs" / "viewer.md")
    facts, frames = read_page(space["two"])
    assert facts["title"] == "120 bubbles, torus"
    assert [frame["label"] for frame in facts["frames"]] == ["Voronoi cells", "relaxed"]
    assert "value:pressure" not in frames[1]  # the first frame has none
    assert "value:pressure" in read_page(space["one"])[1][0]
