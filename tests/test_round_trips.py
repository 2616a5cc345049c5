"""Foams of every kind through every format that holds one: rims, exteriors, markers, periods."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest

import warpedfoam as wf

from .io_foams import bubble_on_torus, lone_bubble, resized, sphere_foam
from .test_io_files import _same
from .test_view import repeating, rimmed


@cache
def foam(name: str) -> wf.Foam:
    if name == "rim":
        cell = wf.HeleShawCell(wf.Cylinder(1.0, 2.0), 0.1)
        return wf.relax(wf.voronoi_foam(cell, 12, seed=1, lloyd=2)).foam
    if name == "functions":
        return rimmed()
    if name == "catenoid":
        return wf.voronoi_foam(wf.HeleShawCell(wf.Catenoid(1.0, 1.5), 0.1), 12, seed=2)
    if name == "cluster":
        cell = wf.HeleShawCell(wf.Sphere(2.0), 0.1)
        return wf.relax(wf.cluster_foam(cell, 4, volumes=0.1)).foam
    if name == "cluster on torus":
        return wf.cluster_foam(wf.HeleShawCell(wf.Torus(3.0, 1.2), 0.1), 4, volumes=0.1)
    if name == "two disks":
        lone = lone_bubble()
        return wf.Foam(lone.cell, lone.network, lone.vertex_points, lone.film_offsets, exterior=1)
    if name == "handle":
        return bubble_on_torus()
    if name == "period":
        return repeating()
    return wf.voronoi_foam(wf.HeleShawCell(wf.Cylinder(1.0, 3.0, periodic=True), 0.1), 16, seed=1)


NAMES = (
    "rim", "catenoid", "cluster", "cluster on torus", "two disks", "handle", "period", "joined cylinder",
)  # fmt: skip


@pytest.mark.parametrize("name", NAMES)
def test_bit_for_bit(tmp_path: Path, name: str) -> None:
    one = foam(name)
    with wf.TrajectoryWriter(tmp_path / "f.h5") as writer:
        writer.append(one)
    with wf.Trajectory(tmp_path / "f.h5") as frames:
        again = [frames[0]]
    again.append(wf.load(wf.save(tmp_path / "f.npz", one)))
    again.append(wf.read_vtp(wf.write_vtp(tmp_path / "f.vtp", one)))
    for other in again:
        assert _same(other, one)
        assert other.exterior == one.exterior
        assert other.energy == one.energy


@pytest.mark.parametrize("ending", [".ply", ".obj"])
@pytest.mark.parametrize("name", [*NAMES, "functions"])
def test_polygons(tmp_path: Path, name: str, ending: str) -> None:
    """Same topology, markers too; places and energy to rounding."""
    one, path = foam(name), tmp_path / f"f{ending}"
    (wf.write_ply if ending == ".ply" else wf.write_obj)(path, one)
    exterior: int | str | None = one.exterior
    if one.exterior is not None and one.network.bubble_euler[one.exterior] != 1:
        exterior = "holes"
    again = wf.import_polygons(path, one.cell, order=one.order, exterior=exterior)
    np.testing.assert_array_equal(again.network.sides, one.network.sides)
    np.testing.assert_array_equal(again.network.bubble_euler, one.network.bubble_euler)
    assert len(again.network.markers) == len(one.network.markers)
    assert len(again.network.walls) == len(one.network.walls)
    assert again.exterior == one.exterior
    assert again.energy == pytest.approx(one.energy, rel=1e-12)
    np.testing.assert_allclose(again.bubble_volumes, one.bubble_volumes, rtol=1e-10)


@pytest.mark.parametrize("scale", [1e-9, 1e-3, 1e3, 1e9])
def test_sizes_from_nanometres_to_planets(tmp_path: Path, scale: float) -> None:
    """No format loses a digit, whatever the unit; the energies scale with the area."""
    one = resized(sphere_foam(12), scale)
    assert one.energy == pytest.approx(scale**2 * sphere_foam(12).energy, rel=1e-13)
    with wf.TrajectoryWriter(tmp_path / "f.h5") as writer:
        writer.append(one)
    with wf.Trajectory(tmp_path / "f.h5") as frames:
        again = [frames[0]]
    again.append(wf.load(wf.save(tmp_path / "f.npz", one)))
    again.append(wf.read_vtp(wf.write_vtp(tmp_path / "f.vtp", one)))
    assert all(_same(other, one) for other in again)
    for path in (wf.write_ply(tmp_path / "f.ply", one)[0], wf.write_obj(tmp_path / "f.obj", one)):
        other = wf.import_polygons(path, one.cell)
        assert other.energy == pytest.approx(one.energy, rel=1e-12)
        np.testing.assert_array_equal(other.network.sides, one.network.sides)


def test_pictures_of_surfaces_that_no_file_holds(tmp_path: Path) -> None:
    """They are drawn, and say what they lack."""
    one = foam("functions")
    with pytest.raises(TypeError, match=r"cannot save surface\.square"):
        wf.save(tmp_path / "f.npz", one)
    import pyvista

    seen = pyvista.read(wf.write_vtp(tmp_path / "f.vtp", one))
    assert seen.n_lines == one.network.n_films
    with pytest.raises(wf.FileFormatError, match="Python functions"):
        wf.read_vtp(tmp_path / "f.vtp")


class TestRefuses:
    def polygons(self, name: str) -> tuple[np.ndarray, list[list[int]]]:
        from warpedfoam.io.patches import film_points, loop_points

        one = foam(name)
        points, places, sizes, bubble = loop_points(one, film_points(one, 5))
        rings = [ring.tolist() for ring in np.split(places, np.cumsum(sizes)[:-1])]
        euler = one.network.bubble_euler[bubble]
        return points, [ring for ring, chi in zip(rings, euler, strict=True) if chi == 1]

    def test_holes_that_are_no_exterior(self) -> None:
        points, rings = self.polygons("cluster on torus")
        cell = foam("cluster on torus").cell
        with pytest.raises(wf.TopologyError, match="exterior='holes'"):
            wf.import_polygons((points, rings), cell)
        again = wf.import_polygons((points, rings), cell, exterior="holes", order=8)
        assert again.exterior == 4
        with pytest.raises(ValueError, match="'holes' or None, got 'hole'"):
            wf.import_polygons((points, rings), cell, exterior="hole")

    def test_no_hole(self) -> None:
        points, rings = self.polygons("period")
        with pytest.raises(wf.TopologyError, match="leave no hole"):
            wf.import_polygons((points, rings), foam("period").cell, exterior="holes")

    def test_a_polygon_missing_at_the_rim(self) -> None:
        points, rings = self.polygons("rim")
        with pytest.raises(wf.TopologyError, match=r"polygons beside it|ends on the rim"):
            wf.import_polygons((points, rings[1:]), foam("rim").cell)

    def test_a_rim_elsewhere(self) -> None:
        """The polygons of a shorter cylinder do not reach the rim of a longer one."""
        points, rings = self.polygons("rim")
        with pytest.raises((wf.TopologyError, ValueError), match=r"polygons beside it|away|walls"):
            wf.import_polygons((points, rings), wf.HeleShawCell(wf.Cylinder(1.0, 3.0), 0.1))
