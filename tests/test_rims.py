"""Surfaces that end: rims, walls, T1s at walls, and what they must obey."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from warpedfoam import (
    Catenoid,
    CellNetwork,
    Cylinder,
    Foam,
    Graph,
    HeleShawCell,
    Revolution,
    Sphere,
    TopologyError,
    equilibrium_report,
    network_from_loops,
    relax,
    voronoi_foam,
    wall_t1,
)
from warpedfoam.io.patches import bubble_patches, film_points, loop_points
from warpedfoam.kernels.quadrature import lobatto

from .level_samples import BOWL, FAMILY, SHELL

GAP = 1e-6


def flat(x):
    return np.zeros(len(x))


def level(x):
    return np.zeros((len(x), 2))


PLATE = Graph(flat, level, 2.0, 2.0, disk=True)
SHEET = Graph(flat, level, 6.0, 4.0)
#: The upper half of the unit sphere.
DOME = Revolution(lambda z: 1.0 - z**2, lambda z: -2.0 * z, 0.0, 1.0)
RIMMED = {name: member.surface for name, member in FAMILY.items() if member.surface.rim is not None}
each_rim = pytest.mark.parametrize("surface", RIMMED.values(), ids=RIMMED)


def laid(surface, points, loops, order=8, volumes=None, gap=GAP):
    return Foam.from_loops(HeleShawCell(surface, gap=gap), points, loops, order=order, target_volumes=volumes)


# ---------------------------------------------------------------------------- the rim itself


@each_rim
def test_sliding_there_and_back_is_nothing(surface):
    rim = surface.rim
    rng = np.random.default_rng(0)
    loop = rng.integers(rim.n_loops, size=40)
    u = rng.uniform(0.0, 1.0, 40) * rim.lengths[loop]
    x = rim.at(loop, u)
    np.testing.assert_allclose(surface.project(x), x, atol=1e-9 * surface.size)
    found, place = rim.locate(x)
    np.testing.assert_array_equal(found, loop)
    off = np.mod(place - u + 0.5 * rim.lengths[loop], rim.lengths[loop]) - 0.5 * rim.lengths[loop]
    assert np.abs(off).max() < 1e-7 * rim.lengths.max()
    step = 0.01 * rim.lengths.min() * rng.standard_normal(40)
    np.testing.assert_allclose(rim.slide(rim.slide(x, step), -step), x, atol=2e-3 * np.abs(step).max())


@each_rim
def test_frames_point_along_the_rim_and_into_the_surface(surface):
    rim = surface.rim
    rng = np.random.default_rng(1)
    loop = rng.integers(rim.n_loops, size=30)
    u = rng.uniform(0.0, 1.0, 30) * rim.lengths[loop]
    h = 1e-5 * rim.lengths[loop]
    tangent, inward, speed = rim.frame(loop, u)
    ahead = (rim.at(loop, u + h) - rim.at(loop, u - h)) / (2.0 * h)[:, None]
    np.testing.assert_allclose(ahead, speed[:, None] * tangent, atol=1e-4)
    x = rim.at(loop, u)
    np.testing.assert_allclose(np.cross(surface.normals(x), tangent), inward, atol=1e-6)
    small = 1e-3 * surface.size
    assert not surface.beyond(x + small * inward).any()
    assert surface.beyond(x - small * inward).all()
    # what lies beyond comes back to the rim
    back = surface.project(x - small * inward)
    np.testing.assert_allclose(rim.nearest(back), back, atol=1e-9 * surface.size)


@each_rim
def test_walls_round_a_loop_are_the_loop(surface):
    rim = surface.rim
    rng = np.random.default_rng(2)
    for k in range(rim.n_loops):
        u = np.sort(rng.uniform(0.0, rim.lengths[k], 5))
        x = rim.at(np.full(5, k), u)
        loop, first, last = rim.spans(x, np.roll(x, -1, axis=0))
        assert (last - first).sum() == pytest.approx(rim.lengths[k], rel=1e-9)
        wall, low, high = rim.pieces(loop, first, last)
        np.testing.assert_allclose(np.bincount(wall, high - low), last - first, rtol=1e-12)
        assert (np.diff(wall) >= 0).all()
        whole = rim.turning(np.array([k]), np.zeros(1), rim.lengths[[k]])[0]
        assert rim.turning(loop, first, last).sum() == pytest.approx(whole, abs=1e-6)


def test_turning_of_circles_and_corners_is_a_closed_form():
    two_pi = 2.0 * np.pi
    assert FAMILY["pipe"].rim_turning == pytest.approx(0.0, abs=1e-9)
    tanh = np.tanh(1.0)
    assert FAMILY["waist"].rim_turning == pytest.approx(2.0 * two_pi * tanh, rel=1e-8)
    for surface, turning in ((PLATE, two_pi), (SHEET, two_pi), (DOME, 0.0)):
        rim = surface.rim
        found = rim.turning(np.array([0]), np.zeros(1), rim.lengths)[0]
        assert found == pytest.approx(turning, abs=1e-8)
    assert len(SHEET.rim.corners[0]) == 4


@pytest.mark.parametrize(
    ("surface", "area"),
    [
        (PLATE, np.pi),
        (SHEET, 24.0),
        (DOME, 2.0 * np.pi),
        (Cylinder(1.5, 4.0), 12.0 * np.pi),
        (Catenoid(1.0, 2.0), np.pi * (2.0 + np.sinh(2.0))),
    ],
)
def test_areas_of_curved_patches_and_slivers_are_closed_forms(surface, area):
    assert surface._moments[0] == pytest.approx(area, rel=1e-9)
    assert surface.area == pytest.approx(area, rel=1e-9)


def test_a_rim_of_a_mesh_converges_at_fifth_order_or_better():
    """Distance of the circle of a bowl from the rim of its meshes."""
    errors, edges = [], []
    circle = BOWL.rim.samples()[0]
    for n_nodes in (600, 2400):
        mesh = BOWL.triangulate(n_nodes)
        mine = type(SHELL)(mesh.nodes, mesh.triangles)
        errors.append(np.linalg.norm(mine.rim.nearest(circle) - circle, axis=1).max())
        edges.append(mesh.mean_edge)
        assert len(mine.rim_loops()) == 1
    assert np.log(errors[0] / errors[1]) / np.log(edges[0] / edges[1]) > 4.5
    assert SHELL.rim.samples()[2].sum() == pytest.approx(BOWL.rim.samples()[2].sum(), rel=1e-6)


def test_meshes_keep_the_corners_of_their_rims():
    mesh = SHEET.triangulate(800)
    mine = type(SHELL)(mesh.nodes, mesh.triangles)
    assert len(mine.rim.corners[0]) == 4
    assert mine.area == pytest.approx(24.0, rel=1e-9)


# ---------------------------------------------------------------------------- networks with walls


def test_a_film_across_a_disk():
    network = CellNetwork(next=[0, 1], origin=[0, 1], bubble=[0, 1])
    assert (network.n_vertices, network.n_films, len(network.walls)) == (2, 1, 2)
    assert network.euler_characteristic == 1
    assert network.sides.tolist() == [2, 2]
    assert network.charges.tolist() == [3, 3]
    assert network.wall_counts.tolist() == [1, 1]
    assert [len(cycle) for cycle in network.rim_cycles] == [2]
    np.testing.assert_array_equal(network.rim_vertices, [0, 1])


def test_three_bubbles_in_a_disk_by_loops():
    loops = [(0, 1, 2), (0, 2, 3), (0, 3, 1)]
    with pytest.raises(TopologyError, match="a bubble on one side only"):
        network_from_loops(loops)
    network = network_from_loops(loops, rims=True)
    assert (network.n_films, len(network.walls), network.euler_characteristic) == (3, 3, 1)
    assert network.sides.tolist() == [3, 3, 3]
    assert network.charges.sum() == 6


@pytest.mark.parametrize(
    ("arrays", "message"),
    [
        (([1, 0], [0, 1], [0, 0]), "comes back to vertex"),
        (([0, 1, 2, 3], [0, 1, 0, 2], [0, 1, 2, 3]), "does not end where its next begins"),
    ],
)
def test_bad_walls(arrays, message):
    with pytest.raises(TopologyError, match=message):
        CellNetwork(*arrays)


def test_loops_of_walls_alone_are_refused():
    with pytest.raises(TopologyError, match="no films, only walls"):
        network_from_loops([(0, 1, 2)], rims=True)
    with pytest.raises(TopologyError, match="no film ends at vertex"):
        network_from_loops([(0, 1, 2), (0, 2, 3)], rims=True)


def test_foams_and_rims_must_fit():
    loops = [(0, 1, 2), (0, 2, 3), (0, 3, 1)]
    turn = 2.0 * np.pi * np.arange(3) / 3.0
    points = np.concatenate([[[0.0, 0.0, 0.0]], np.column_stack([np.cos(turn), np.sin(turn), 0 * turn])])
    foam = laid(PLATE, points, loops)
    cap = Revolution(lambda z: 4.0 - z**2, lambda z: -2.0 * z, -2.0, 1.0)
    with pytest.raises(TopologyError, match="Euler characteristic 1, its surface 2"):
        Foam(HeleShawCell(Sphere(1.0), 0.1), foam.network, Sphere(1.0).project(points + 0.1))
    sides = CellNetwork([0, 1, 2, 3], [0, 1, 2, 3], [0, 1, 2, 3], [1, 1, 1, 0])
    with pytest.raises(TopologyError, match="walls make 2 loops, the surface's rim has 1"):
        Foam(HeleShawCell(cap, 0.1), sides, np.full((4, 3), [np.sqrt(3.0), 0.0, 1.0]))
    inside = foam.vertex_points.copy()
    inside[1] *= 0.9
    with pytest.raises(ValueError, match=r"rim vertices must lie on the rim, but vertex 1 is 0\.1 away"):
        Foam(foam.cell, foam.network, inside)
    swapped = foam.vertex_points[[0, 2, 1, 3]]
    with pytest.raises(ValueError, match="walls must follow each other round a loop of the rim"):
        Foam(foam.cell, foam.network, swapped)


# ---------------------------------------------------------------------------- closed forms


def energy_length(result):
    return result.energy / GAP


def test_two_bubbles_share_a_disk_by_its_diameter():
    """From a film off the middle and askew; the disk's symmetry is left to the foam."""
    a, b = np.radians([20.0, 170.0])
    points = [[np.cos(a), np.sin(a), 0.0], [np.cos(b), np.sin(b), 0.0]]

    network = CellNetwork(next=[0, 1], origin=[0, 1], bubble=[0, 1])
    cell = HeleShawCell(PLATE, gap=GAP)
    foam = Foam(cell, network, points, np.zeros((1, 7)), np.full(2, 0.5 * cell.volume))
    result = relax(foam)
    assert result.converged
    assert energy_length(result) == pytest.approx(2.0, rel=1e-10)
    assert result.foam.bubble_areas == pytest.approx(np.full(2, 0.5 * np.pi), rel=1e-9)


def test_unequal_bubbles_in_a_disk_meet_in_an_arc_at_right_angles():
    """Small bubble inside the unit circle, its film an arc of radius r round (√(1 + r²), 0)."""
    r = 0.5
    half = np.arctan(r)  # half the angle that the wall subtends
    area = half - 0.5 * np.sin(2 * half) + r**2 * (np.pi / 2 - half) - 0.5 * r**2 * np.sin(np.pi - 2 * half)
    length = 2.0 * r * (np.pi / 2 - half)
    cell = HeleShawCell(PLATE, gap=GAP)
    at = [[np.cos(0.4), np.sin(0.4), 0.0], [np.cos(0.4), -np.sin(0.4), 0.0]]
    network = CellNetwork(next=[0, 1], origin=[0, 1], bubble=[0, 1])
    share = area / np.pi
    volumes = cell.volume * np.array([share, 1.0 - share])
    # the small bubble lies left of the film that runs from above to below: its wall is on the right
    result = relax(Foam(cell, network, at, np.zeros((1, 11)), volumes))
    assert result.converged
    # as far as the fans know the volume of so large a bubble
    assert energy_length(result) == pytest.approx(length, rel=1e-7)
    drop = abs(result.pressures[0] - result.pressures[1])
    assert drop == pytest.approx(1.0 / r, rel=1e-6)


def test_three_equal_bubbles_in_a_disk_meet_in_its_middle():
    turn = np.radians([10.0, 120.0, 260.0])
    points = np.concatenate([[[0.1, -0.1, 0.0]], np.column_stack([np.cos(turn), np.sin(turn), 0 * turn])])
    cell = HeleShawCell(PLATE, gap=GAP)
    foam = laid(PLATE, points, [(0, 1, 2), (0, 2, 3), (0, 3, 1)], volumes=np.full(3, cell.volume / 3.0))
    result = relax(foam)
    assert result.converged
    assert energy_length(result) == pytest.approx(3.0, rel=1e-10)
    assert np.ptp(result.pressures) < 1e-9


def test_a_bubble_in_a_corner_has_a_quarter_circle():
    """Area A: √(πA) of film, and a pressure of 1/r."""
    area = 2.0
    cell = HeleShawCell(SHEET, gap=GAP)
    network = CellNetwork(next=[0, 1], origin=[0, 1], bubble=[0, 1])
    at = [[-1.5, -2.0, 0.0], [-3.0, -0.6, 0.0]]
    volumes = cell.volume * np.array([area, 24.0 - area]) / 24.0
    result = relax(Foam(cell, network, at, np.zeros((1, 11)), volumes))
    assert result.converged
    assert energy_length(result) == pytest.approx(np.sqrt(np.pi * area), rel=1e-9)
    r = 2.0 * np.sqrt(area / np.pi)
    assert result.pressures[0] - result.pressures[1] == pytest.approx(1.0 / r, rel=1e-7)


def test_half_of_the_three_lunes():
    """Three equal bubbles in a hemisphere: films along meridians from the pole, π/2 each."""
    turn = np.radians([5.0, 130.0, 250.0])
    pole = [[0.1, 0.1, np.sqrt(0.98)]]
    points = np.concatenate([pole, np.column_stack([np.cos(turn), np.sin(turn), 0 * turn])])
    cell = HeleShawCell(DOME, gap=GAP)
    foam = laid(DOME, points, [(0, 1, 2), (0, 2, 3), (0, 3, 1)], volumes=np.full(3, cell.volume / 3.0))
    result = relax(foam, order=12)
    assert result.converged
    # films lifted through the gap are longer by d/2r
    assert energy_length(result) == pytest.approx(1.5 * np.pi * (1.0 + 0.5 * GAP), rel=1e-9)


# ---------------------------------------------------------------------------- whole foams


@pytest.mark.parametrize("seed", [0, 1])
@pytest.mark.parametrize("name", ["pipe", "bowl", "patch", "plate"])
def test_random_foams_on_surfaces_that_end_converge(name, seed):
    surface = RIMMED[name]
    cell = HeleShawCell(surface, gap=0.02)
    start = voronoi_foam(cell, 100, seed=seed)
    assert start.network.charges.sum() == 6 * surface.euler_characteristic
    result = relax(start)
    assert result.converged, result.message
    assert result.is_minimum
    assert result.foam.network.charges.sum() == 6 * surface.euler_characteristic
    lower = [event for event in result.events if event.energy_after < event.energy_before]
    assert len(lower) > 0.7 * len(result.events)


def test_newton_converges_quadratically_on_a_curved_rim():
    """Without the rim's own curvature in the Hessian the last steps would gain a digit each."""
    cell = HeleShawCell(RIMMED["waist"], gap=1e-6)
    foam = relax(voronoi_foam(cell, 60, seeds="blue", seed=3)).foam
    rng = np.random.default_rng(0)
    points = foam.vertex_points.copy()
    on = foam.network.rim_vertices
    points[on] = cell.surface.rim.slide(points[on], 0.02 * foam.bubble_size * rng.standard_normal(len(on)))
    shaken = replace(foam, vertex_points=points)
    result = relax(shaken, t1=False)
    assert result.converged
    assert result.iterations <= 6


def test_scale_changes_nothing():
    one, ten = (
        relax(voronoi_foam(HeleShawCell(Catenoid(s, 2.0 * s), gap=0.02 * s), 60, seeds="blue", seed=4))
        for s in (1.0, 10.0)
    )
    assert ten.energy == pytest.approx(100.0 * one.energy, rel=1e-8)
    np.testing.assert_array_equal(one.foam.network.next, ten.foam.network.next)


def test_power_cells_know_rims():
    cell = HeleShawCell(RIMMED["plate"], gap=0.02)
    start = voronoi_foam(cell, 80, seeds="blue", seed=1, volumes=0.3, cells="power")
    off = np.abs(start.bubble_volumes / start.target_volumes - 1.0)
    assert off.mean() < 0.1
    assert relax(start).converged


# ---------------------------------------------------------------------------- T1s at walls


def relaxed_plate():
    cell = HeleShawCell(PLATE, gap=0.02)
    return relax(voronoi_foam(cell, 40, seeds="blue", seed=0)).foam


def lost_film(foam):
    """A film that a wall may take."""
    network = foam.network
    for film in range(network.n_films):
        ends = sorted(network.vertex_degrees[[network.tails[film], network.heads[film]]])
        if ends == [1, 3] and min(network.sides[[network.left[film], network.right[film]]]) >= 4:
            return film
    raise AssertionError


def test_losing_a_film_to_the_wall_and_pulling_it_out_again():
    foam = relaxed_plate()
    film = lost_film(foam)
    beside = foam.network.bubble[[2 * film, 2 * film + 1]]
    lost = wall_t1(foam, film)
    assert lost.network.n_films == foam.network.n_films - 1
    assert lost.network.n_vertices == foam.network.n_vertices
    assert lost.network.charges.sum() == foam.network.charges.sum() == 6
    change = lost.network.charges - foam.network.charges
    np.testing.assert_array_equal(change[beside], [1, 1])
    opposite = int(np.argmin(change))
    assert change[opposite] == -2
    assert np.abs(change).sum() == 4
    candidates = np.flatnonzero(lost.network.bubble[lost.network.walls] == opposite)
    again = [wall_t1(lost, int(w), "wall") for w in candidates]
    assert any((g.network.charges == foam.network.charges).all() for g in again)
    assert again[-1].network.n_films == foam.network.n_films


def test_forced_moves_relax_back_or_stay_higher():
    """The relaxed foam is a minimum: a film lost by force costs energy at first."""
    foam = relaxed_plate()
    lost = wall_t1(foam, lost_film(foam), length=0.02 * foam.bubble_size)
    assert lost.energy != foam.energy
    after = relax(lost)
    assert after.converged
    assert after.foam.network.charges.sum() == 6


@pytest.mark.parametrize(
    ("index", "kind", "error", "message"),
    [
        (10**6, "film", ValueError, "index"),
        (0, "door", ValueError, "kind"),
        (-1, "wall", ValueError, "index"),
    ],
)
def test_bad_wall_moves(index, kind, error, message):
    with pytest.raises(error, match=message):
        wall_t1(relaxed_plate(), index, kind)


def test_films_inside_are_not_lost_to_walls():
    foam = relaxed_plate()
    degrees = foam.network.vertex_degrees
    inside = np.flatnonzero((degrees[foam.network.tails] == 3) & (degrees[foam.network.heads] == 3))[0]
    with pytest.raises(TopologyError, match="does not join a threefold vertex to the rim"):
        wall_t1(foam, int(inside))
    with pytest.raises(TypeError, match="foam must be a Foam"):
        wall_t1(foam.network, 0)


@settings(max_examples=12, deadline=None)
@given(st.lists(st.tuples(st.booleans(), st.integers(0, 10**6)), min_size=1, max_size=12))
def test_any_sequence_of_moves_leaves_a_network(moves):
    foam = relaxed_plate_once()
    for is_film, number in moves:
        kind = "film" if is_film else "wall"
        count = foam.network.n_films if is_film else len(foam.network.walls)
        try:
            foam = wall_t1(foam, number % count, kind, length=1e-3 * foam.bubble_size)
        except (TopologyError, ValueError):
            continue
        assert foam.network.charges.sum() == 6
        assert foam.network.euler_characteristic == 1
        assert foam.network.wall_counts.sum() == len(foam.network.walls)


_ONCE = []


def relaxed_plate_once():
    if not _ONCE:
        _ONCE.append(relaxed_plate())
    return _ONCE[0]


# ---------------------------------------------------------------------------- what is taken away


@pytest.mark.parametrize("name", ["pipe", "patch", "plate", "bowl"])
def test_polygons_and_patches_cover_the_surface_up_to_its_rim(name):
    foam = relax(voronoi_foam(HeleShawCell(RIMMED[name], gap=0.02), 60, seeds="blue", seed=3)).foam
    points, places, sizes, bubble = loop_points(foam, film_points(foam, 9))
    assert sizes.sum() == len(places)
    assert len(bubble) == foam.n_bubbles
    # every wall's points lie on the rim, and no loop has a gap
    start = np.cumsum(sizes) - sizes
    after = np.arange(len(places)) + 1
    after[start + sizes - 1] = start
    step = np.linalg.norm(points[places[after]] - points[places], axis=1)
    assert step.max() < 0.5 * foam.bubble_size
    assert step.min() > 1e-9 * foam.bubble_size
    patches = bubble_patches(foam)
    a, b, c = (patches.points[patches.triangles[:, k]] for k in range(3))
    area = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1).sum()
    assert area == pytest.approx(foam.cell.surface.area, rel=0.01)
    assert not len(patches.sunk)


def test_wall_pieces_have_the_quadrature_of_their_films():
    """Volumes add up to the cell's at every order, though walls are long and curved."""
    foam = relaxed_plate_once()
    for order in (4, 8):
        again = foam.with_order(order)
        assert again.bubble_volumes.sum() == pytest.approx(foam.cell.volume, rel=1e-7)
    nodes = PLATE.rim.nodes(lobatto(4), np.array([0]), np.array([0.0]), np.array([0.2]))
    np.testing.assert_allclose(np.linalg.norm(nodes[..., :2], axis=2), 1.0, atol=1e-12)


def test_reports_know_walls():
    report = equilibrium_report(relaxed_plate_once())
    assert len(report.wall_angles) == len(relaxed_plate_once().network.rim_vertices)
    assert report.wall_error < 1e-3
    closed = equilibrium_report(
        relax(voronoi_foam(HeleShawCell(Sphere(1.0), 0.01), 12, seeds="lattice")).foam
    )
    assert closed.wall_error == 0.0
    assert len(closed.wall_angles) == 0


def test_films_that_bulge_are_refused_at_rims():
    with pytest.raises(ValueError, match="layers above 1 need a surface without rims"):
        relax(relaxed_plate_once(), layers=3)
