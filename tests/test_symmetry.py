"""Point groups: Schoenflies symbols of built groups, foams of known symmetry, any orientation."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import warpedfoam as wf
from warpedfoam.analysis.symmetry import point_group, schoenflies

from .nets import NETS, Net, hemispheres

X, Y, Z = np.eye(3)
INVERSION = -np.eye(3)


def turn(axis: np.ndarray, fold: float) -> np.ndarray:
    return Rotation.from_rotvec(2.0 * np.pi / fold * axis / np.linalg.norm(axis)).as_matrix()


def mirror(axis: np.ndarray) -> np.ndarray:
    return np.eye(3) - 2.0 * np.outer(axis, axis) / (axis @ axis)


def generated(*matrices: np.ndarray) -> np.ndarray:
    group = [np.eye(3)]
    grown = True
    while grown:
        grown = False
        for a in list(group):
            for b in matrices:
                if min(np.abs(a @ b - c).max() for c in group) > 1e-6:
                    group.append(a @ b)
                    grown = True
    return np.array(group)


GOLDEN = (1.0 + np.sqrt(5.0)) / 2.0
GROUPS = {
    "C1": (),
    "Cs": (mirror(X + Y),),
    "Ci": (INVERSION,),
    "C2": (turn(Z, 2),),
    "C5": (turn(X, 5),),
    "C2v": (turn(Z, 2), mirror(X)),
    "C3v": (turn(Z, 3), mirror(X)),
    "C2h": (turn(Z, 2), mirror(Z)),
    "C3h": (turn(Z, 3), mirror(Z)),
    "S4": (turn(Z, 4) @ mirror(Z),),
    "S6": (turn(Z, 6) @ mirror(Z),),
    "D2": (turn(Z, 2), turn(X, 2)),
    "D2h": (turn(Z, 2), turn(X, 2), INVERSION),
    "D2d": (turn(Z, 4) @ mirror(Z), mirror(X)),
    "D3": (turn(Z, 3), turn(X, 2)),
    "D3h": (turn(Z, 3), turn(X, 2), mirror(Z)),
    "D3d": (turn(Z, 3), turn(X, 2), INVERSION),
    "D4d": (turn(Z, 8) @ mirror(Z), turn(X, 2)),
    "D6h": (turn(Z, 6), turn(X, 2), mirror(Z)),
    "T": (turn(X + Y + Z, 3), turn(Z, 2)),
    "Td": (turn(X + Y + Z, 3), turn(Z, 4) @ mirror(Z)),
    "Th": (turn(X + Y + Z, 3), turn(Z, 2), INVERSION),
    "O": (turn(X, 4), turn(Z, 4)),
    "Oh": (turn(X, 4), turn(Z, 4), INVERSION),
    "I": (turn(X + GOLDEN * Y, 5), turn(X + Y + Z, 3)),
    "Ih": (turn(X + GOLDEN * Y, 5), turn(X + Y + Z, 3), INVERSION),
}


@pytest.mark.parametrize("name", GROUPS)
def test_schoenflies(name: str) -> None:
    group = generated(*GROUPS[name])
    assert schoenflies(group) == name
    q = Rotation.random(random_state=1).as_matrix()
    assert schoenflies(q @ group[::-1] @ q.T) == name


@pytest.mark.parametrize("net", NETS, ids=lambda net: net.name)
def test_nets(net: Net) -> None:
    foam = wf.relax(net.foam(0.01, 6)).foam
    group = point_group(foam)
    wanted = {
        "tetrahedron": ("Td", 24),
        "triangular prism": ("D3h", 12),
        "cube": ("Oh", 48),
        "pentagonal prism": ("D5h", 20),
        "dodecahedron": ("Ih", 120),
    }
    if net.name in wanted:
        assert (group.name, group.order) == wanted[net.name]
        assert group.n_rotations == group.order // 2
    assert group.error < 1e-7
    # a group: products of elements are elements
    m = group.matrices
    products = np.einsum("aij,bjk->abik", m[:8], m).reshape(-1, 1, 9)
    assert np.abs(products - m.reshape(1, -1, 9)).max(axis=2).min(axis=1).max() < 1e-6
    # and they map bubbles of n sides to such
    centres, sides = foam.bubble_centres, foam.network.sides
    for element in m:
        away = np.linalg.norm((centres @ element.T)[:, None] - centres[None], axis=2)
        assert away.min(axis=1).max() < 1e-6
        assert (sides[away.argmin(axis=1)] == sides).all()


def test_a_random_foam_has_none_and_one_that_is_off_is_found_with_tolerance() -> None:
    cell = wf.HeleShawCell(wf.Sphere(1.0), 0.01)
    random = wf.relax(wf.voronoi_foam(cell, 30, seed=1)).foam
    assert point_group(random).name == "C1"
    cube = next(net for net in NETS if net.name == "cube").foam(0.01, 4)
    noise = 1e-3 * np.random.default_rng(0).standard_normal(cube.vertex_points.shape)
    points = cube.cell.surface.project(cube.vertex_points + noise)
    off = wf.Foam(cube.cell, cube.network, points)
    assert point_group(off).order == 1
    assert point_group(off, tolerance=0.01).name == "Oh"


def test_curved_films_count() -> None:
    # the vertices of a cube, but a film bent to one side
    cube = next(net for net in NETS if net.name == "cube").foam(0.01, 4)
    offsets = np.zeros((12, 3))
    offsets[5] = 0.05
    bent = wf.Foam(cube.cell, cube.network, cube.vertex_points, offsets)
    assert point_group(bent).name == "Cs"


def test_a_torus_has_no_more_than_its_own() -> None:
    cell = wf.HeleShawCell(wf.Torus(3.0, 1.0), 0.01)
    foam = wf.relax(wf.voronoi_foam(cell, 60, seed=2)).foam
    assert point_group(foam).name == "C1"


def test_bad_input() -> None:
    flat = wf.voronoi_foam(wf.HeleShawCell(wf.FlatTorus(1.0, 1.0), 0.01), 30, seed=0)
    with pytest.raises(ValueError, match="closed surface"):
        point_group(flat)
    with pytest.raises(ValueError, match="marker"):
        point_group(hemispheres(0.01, 8, 6, 0.0))
    with pytest.raises(TypeError, match="foam"):
        point_group(None)  # type: ignore[arg-type]
