"""Foams from polygons: round trips by files, other people's points, clear refusals."""

from __future__ import annotations

import itertools
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import warpedfoam as wf

from .io_foams import lone_bubble, sphere_foam, torus_foam
from .test_io_formats import flat_foam


def loops_of(foam: wf.Foam) -> list[list[int]]:
    loops = foam.network.loops
    return [part.tolist() for part in np.split(foam.network.origin[loops.halves], loops.starts[1:])]


@cache
def relaxed(kind: str) -> wf.Foam:
    return wf.relax(sphere_foam(30, even=True) if kind == "sphere" else torus_foam(), t1=False).foam


@pytest.mark.parametrize("ending", [".ply", ".obj"])
@pytest.mark.parametrize("make", [lambda: relaxed("sphere"), lambda: relaxed("torus"), flat_foam])
def test_our_polygons_come_back(tmp_path: Path, make, ending: str) -> None:
    foam = make()
    path = tmp_path / f"foam{ending}"
    (wf.write_ply if ending == ".ply" else wf.write_obj)(path, foam)
    again = wf.import_polygons(path, foam.cell)
    assert (again.n_bubbles, again.network.n_films) == (foam.n_bubbles, foam.network.n_films)
    np.testing.assert_array_equal(again.network.sides, foam.network.sides)
    np.testing.assert_allclose(again.bubble_volumes, foam.bubble_volumes, rtol=1e-12)
    assert again.energy == pytest.approx(foam.energy, rel=1e-12)


@pytest.mark.parametrize("points", [3, 4, 6, 17])
def test_films_take_the_shape_of_their_points(tmp_path: Path, points: int) -> None:
    """Exactly, if there are as many points as offsets; roughly with fewer."""
    foam = relaxed("sphere")
    again = wf.import_polygons(wf.write_obj(tmp_path / "f.obj", foam, curve_points=points), foam.cell)
    error = np.abs(again.bubble_areas / foam.bubble_areas - 1.0).max()
    assert error < {3: 0.05, 4: 0.02}.get(points, 1e-12)


def test_binary_ply_by_another_program(tmp_path: Path) -> None:
    import struct

    foam = sphere_foam(20)
    loops = loops_of(foam)
    head = (
        f"ply\nformat binary_big_endian 1.0\nelement vertex {len(foam.vertex_points)}\nproperty float x\n"
        f"property float y\nproperty float z\nproperty uchar red\nelement face {len(loops)}\n"
        "property list uchar uint vertex_index\nend_header\n"
    )
    body = b"".join(struct.pack(">fffB", *p, 7) for p in foam.vertex_points)
    body += b"".join(struct.pack(f">B{len(loop)}I", len(loop), *loop) for loop in loops)
    (tmp_path / "f.ply").write_bytes(head.encode() + body)
    again = wf.import_polygons(tmp_path / "f.ply", foam.cell)
    np.testing.assert_array_equal(again.network.sides, foam.network.sides)
    np.testing.assert_allclose(again.vertex_points, foam.vertex_points, atol=1e-6)


def test_clockwise_polygons_are_turned_and_doubled_points_welded() -> None:
    foam = sphere_foam(20)
    loops = loops_of(foam)
    own = [foam.vertex_points[loop[::-1]] for loop in loops]
    starts = np.cumsum([0, *(len(x) for x in own)])
    soup = [list(range(a, b)) for a, b in itertools.pairwise(starts)]
    again = wf.import_polygons((np.concatenate(own), soup), foam.cell)
    assert again.energy == pytest.approx(foam.energy, rel=1e-13)
    np.testing.assert_allclose(again.bubble_volumes, foam.bubble_volumes, rtol=1e-12)


def test_a_closed_film_keeps_its_points() -> None:
    foam = lone_bubble()
    again = wf.import_polygons((foam.vertex_points, loops_of(foam)), foam.cell)
    assert again.network.n_vertices == 3
    np.testing.assert_allclose(again.bubble_areas, foam.bubble_areas, rtol=1e-12)


def test_it_relaxes_to_what_the_original_does() -> None:
    foam = sphere_foam(30, even=True)
    again = wf.import_polygons((foam.vertex_points, loops_of(foam)), foam.cell)
    found = wf.relax(again, t1=False)
    assert found.energy == pytest.approx(relaxed("sphere").energy, rel=1e-12)


class TestRefuses:
    foam = sphere_foam(20)

    def refused(self, fault: type[Exception], words: str, points=None, loops=None, **options) -> None:
        x = self.foam.vertex_points if points is None else points
        with pytest.raises(fault, match=words):
            wf.import_polygons(
                (x, loops_of(self.foam) if loops is None else loops), self.foam.cell, **options
            )

    def test_holes(self) -> None:
        self.refused(
            wf.TopologyError, "1 polygons beside it.*close the surface", loops=loops_of(self.foam)[1:]
        )

    def test_polygons_twice(self) -> None:
        self.refused(
            wf.TopologyError, "polygons beside it", loops=[*loops_of(self.foam), loops_of(self.foam)[0]]
        )

    def test_mixed_orientation(self) -> None:
        loops = loops_of(self.foam)
        self.refused(wf.TopologyError, "counter-clockwise", loops=[loops[0][::-1], *loops[1:]])

    def test_four_at_a_vertex(self) -> None:
        corners = np.concatenate([np.eye(3), -np.eye(3)])
        faces = [[0, 1, 2], [1, 3, 2], [3, 4, 2], [4, 0, 2], [1, 0, 5], [3, 1, 5], [4, 3, 5], [0, 4, 5]]
        self.refused(
            wf.TopologyError, "4 edges meet at.*in a foam three do", points=2.0 * corners, loops=faces
        )

    def test_points_off_the_surface(self) -> None:
        points = self.foam.vertex_points.copy()
        points[3] *= 1.2
        self.refused(ValueError, "point 3 is 0.4 away", points=points)
        wf.import_polygons((points, loops_of(self.foam)), self.foam.cell, tolerance=1.0)

    def test_another_surface(self) -> None:
        with pytest.raises(ValueError, match="lie on the cell's surface"):
            wf.import_polygons(
                (self.foam.vertex_points, loops_of(self.foam)), wf.HeleShawCell(wf.Torus(2.0, 1.0), 0.1)
            )

    def test_numbers(self) -> None:
        points = self.foam.vertex_points.copy()
        points[0, 0] = np.nan
        self.refused(ValueError, "finite", points=points)
        self.refused(ValueError, "polygons\\[0\\]", loops=[[0, 1, 999]] * 4)
        self.refused(TypeError, "integers", loops=[[0.5, 1.0, 2.0]] * 4)
        self.refused(wf.TopologyError, "two at least", loops=[[0, 1, 2]])

    def test_files(self, tmp_path: Path) -> None:
        for name, text, words in (
            ("a.ply", "ply\n", "header does not end"),
            ("b.obj", "v 0 0\n", "line 1"),
            ("c.obj", "v 0 0 0\n", "no polygons"),
            ("d.obj", "v 0 0 0\nf 1 2 3\n", "names a point"),
            (
                "e.ply",
                "ply\nformat ascii 1.0\nelement vertex 2000000000\nproperty float x\nend_header\n1\n",
                "ends",
            ),
        ):
            (tmp_path / name).write_text(text)
            with pytest.raises(wf.FileFormatError, match=words):
                wf.import_polygons(tmp_path / name, self.foam.cell)
        (tmp_path / "f.stl").write_text("")
        with pytest.raises(ValueError, match=r"\.ply, \.obj, \.fe or \.dmp"):
            wf.import_polygons(tmp_path / "f.stl", self.foam.cell)
        with pytest.raises(FileNotFoundError):
            wf.import_polygons(tmp_path / "none.ply", self.foam.cell)
