"""PLY files and the patches they hold, read back by other programs."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh

from warpedfoam import Foam
from warpedfoam.io import write_ply
from warpedfoam.io.colours import bubble_colours, charge_rgb
from warpedfoam.io.patches import Patches, bubble_patches

from .io_foams import bubble_on_torus, lone_bubble, sphere_foam, torus_foam, with_pressures

FOAMS = {
    "sphere": lambda: with_pressures(sphere_foam(40)),
    "torus": torus_foam,
    "few": lambda: sphere_foam(4, even=True),
}


@pytest.fixture(params=list(FOAMS))
def foam(request: pytest.FixtureRequest) -> Foam:
    return FOAMS[request.param]()


def _elements(path: Path) -> dict[str, tuple[list[str], list[list[str]]]]:
    """Property names and rows of each element of an ASCII PLY."""
    lines = path.read_text(encoding="ascii").splitlines()
    end = lines.index("end_header")
    counts: dict[str, int] = {}
    names: dict[str, list[str]] = {}
    for line in lines[:end]:
        words = line.split()
        if words[0] == "element":
            counts[words[1]], names[words[1]] = int(words[2]), []
        elif words[0] == "property":
            names[list(names)[-1]].append(words[-1])
    out, at = {}, end + 1
    for name, count in counts.items():
        out[name] = names[name], [line.split() for line in lines[at : at + count]]
        at += count
    assert at == len(lines)
    return out


def _patch_areas(patches: Patches, n_bubbles: int) -> np.ndarray:
    a, b, c = (patches.points[patches.triangles[:, k]] for k in range(3))
    area = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)
    return np.bincount(patches.triangle_bubble, area, minlength=n_bubbles)


class TestNetworkFile:
    def test_elements_in_the_dialect_all_readers_share(self, tmp_path: Path, foam: Foam) -> None:
        path, view = write_ply(tmp_path / "foam.ply", foam, curve_points=5)
        assert view == tmp_path / "foam_view.ply"
        elements = _elements(path)
        assert list(elements) == ["vertex", "face", "edge"]
        network = foam.network
        assert len(elements["vertex"][1]) == network.n_vertices + 3 * network.n_films
        assert len(elements["face"][1]) == network.n_bubbles
        assert len(elements["edge"][1]) == 4 * network.n_films
        for names, _ in elements.values():
            assert len(set(names)) == len(names)
        assert elements["edge"][0][:2] == ["vertex1", "vertex2"]
        assert elements["face"][0][:4] == ["vertex_indices", "red", "green", "blue"]
        assert ("pressure" in elements["face"][0]) == (foam.pressures is not None)

    def test_values_to_the_last_bit(self, tmp_path: Path) -> None:
        foam = with_pressures(sphere_foam(40))
        elements = _elements(write_ply(tmp_path / "foam.ply", foam, curve_points=5)[0])
        points = np.array(elements["vertex"][1], dtype=float)
        n = foam.network.n_vertices
        np.testing.assert_array_equal(points[:n], foam.vertex_points)
        np.testing.assert_array_equal(points[n:], foam.film_curves(5)[:, 1:-1].reshape(-1, 3))
        names, rows = elements["face"]
        tails = [dict(zip(names[1:], row[int(row[0]) + 1 :], strict=True)) for row in rows]
        for name, values in (
            ("area", foam.bubble_areas),
            ("volume", foam.bubble_volumes),
            ("pressure", foam.pressures),
            ("sides", foam.network.sides),
            ("charge", foam.network.charges),
            ("bubble", foam.bubble_ids),
        ):
            assert [float(t[name]) for t in tails] == values.tolist()
        assert [4 * int(t["sides"]) for t in tails] == [int(row[0]) for row in rows]
        rgb = np.array([[int(t[c]) for c in ("red", "green", "blue")] for t in tails])
        np.testing.assert_array_equal(rgb, charge_rgb(foam.network.charges))

    def test_edges_run_along_films_between_their_bubbles(self, tmp_path: Path) -> None:
        foam = with_pressures(torus_foam())
        elements = _elements(write_ply(tmp_path / "foam.ply", foam, curve_points=3)[0])
        faces = {int(row[-1]): [int(v) for v in row[1 : 1 + int(row[0])]] for row in elements["face"][1]}
        sides = {i: set(zip(loop, loop[1:] + loop[:1], strict=True)) for i, loop in faces.items()}
        lengths = np.zeros(foam.network.n_films)
        for row in elements["edge"][1]:
            a, b, film, left, right = map(int, row[:5])
            assert (a, b) in sides[left]
            assert (b, a) in sides[right]
            lengths[film] = float(row[5])
        assert lengths.tolist() == foam.film_lengths.tolist()

    def test_polygons_are_counter_clockwise_from_outside(self, tmp_path: Path, foam: Foam) -> None:
        elements = _elements(write_ply(tmp_path / "foam.ply", foam)[0])
        points = np.array(elements["vertex"][1], dtype=float)
        for row, centre in zip(elements["face"][1], foam.bubble_centres, strict=True):
            loop = points[[int(v) for v in row[1 : 1 + int(row[0])]]] - centre
            vector = np.cross(loop, np.roll(loop, -1, axis=0)).sum(axis=0)
            assert vector @ foam.cell.surface.normals(centre[None])[0] > 0

    def test_polygons_of_many_corners_are_cut(self, tmp_path: Path) -> None:
        foam = sphere_foam(8)
        path, _ = write_ply(tmp_path / "foam.ply", foam, curve_points=120)
        rows = _elements(path)["face"][1]
        assert max(int(row[0]) for row in rows) <= 255
        assert len(rows) > 8
        loops = [[int(v) for v in row[1 : 1 + int(row[0])]] for row in rows]
        sides = [side for loop in loops for side in zip(loop, loop[1:] + loop[:1], strict=True)]
        assert len(set(sides)) == len(sides)
        assert {(b, a) for a, b in sides} == set(sides)  # no gap
        assert {int(row[-1]) for row in rows} == set(range(8))

    def test_readers(self, tmp_path: Path, foam: Foam) -> None:
        pyvista = pytest.importorskip("pyvista")
        path, view = write_ply(tmp_path / "foam.ply", foam, curve_points=5)
        mesh = trimesh.load(path, process=False)
        n_points = foam.network.n_vertices + 3 * foam.network.n_films
        assert len(mesh.vertices) == n_points
        assert mesh.visual.kind == "face"
        straight = trimesh.load(write_ply(tmp_path / "flat.ply", foam, curve_points=2)[0], process=False)
        assert straight.is_watertight
        assert straight.is_winding_consistent
        assert straight.euler_number == foam.network.euler_characteristic
        data = pyvista.read(path)
        assert (data.n_points, data.n_cells) == (n_points, foam.n_bubbles)
        np.testing.assert_array_equal(data.cell_data["RGB"], bubble_colours(foam).rgb)

        mesh, data = trimesh.load(view, process=False), pyvista.read(view)
        assert len(mesh.faces) == data.n_cells > 20 * foam.n_bubbles
        assert mesh.visual.kind == "vertex"
        assert mesh.area == pytest.approx(foam.cell.surface.area, rel=0.02)
        assert mesh.volume > 0
        rgb = data.point_data["RGB"]
        np.testing.assert_array_equal(mesh.visual.vertex_colors[:, :3], rgb)
        expected = {tuple(c) for c in bubble_colours(foam).rgb.tolist()} | {(27, 27, 31)}
        assert {tuple(c) for c in np.unique(rgb, axis=0).tolist()} == expected

    def test_view_quality_is_the_value_shown(self, tmp_path: Path) -> None:
        foam = with_pressures(sphere_foam(40))
        _, view = write_ply(tmp_path / "foam.ply", foam, color_by="pressure")
        raw = trimesh.load(view, process=False).metadata["_ply_raw"]["vertex"]["data"]
        assert foam.pressures is not None
        np.testing.assert_array_equal(np.unique(raw["quality"]), np.unique(foam.pressures.astype("f4")))

    def test_refusals(self, tmp_path: Path) -> None:
        foam = sphere_foam(12)
        for path, keywords, fault, words in (
            ("foam.stl", {}, ValueError, "must end in .ply"),
            ("no/foam.ply", {}, FileNotFoundError, "make it first"),
            ("foam.ply", {"color_by": "pressure"}, ValueError, "relax the foam first"),
            ("foam.ply", {"color_by": "mood"}, ValueError, "color_by must be one of"),
            ("foam.ply", {"curve_points": 1}, ValueError, "at least 2"),
        ):
            with pytest.raises(fault, match=words):
                write_ply(tmp_path / path, foam, **keywords)  # type: ignore[arg-type]
        assert not list(tmp_path.iterdir())


class TestPatches:
    def test_lie_on_the_surface_and_fill_the_bubbles(self, foam: Foam) -> None:
        patches = bubble_patches(foam, curve_points=9, rings=4, rim_width=0.02)
        away = foam.cell.surface.project(patches.points) - patches.points
        assert np.abs(away).max() < 1e-9 * foam.cell.surface.size
        areas = _patch_areas(patches, foam.n_bubbles)
        np.testing.assert_allclose(areas, foam.bubble_areas, rtol=0.02)
        owners = np.stack([patches.point_bubble[patches.triangles[:, k]] for k in range(3)])
        assert (owners == owners[0]).all()

    def test_areas_converge_with_second_order(self) -> None:
        foam = torus_foam()
        errors = []
        for n in (4, 8):
            areas = _patch_areas(bubble_patches(foam, curve_points=n + 1, rings=n), foam.n_bubbles)
            errors.append(np.abs(areas.sum() - foam.cell.surface.area))
        assert 3.5 < errors[0] / errors[1] < 4.5

    @pytest.mark.parametrize("height", [0.99, 0.8, 0.0, -0.6])
    def test_a_lone_bubble_and_the_rest_of_the_sphere(self, height: float) -> None:
        foam = lone_bubble(height)
        patches = bubble_patches(foam, rings=6, curve_points=17)
        assert not patches.sunk.size
        areas = _patch_areas(patches, 2)
        np.testing.assert_allclose(areas, foam.bubble_areas, rtol=0.03)

    def test_an_exterior_that_is_no_disk(self, tmp_path: Path) -> None:
        foam = bubble_on_torus()
        patches = bubble_patches(foam)
        areas = _patch_areas(patches, 2)
        surface = foam.cell.surface
        assert areas.sum() == pytest.approx(surface.area, rel=0.02)
        assert areas[0] == pytest.approx(foam.bubble_areas[0], rel=0.01)
        assert patches.sunk.tolist() == [1]
        # the exterior's triangles stay out of the bubble, but for those across its films
        middle = foam.bubble_centres[:1]
        outside = patches.points[patches.point_bubble == 1]
        assert np.linalg.norm(outside - middle, axis=1).min() > 0.15
        depth = np.linalg.norm(surface.project(outside) - outside, axis=1)
        assert 0.0 < depth.max() < 0.1
        path, _ = write_ply(tmp_path / "foam.ply", foam)
        assert len(_elements(path)["face"][1]) == 1

    def test_colours(self) -> None:
        foam = with_pressures(sphere_foam(60))
        colours = bubble_colours(foam, "pressure")
        order = np.argsort(colours.values)
        luma = colours.rgb[order] @ [0.299, 0.587, 0.114]
        assert (np.diff(luma) >= -1.5).all()  # monotonic in lightness, to the rounding of bytes
        luma = charge_rgb(np.arange(-3.0, 4.0)) @ [0.299, 0.587, 0.114]
        assert (np.diff(luma[:4]) > 20).all()
        assert (np.diff(luma[3:]) < -20).all()
