"""Reading, judging, mending and writing meshes."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from warpedfoam import HeleShawCell, MeshSurface, Sphere, Torus
from warpedfoam.errors import MeshError
from warpedfoam.io import write_mesh
from warpedfoam.surfaces import FlatTorus, TriangleMesh, mesh_report, read_mesh, repaired
from warpedfoam.surfaces.level import LevelSurface

from .mesh_mutations import MUTATIONS, base
from .scrambled_files import FORMATS

NODES, TRIANGLES = base("sphere")
BALL = TriangleMesh(NODES, TRIANGLES)


@pytest.fixture(autouse=True)
def quick(monkeypatch):
    """Integrals over the given mesh are fine enough here."""
    monkeypatch.setattr(LevelSurface, "integral_nodes", 300)


def mutated(name, shape="sphere", seed=0):
    return TriangleMesh(*MUTATIONS[name][0](*base(shape), np.random.default_rng(seed)))


def faults(mesh, **asked):
    return {f.fault: f for f in mesh_report(mesh, **asked).findings}


# ---------------------------------------------------------------------------- findings


def test_nothing_is_wrong_with_a_sound_mesh():
    report = mesh_report(BALL)
    assert report.findings == ()
    assert report.sound
    assert (report.n_nodes, report.n_triangles, report.components, report.rims) == (252, 500, 1, 0)
    assert report.euler_characteristic == 2
    assert report.area == pytest.approx(4 * np.pi, rel=0.02)
    assert report.curvature_range == pytest.approx((1.0, 1.0), abs=0.05)
    assert 40.0 < report.least_angle < 60.0


FINDINGS = {
    "spare_node": ("nodes without triangles", 3, True, "node 252"),
    "repeat_corner": ("triangles that use a node twice", 1, True, "triangle"),
    "twin_node": ("nodes at the same place", 2, False, "node"),
    "twice": ("triangles that occur twice", 3, True, "triangle"),
    "needle": ("triangles without area", 6, True, "triangle"),
    "cap": ("slivers (an angle below 5 degrees)", 1, False, "triangle"),
    "fin": ("edges with more than two triangles", 1, True, "edge at node"),
    "cut_node": ("open edges", 6, False, "edge at node"),
    "apart": ("separate components", 2, True, "252 nodes"),
    "kissing": ("not a manifold", 1, True, "node"),
    "inside_out": ("inside out", 1, False, "everywhere"),
    "spike": ("no smooth surface", 1, True, "nodes"),
    "immense": ("out of scale or place", 1, True, "everywhere"),
    "point": ("out of scale or place", 1, True, "everywhere"),
    "far_off": ("out of scale or place", 1, True, "everywhere"),
    "pillow": ("triangles that occur twice", 1, True, "triangle"),
}


@pytest.mark.parametrize("name", FINDINGS)
def test_every_fault_is_found(name):
    fault, count, fatal, where = FINDINGS[name]
    mesh = mutated(name)
    report = mesh_report(mesh)
    found = {f.fault: f for f in report.findings}
    assert fault in found
    assert (found[fault].count, found[fault].fatal) == (count, fatal)
    assert where in found[fault].where
    assert len(found[fault].advice) > 5
    if report.sound:
        MeshSurface(mesh.nodes, mesh.triangles)
    else:
        with pytest.raises(MeshError):
            MeshSurface(mesh.nodes, mesh.triangles)


def test_one_turned_triangle_is_three_edges():
    triangles = TRIANGLES.copy()
    triangles[7] = triangles[7, ::-1]
    found = faults(TriangleMesh(NODES, triangles))
    assert list(found) == ["triangles turned against a neighbour"]
    assert found["triangles turned against a neighbour"].count == 3


def test_places_are_given_in_space():
    nodes, where = np.concatenate([NODES, [[1.0, 2.0, 3.5]]]), "node 252 at (1, 2, 3.5)"
    assert faults(TriangleMesh(nodes, TRIANGLES))["nodes without triangles"].where == where
    triangles = np.delete(TRIANGLES, (TRIANGLES == 9).any(axis=1).nonzero()[0], axis=0)
    found = mesh_report(TriangleMesh(NODES, triangles))
    assert (found.rims, found.euler_characteristic) == (1, 1)


def test_a_crease_is_noted():
    box = trimesh.creation.box((2.0, 2.0, 2.0)).subdivide().subdivide()
    found = faults(TriangleMesh(box.vertices, box.faces))
    assert found["creases (over 60 degrees)"].count == 12 * 4
    assert not found["creases (over 60 degrees)"].fatal


def test_plates_fold_by_the_rule_of_the_cell():
    mesh = Torus(3.0, 1.0).triangulate(900)
    surface = MeshSurface(mesh.nodes, mesh.triangles)
    limit = -1.0 / surface.curvature_range()[0]
    for gap in (0.999 * limit, limit, 1.001 * limit):
        fatal = any(f.startswith("plates fold") for f in faults(mesh, gap=gap))
        try:
            HeleShawCell(surface, gap=gap)
        except ValueError:
            assert fatal
        else:
            assert not fatal
    advice = faults(mesh, gap=5.0)["plates fold at gap 5"].advice
    assert f"{limit:.3g}" in advice


def test_coarse_for_the_gap_or_the_bubbles():
    mesh = Torus(2.0, 1.0).triangulate(200)
    assert "coarse for gap 0.2" in faults(mesh, gap=0.2)
    assert "a finer one" in faults(mesh, gap=0.5)["plates fold at gap 0.5"].advice
    assert "coarse for gap 0.01" not in faults(mesh, gap=0.01)
    fine = Torus(2.0, 1.0).triangulate(2000)
    found = faults(fine, gap=0.5, n_bubbles=10)
    assert not any(f.startswith("coarse") for f in found)
    finding = faults(BALL, n_bubbles=60)["coarse for 60 bubbles"]
    assert not finding.fatal
    enough = int(finding.advice.split(" nodes")[0].split()[-1])
    # as many nodes as it names are enough, and not many fewer
    assert "coarse for 60 bubbles" not in faults(Sphere(1.0).triangulate(int(1.15 * enough)), n_bubbles=60)
    assert "coarse for 60 bubbles" in faults(Sphere(1.0).triangulate(int(0.8 * enough)), n_bubbles=60)


@pytest.mark.parametrize("shift", [1.05, 1.3, 1.6])
def test_a_surface_that_crosses_itself_is_refused(shift):
    mesh = Torus(2.0, 1.0).triangulate(900)
    nodes, q = mesh.nodes.copy(), np.hypot(mesh.nodes[:, 0], mesh.nodes[:, 1])
    nodes[:, :2] *= ((q - shift) / q)[:, None]
    assert "no smooth surface" in faults(TriangleMesh(nodes, mesh.triangles))
    with pytest.raises(MeshError, match="crosses itself"):
        MeshSurface(nodes, mesh.triangles)


def test_bad_calls_of_the_report():
    with pytest.raises(TypeError, match="mesh must be a TriangleMesh"):
        mesh_report(NODES)
    with pytest.raises(ValueError, match="gap must be greater than 0"):
        mesh_report(BALL, gap=0.0)
    with pytest.raises(TypeError, match="n_bubbles must be an integer"):
        mesh_report(BALL, n_bubbles=2.5)
    with pytest.raises(MeshError, match="repeats in space"):
        mesh_report(FlatTorus(1.0, 1.0).triangulate(100))


# ---------------------------------------------------------------------------- repairs

REPAIRS = {
    "spare_node": ("dropped 3 unused nodes",),
    "repeat_corner": ("dropped 1 triangle", "closed 1 hole"),
    "twin_node": ("merged 1 node",),
    "soup": (f"merged {1500 - 252} nodes",),
    "twice": ("dropped 3 triangles",),
    "collapse": ("merged 1 node", "dropped 2 triangles"),
    "needle": ("merged 3 nodes", "dropped 6 triangles"),
    "apart": ("dropped 1 component (50 % of the triangles)",),
    "fin": ("dropped 1 component (0.2 % of the triangles)",),
    "kissing": ("dropped 1 component (50 % of the triangles)",),
    "inside_out": ("turned the mesh outwards",),
    "flip": ("turned 25 triangles",),
}


@pytest.mark.parametrize("scale", [1.0, 1e-12, 1e9])
@pytest.mark.parametrize("name", REPAIRS)
def test_repairs_do_what_their_notes_say(name, scale):
    mesh = mutated(name)
    mesh = TriangleMesh(scale * mesh.nodes, mesh.triangles)
    mended, done = repaired(mesh)
    # what is gone takes its nodes along, the notes need not say that twice
    assert done == REPAIRS[name]
    assert mesh_report(mended).sound
    assert mended.euler_characteristic == 2
    # shape is left alone: each node is one that was there, and the triangles face outwards
    assert set(map(tuple, mended.nodes)) <= set(map(tuple, mesh.nodes))
    area = Sphere(1.0).triangulate(300).area * scale**2
    assert mended.area == pytest.approx(area, rel=0.02 if done[0].startswith("merged") else 1e-6)
    again, nothing = repaired(mended)
    assert nothing == ()
    np.testing.assert_array_equal(again.triangles, mended.triangles)
    np.testing.assert_array_equal(again.nodes, mended.nodes)


def test_the_larger_part_tells_which_way_is_round():
    triangles = TRIANGLES.copy()
    triangles[0] = triangles[0, ::-1]  # the one that winding starts from
    mended, done = repaired(TriangleMesh(NODES, triangles))
    assert done == ("turned 1 triangle",)
    assert faults(mended) == {}


def test_sheets_that_touch_are_left_apart():
    """Two nodes at one place, each in the middle of its own sheet, are sound and stay two."""
    nodes = NODES.copy()
    nodes[0] = nodes[200] = 0.5 * (nodes[0] + nodes[200])
    _, done = repaired(TriangleMesh(nodes, TRIANGLES))
    assert not any(text.startswith("merged") for text in done)


@pytest.mark.parametrize("name", ["cut_node", "cap_flat", "spike", "immense", "cut_half"])
def test_what_needs_judgement_is_left_alone(name):
    mended, _ = repaired(mutated(name) if name != "cap_flat" else flat_cap())
    found = mesh_report(mended)
    if name == "cut_node":
        # a rim may be meant: it stays, and is noted
        assert found.sound
        assert found.rims == 1
        assert found.findings[0].fault == "open edges"
    else:
        assert not found.sound


def flat_cap():
    """A triangle split at a point on one of its edges."""
    a, b, c = TRIANGLES[0]
    new = len(NODES)
    split = np.array([[a, b, new], [b, c, new], [c, a, new]])
    middle = 0.5 * (NODES[a] + NODES[b])
    return TriangleMesh(np.vstack([NODES, middle]), np.concatenate([TRIANGLES[1:], split]))


def test_nothing_left():
    with pytest.raises(MeshError, match="nothing is left"):
        repaired(TriangleMesh(NODES, [[0, 0, 1]]))


# ---------------------------------------------------------------------------- files


def test_written_meshes_are_read_back_bit_for_bit(tmp_path):
    nodes = NODES + np.pi * 1e-9
    path = write_mesh(tmp_path / "m.ply", TriangleMesh(nodes, TRIANGLES))
    back = read_mesh(path)
    np.testing.assert_array_equal(back.nodes, nodes)
    np.testing.assert_array_equal(back.triangles, TRIANGLES)
    with pytest.raises(ValueError, match=r"\.ply"):
        write_mesh(tmp_path / "m.stl", BALL)
    with pytest.raises(TypeError, match="TriangleMesh"):
        write_mesh(tmp_path / "n.ply", NODES)
    assert [p.name for p in tmp_path.iterdir()] == ["m.ply"]


@pytest.mark.parametrize("kind", FORMATS)
def test_all_formats_give_one_mesh(kind, tmp_path):
    ending, write = FORMATS[kind]
    path = tmp_path / f"m{ending.upper()}"
    path.write_bytes(write(NODES, TRIANGLES))
    found = read_mesh(path)
    assert (found.n_nodes, found.n_triangles) == (BALL.n_nodes, BALL.n_triangles)
    np.testing.assert_allclose(
        found.nodes[found.triangles], NODES[TRIANGLES], rtol=0.0, atol=1e-6 if "stl" in kind else 0.0
    )
    if "stl" not in kind:
        np.testing.assert_array_equal(found.triangles, TRIANGLES)  # the numbers of the file


CUBE = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=float)
QUADS = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]


def test_quadrilaterals_are_cut_in_two(tmp_path):
    ply = tmp_path / "cube.ply"
    ply.write_text(
        "ply\nformat ascii 1.0\nelement vertex 8\nproperty float x\nproperty float y\nproperty float z\n"
        "element face 6\nproperty list uchar int vertex_indices\nend_header\n"
        + "".join(f"{x:g} {y:g} {z:g}\n" for x, y, z in CUBE)
        + "".join(f"4 {a} {b} {c} {d}\n" for a, b, c, d in QUADS)
    )
    obj = tmp_path / "cube.obj"
    obj.write_text(
        "".join(f"v {x:g} {y:g} {z:g}\n" for x, y, z in CUBE)
        + "".join("f " + " ".join(str(i + 1) for i in quad) + "\n" for quad in QUADS)
    )
    for path in (ply, obj):
        mesh = read_mesh(path)
        assert (mesh.n_nodes, mesh.n_triangles) == (8, 12)
        assert mesh.area == pytest.approx(6.0)
        mesh.require_surface(closed=True)


def test_textured_obj_with_seams_is_one_closed_mesh(tmp_path):
    """Each corner with a texture point and a normal of its own, in two objects and groups."""
    path = tmp_path / "ball.obj"
    half = len(TRIANGLES) // 2
    lines = ["mtllib missing.mtl", "o first"]
    lines += ["v {:.17g} {:.17g} {:.17g}".format(*p) for p in NODES]
    for i in range(len(TRIANGLES)):
        lines += [f"vt {i / 500:.4f} 0.{k}" for k in range(3)] + [f"vn 0 0 {1 if i % 2 else -1}"]
    lines += ["usemtl red"]
    for i, row in enumerate(TRIANGLES):
        if i == half:
            lines += ["o second", "g lid", "usemtl blue", "s off"]
        lines.append("f " + " ".join(f"{a + 1}/{3 * i + k + 1}/{i + 1}" for k, a in enumerate(row)))
    path.write_text("\n".join(lines) + "\n")
    mesh = read_mesh(path)
    assert (mesh.n_nodes, mesh.n_triangles) == (252, 500)
    mesh.require_surface(closed=True)


def test_glb_scene_is_joined_as_it_is_placed(tmp_path):
    ball = trimesh.Trimesh(NODES, TRIANGLES, process=False)
    scene = trimesh.Scene()
    scene.add_geometry(ball)
    scene.add_geometry(ball, transform=trimesh.transformations.translation_matrix([5.0, 0.0, 0.0]))
    path = tmp_path / "two.glb"
    path.write_bytes(scene.export(file_type="glb"))
    mesh = read_mesh(path)
    assert np.ptp(mesh.nodes[:, 0]) == pytest.approx(5.0 + np.ptp(NODES[:, 0]), rel=1e-6)
    found = faults(mesh)
    assert list(found) == ["separate components"]
    assert repaired(mesh)[0].n_nodes == 252


@pytest.mark.parametrize(
    ("name", "content", "text"),
    [
        ("a.ply", None, "there is no such file"),
        ("a.vtk", b"x", "not as .vtk"),
        ("a", b"x", "not as nothing"),
        ("a.ply", b"", "it is empty"),
        ("a.ply", b"no", "it is damaged or cut short, or no PLY mesh"),
        ("a.ply", FORMATS["ply"][1](NODES, TRIANGLES)[:-2000], "promises 252 nodes and 500 faces"),
        ("a.off", FORMATS["off"][1](NODES, TRIANGLES)[:-200], "cut short"),
        ("a.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\n", "no"),
        ("a.ply", FORMATS["ply"][1](NODES * np.nan, TRIANGLES), "nodes must be finite, but"),
        ("a.ply", FORMATS["ply"][1](NODES[:9], TRIANGLES), "triangles must be at least 0 and below 9"),
    ],
)  # fmt: skip
def test_files_that_cannot_be_read_say_why(name, content, text, tmp_path):
    path = tmp_path / name
    if content is not None:
        path.write_bytes(content)
    with pytest.raises((MeshError, FileNotFoundError), match=text) as caught:
        read_mesh(path)
    assert str(path) in str(caught.value)
    assert str(caught.value).isprintable()


def test_no_path_and_no_file(tmp_path):
    with pytest.raises(TypeError, match="path must be a file name"):
        read_mesh(3)
    with pytest.raises(MeshError, match="it is not a file"):
        read_mesh(tmp_path)
