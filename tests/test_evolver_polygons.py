"""Foams out of the Surface Evolver's files: as written, as moved, and damaged."""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import warpedfoam as wf
from warpedfoam.io.evolver_polygons import evolver_polygons

from .test_evolver import DATA, evolved, live


@cache
def foam(name: str) -> wf.Foam:
    if name in ("sphere", "torus"):
        return wf.load(DATA / f"{name}_12.npz")
    if name == "cluster":
        cell = wf.HeleShawCell(wf.Sphere(2.0), 0.1)
        return wf.relax(wf.cluster_foam(cell, 4, volumes=0.02 * cell.volume)).foam
    surface = {
        "disk": lambda: wf.Graph.from_formula("0.1*x**2 - 0.15*y**2", 4.0, 4.0, disk=True),
        "flat torus": lambda: wf.FlatTorus(4.0, 3.0),
        "cylinder": lambda: wf.Cylinder(1.0, 2.0),
        "strip": lambda: wf.Graph.from_formula("0.1*sin(y)", 1.0, 6.0),
    }[name]()
    count = 5 if name == "strip" else 14
    return wf.relax(wf.voronoi_foam(wf.HeleShawCell(surface, 0.1), count, seed=2, lloyd=2)).foam


NAMES = ("sphere", "torus", "flat torus", "cylinder", "disk", "strip", "cluster")


def same_topology(one: wf.Foam, other: wf.Foam) -> None:
    np.testing.assert_array_equal(one.network.sides, other.network.sides)
    np.testing.assert_array_equal(one.network.bubble_euler, other.network.bubble_euler)
    for part in ("n_films", "n_vertices"):
        assert getattr(one.network, part) == getattr(other.network, part)
    assert len(one.network.walls) == len(other.network.walls)
    assert len(one.network.markers) == len(other.network.markers)
    # the same bubbles are neighbours
    pairs = [np.sort(np.stack([f.network.left, f.network.right]), axis=0) for f in (one, other)]
    np.testing.assert_array_equal(*(np.sort(p[0] * one.n_bubbles + p[1]) for p in pairs))


@pytest.mark.parametrize("name", NAMES)
def test_a_datafile_is_a_foam_again(tmp_path: Path, name: str) -> None:
    """Energy and volumes but for what points, drawn out to give chords the area of films, leave."""
    one = foam(name)
    path = wf.write_fe(tmp_path / "f.fe", one, segments=8)
    exterior = None if one.exterior is None else "holes"
    again = wf.import_polygons(path, one.cell, order=one.order, exterior=exterior)
    same_topology(one, again)
    assert again.exterior == one.exterior
    assert again.energy == pytest.approx(one.energy, rel=1e-5)
    np.testing.assert_allclose(again.bubble_volumes, one.bubble_volumes, rtol=2e-5)


def test_a_dump_is_a_foam_again() -> None:
    """The recorded one, after the Evolver's own steps on four chords: its errors are of their square."""
    one = foam("sphere")
    text = (DATA / "sphere_12.dmp").read_text()
    told = "".join(
        f"PARAMETER foam_{k} = {v} \n" for k, v in (("vertices", 20), ("rest", 11), ("exterior", 0))
    )
    path = DATA / "sphere_12.dmp"
    with pytest.raises(wf.FileFormatError, match="no parameter foam_vertices"):
        wf.import_polygons(path, one.cell)
    points, polygons, vertices = evolver_polygons(
        text.replace("STRING\n", f"STRING\n{told}", 1).encode(), None
    )
    assert vertices == one.network.n_vertices == 20
    again = wf.import_polygons((points, polygons), one.cell)
    same_topology(one, again)
    assert again.energy == pytest.approx(one.energy, rel=3e-3)


@live
@pytest.mark.parametrize("name", ["torus", "flat torus", "disk"])
def test_what_the_evolver_moved_is_a_foam(tmp_path: Path, name: str) -> None:
    """Its dump; relaxed here it is the foam that was written."""
    one = foam(name)
    path = wf.write_fe(tmp_path / "f.fe", one, segments=6)
    dump = evolved(path, minimum=False)[0]
    again = wf.import_polygons(path.with_suffix(".0.dmp"), one.cell)
    same_topology(one, again)
    # as far off as the Evolver's chords
    assert abs(again.energy - one.energy) < 1.5 * abs(dump.energy - one.energy) < 5e-3 * one.energy
    back = wf.Foam(one.cell, again.network, again.vertex_points, again.film_offsets, one.target_volumes)
    assert wf.relax(back, order=one.order, t1=False).energy == pytest.approx(one.energy, rel=1e-7)


def test_damage_is_refused(tmp_path: Path) -> None:
    one = foam("sphere")
    whole = wf.write_fe(tmp_path / "f.fe", one, segments=2).read_text()
    for change, words in (
        (lambda t: t.replace("string\n", "", 1), "no string model"),
        (lambda t: t.replace("parameter foam_rest = 11\n", ""), "no parameter foam_rest"),
        (lambda t: t.replace("foam_rest = 11", "foam_rest = 99"), "one at place 99"),
        (lambda t: t.replace("foam_vertices = 20", "foam_vertices = 9999"), "vertices of a foam"),
        (lambda t: t.replace("foam_vertices = 20", "foam_vertices = 0"), "vertices of a foam"),
        (lambda t: t[: t.index("edges")], "no section 'edges'"),
        (lambda t: t[: len(t) - 200], "no section 'read'"),
        (lambda t: t.replace("vertices\n", "edges\n", 1), "no section 'vertices'"),
        (lambda t: re.sub(r"\n7 \S+", "\n7 nan", t, count=1), "3 numbers"),
        (lambda t: re.sub(r"\n5 (\d+) \d+ constraint", r"\n5 \1 4000 constraint", t), "not there"),
        (lambda t: re.sub(r"(\n\d+ \d+ \d+ constraint 1 tension \S+) .*", r"\1", t, count=1), "both sides"),
        (lambda t: re.sub(r"( tension \S+) bubble_\d+", r"\1 bubble_77", t, count=1), "no quantity"),
        (
            lambda t: re.sub(r"\n9 \d+ \d+ constraint 1 tension.*", "", t, count=1),
            "twice|no disk|do not close",
        ),
    ):
        (tmp_path / "g.fe").write_text(change(whole))
        with pytest.raises(wf.FileFormatError, match=words):
            wf.import_polygons(tmp_path / "g.fe", one.cell)
    sheets = wf.write_fe(tmp_path / "s.fe", one, model="soapfilm", segments=1)
    with pytest.raises(wf.FileFormatError, match="no string model"):
        wf.import_polygons(sheets, one.cell)
    with pytest.raises(ValueError, match="must lie on the cell's surface"):
        wf.import_polygons(tmp_path / "f.fe", wf.HeleShawCell(wf.Sphere(3.0), 0.1))
