"""`cluster_foam` and exteriors: topology, flat limits, closed forms on the sphere, T1s, refusals."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import warpedfoam as wf
from warpedfoam.moves.t1 import allowed, rewire, t1_sites
from warpedfoam.relax.held import LINK
from warpedfoam.studies.cluster import geodesic_chart
from warpedfoam.tessellate.layouts import SPACING, ghosts, hexagonal_centres, planar_layout, random_centres

SHEET = wf.HeleShawCell(wf.FlatTorus(40.0, 40.0), gap=0.5)
TORUS = wf.HeleShawCell(wf.Torus(20.0, 4.0), gap=0.5)
SPHERE = wf.HeleShawCell(wf.Sphere(1.0), gap=0.01)


class TestLayouts:
    @pytest.mark.parametrize("n", [1, 2, 3, 4, 5, 7, 12, 19, 37])
    def test_honeycomb_patches(self, n: int) -> None:
        """Cells of unit area and, without markers, 60° vertices: V − F + n = 1, Σ (6 − n_i) = 6 + outline."""
        centres = hexagonal_centres(n)
        plan = planar_layout(centres, ghosts(centres), 60.0)
        assert plan.n_bubbles == n
        assert len(plan.outside) == 1
        for loop in plan.loops:
            x, y = plan.points[loop].T
            area = 0.5 * (x * np.roll(y, -1) - y * np.roll(x, -1)).sum()
            assert 0.5 < area <= 1.0 + 1e-9
        inner = [loop for loop in plan.loops if not np.isin(loop, plan.outside[0]).any()]
        x, y = plan.points[inner[0]].T if inner else (np.zeros(0), np.zeros(0))
        if inner:
            assert 0.5 * (x * np.roll(y, -1) - y * np.roll(x, -1)).sum() == pytest.approx(1.0, rel=1e-9)

    def test_patches_are_compact(self) -> None:
        for n, rings in ((7, 1), (19, 2), (37, 3)):
            assert np.linalg.norm(hexagonal_centres(n), axis=1).max() == pytest.approx(rings * SPACING)

    @pytest.mark.parametrize("seed", range(8))
    def test_random_patches_are_clusters(self, seed: int) -> None:
        centres, around = random_centres(15, np.random.default_rng(seed))
        again, _ = random_centres(15, np.random.default_rng(seed))
        np.testing.assert_array_equal(centres, again)
        plan = planar_layout(centres, around, 150.0)
        assert (plan.n_bubbles, len(plan.outside)) == (15, 1)

    @pytest.mark.parametrize("turn", [30.0, 60.0, 120.0])
    def test_pieces_of_outlines(self, turn: float) -> None:
        """A double's arcs turn by 240°: markers divide them evenly."""
        centres = hexagonal_centres(2)
        plan = planar_layout(centres, ghosts(centres), turn)
        assert [len(loop) for loop in plan.loops] == [1 + round(240 / turn)] * 2


@pytest.mark.parametrize("cell", [SHEET, TORUS, SPHERE], ids=["sheet", "torus", "sphere"])
@pytest.mark.parametrize("counts", [(1,), (3,), (7, 2), (1, 1, 3)])
def test_topology(cell: wf.HeleShawCell, counts: tuple[int, ...]) -> None:
    """The exterior's Euler number is χ − k; charges tell the outline's sides."""
    middles = cell.surface.lattice_points(len(counts))
    share = 2e-3 * cell.volume / max(counts)
    foam = wf.cluster_foam(cell, list(counts), volumes=share, centre=middles)
    net, k, n = foam.network, len(counts), sum(counts)
    assert foam.exterior == n == foam.n_bubbles - 1
    assert net.bubble_euler.tolist() == [1] * n + [cell.surface.euler_characteristic - k]
    assert net.euler_characteristic == cell.surface.euler_characteristic
    assert net.charges[:n].sum() == 6 * k + net.sides[n]
    assert foam.bubble_volumes.sum() == pytest.approx(cell.volume, rel=1e-12)
    assert (foam.bubble_volumes > 0.0).all()
    # rough, but of the right size
    assert (np.abs(foam.bubble_volumes[:n] / share - 1.0) < 0.5).all()


@pytest.mark.parametrize(("n", "length"), [(1, 2 * np.sqrt(np.pi)), (2, 6.359129), (3, 8.793934)])
def test_flat_limits(n: int, length: float) -> None:
    """Length of one, two and three bubbles of unit area; 2 Σ p A = γ L at any size of cluster."""
    foam = wf.cluster_foam(replace(SHEET, gap=1.0), n, volumes=1.0, centre=[3.0, 2.0, 0.0], orientation=0.4)
    relaxed = wf.relax(foam)
    assert relaxed.converged, relaxed.message
    assert relaxed.energy == pytest.approx(length, abs=1e-6)
    assert relaxed.pressures[n] == 0.0


@pytest.mark.parametrize("n", [4, 7, 19])
def test_pressures_of_flat_clusters(n: int) -> None:
    volumes = 0.5 * (1.0 + 0.2 * np.sin(np.arange(n)))
    relaxed = wf.relax(wf.cluster_foam(SHEET, n, volumes=volumes, centre=[0.0, 0.0, 0.0]), t1=False)
    assert relaxed.converged, relaxed.message
    work = 2.0 * float(relaxed.pressures @ relaxed.foam.bubble_volumes)
    assert work == pytest.approx(relaxed.energy, rel=1e-9)
    assert np.abs(relaxed.foam.bubble_volumes[:n] / volumes - 1.0).max() < 1e-11


@pytest.mark.parametrize("area", [0.05, 1.0, 5.0])
def test_one_bubble_on_a_sphere(area: float) -> None:
    """L² = 4πA − GA² to 1e-9, and p = dE/dV."""
    centre = np.array([1.0, 2.0, -0.5])
    volume = area * SPHERE.volume / SPHERE.surface.area
    foam = wf.cluster_foam(SPHERE, 1, volumes=volume, centre=centre, max_turn=30.0, order=8)
    relaxed = wf.relax(foam, tolerance=1e-11)
    assert relaxed.converged, relaxed.message
    a, length = relaxed.foam.bubble_areas[0], relaxed.foam.film_lengths.sum()
    assert a == pytest.approx(area, rel=1e-12)
    assert length**2 == pytest.approx(4 * np.pi * a - a * a, rel=1e-9)
    slope = (4 * np.pi - 2 * a) / (2 * length) * relaxed.energy / length / (volume / a)
    assert relaxed.pressures[0] == pytest.approx(slope, rel=1e-8, abs=1e-10)
    assert relaxed.pressures[1] == 0.0


def test_clusters_do_not_know_of_each_other() -> None:
    """Two clusters on a sphere have the energies of each alone, wherever they lie and however turned."""
    volumes = 0.02 * SPHERE.volume
    alone = [wf.relax(wf.cluster_foam(SPHERE, n, volumes=volumes)).energy for n in (2, 3)]
    turn = Rotation.from_rotvec([0.3, 1.0, -0.2])
    centre = turn.apply([[1.0, 0.0, 0.0], [-0.3, 1.0, 0.1]])
    both = wf.relax(wf.cluster_foam(SPHERE, [2, 3], volumes=volumes, centre=centre, orientation=[0.1, 0.7]))
    assert both.converged, both.message
    assert both.energy == pytest.approx(sum(alone), rel=1e-10)
    assert wf.cluster_clearance(both.foam) > 0.5


def test_relabelling() -> None:
    """Which bubble is the exterior and how vertices are numbered makes no difference."""
    foam = wf.cluster_foam(TORUS, 3, volumes=0.5, centre=[30.0, 0.0, 0.0])
    net = foam.network
    place = np.array([1, 2, 3, 0])
    euler = np.empty(4, dtype=np.int64)
    euler[place] = net.bubble_euler
    targets = np.empty(4)
    targets[place] = foam.target_volumes
    other = wf.Foam(
        foam.cell,
        wf.CellNetwork(net.next, net.origin, place[net.bubble], euler),
        foam.vertex_points,
        foam.film_offsets,
        targets,
    )
    assert other.exterior == 0
    one, two = wf.relax(foam), wf.relax(other)
    assert one.converged
    assert two.converged
    assert two.energy == pytest.approx(one.energy, rel=1e-11)
    np.testing.assert_allclose(two.pressures[place], one.pressures, rtol=1e-7, atol=1e-9)


def test_a_free_cluster_drifts_to_the_outer_equator() -> None:
    """Minimising is drifting: from 60° up the tube to φ = 0, without help; markers follow."""
    at = TORUS.surface.points(np.array([1.0]), np.array([0.5]))[0]
    relaxed = wf.relax(wf.cluster_foam(TORUS, 7, volumes=0.5, centre=at))
    assert relaxed.converged, relaxed.message
    centre = relaxed.foam.bubble_centres[:7].mean(axis=0)
    assert abs(TORUS.surface.angles(centre[None])[0][0]) < 1e-4
    chords = relaxed.foam.film_lengths / relaxed.foam.bubble_size
    assert chords.min() > 0.3


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("cell", [SHEET, TORUS], ids=["sheet", "torus"])
def test_random_clusters_relax_with_t1s(cell: wf.HeleShawCell, seed: int) -> None:
    foam = wf.cluster_foam(cell, 12, volumes=0.5, layout="random", seed=seed, centre=[24.0, 0.0, 0.0])
    assert foam.seed == seed
    relaxed = wf.relax(foam)
    assert relaxed.converged, relaxed.message
    net = relaxed.foam.network
    assert net.bubble_euler[12] == -1
    assert net.charges[:12].sum() == 6 + net.sides[12]


def test_t1s_at_the_outline() -> None:
    """A film between a bubble and the exterior turns: the bubble leaves the outline."""
    foam = wf.relax(wf.cluster_foam(TORUS, 19, volumes=0.5, max_turn=150.0, centre=[30.0, 0, 0])).foam
    net = foam.network
    films = np.arange(net.n_films)
    fine = allowed(net, t1_sites(net, films))
    outer = films[fine & ((net.left == 19) | (net.right == 19))]
    assert len(outer) >= 6
    film = int(outer[0])
    turned = wf.t1(foam, film)
    assert turned.exterior == 19
    assert turned.network.sides[19] == net.sides[19] - 1
    assert turned.network.bubble_euler.tolist() == net.bubble_euler.tolist()
    four = rewire(rewire(rewire(rewire(net, [film]), [film]), [film]), [film])
    assert np.array_equal(four.next, net.next)
    # a film with the exterior at both ends would part the cluster: not a T1
    pair = wf.cluster_foam(TORUS, 2, volumes=0.5).network
    between = np.flatnonzero((pair.left < 2) & (pair.right < 2))
    assert not allowed(pair, t1_sites(pair, between)).any()


def test_links_carry_markers_along() -> None:
    """Steps of a rigid motion of the plane do not stretch links, so markers follow at no cost."""
    from warpedfoam.relax.held import held_vertices

    foam = wf.cluster_foam(SHEET, 2, volumes=0.5, centre=[0.0, 0.0, 0.0])
    held = held_vertices(SHEET.surface, foam.network, foam.vertex_points, foam.film_offsets)
    assert held is not None
    assert LINK > 0.0
    assert len(held.linked) == 8
    frames = SHEET.surface.vertex_frames(foam.vertex_points)
    for motion in ([1.0, 0.3, 0.0] + 0 * foam.vertex_points, np.cross([0.0, 0.0, 1.0], foam.vertex_points)):
        steps = np.einsum("vix,vx->vi", frames, motion)
        net = foam.network
        ends = np.concatenate([steps[net.tails[held.linked]], steps[net.heads[held.linked]]], axis=1)
        assert np.abs(np.einsum("im,mi->m", held.links, ends)).max() < 1e-14


def test_geodesics_of_the_chart() -> None:
    """On a sphere the chart keeps distances from the centre; on a sheet everything."""
    plane = np.random.default_rng(0).normal(size=(20, 2))
    x = geodesic_chart(SPHERE.surface, np.array([0.0, 0.6, 0.8]), plane, 0.3)
    np.testing.assert_allclose(np.arccos(x @ [0.0, 0.6, 0.8]), np.linalg.norm(plane, axis=1), rtol=2e-3)
    y = geodesic_chart(SHEET.surface, np.zeros(3), plane, 0.0)
    gaps = np.linalg.norm(y[:, None] - y[None], axis=2)
    np.testing.assert_allclose(gaps, np.linalg.norm(plane[:, None] - plane[None], axis=2), atol=1e-12)


def test_files_keep_the_exterior(tmp_path: Path) -> None:
    foam = wf.cluster_foam(SPHERE, 2, volumes=0.02 * SPHERE.volume, centre=[0, 0, 1.0])
    assert foam.network.bubble_euler.tolist() == [1, 1, 1]
    assert wf.load(wf.save(tmp_path / "a.npz", foam)).exterior == foam.exterior == 2


class TestRefusals:
    def test_round_a_thin_torus(self) -> None:
        thin = wf.HeleShawCell(wf.Torus(20.0, 1.0), gap=0.1)
        with pytest.raises(wf.TopologyError, match="cluster 0 touches itself near"):
            wf.cluster_foam(thin, 37, volumes=0.1)
        assert wf.cluster_foam(thin, 7, volumes=0.1).n_bubbles == 8

    def test_clusters_that_touch(self) -> None:
        with pytest.raises(wf.TopologyError, match="clusters 0 and 1 touch"):
            wf.cluster_foam(TORUS, [7, 7], volumes=0.5, centre=[[24.0, 0.0, 0.0], [24.0, 2.0, 0.0]])

    def test_a_cluster_at_a_rim(self) -> None:
        cell = wf.HeleShawCell(wf.Cylinder(radius=3.0, height=8.0), gap=0.2)
        with pytest.raises(wf.TopologyError, match="touches the rim"):
            wf.cluster_foam(cell, 7, volumes=0.2, centre=[3.0, 0.0, 3.8])
        relaxed = wf.relax(wf.cluster_foam(cell, 3, volumes=0.2, centre=[3.0, 0.0, 0.3]))
        assert relaxed.converged, relaxed.message
        assert relaxed.foam.network.bubble_euler[3] == -1

    @pytest.mark.parametrize(
        ("change", "fault", "message"),
        [
            ({"n_bubbles": 0}, ValueError, "n_bubbles must be at least 1"),
            ({"n_bubbles": []}, ValueError, "n_bubbles is empty"),
            ({"n_bubbles": None}, TypeError, "n_bubbles must be given"),
            ({"n_bubbles": 2.5}, TypeError, "n_bubbles must be an integer"),
            ({"volumes": 0.0}, ValueError, "volumes must be above 0"),
            ({"volumes": [0.5]}, ValueError, "volumes must have shape"),
            ({"volumes": 1e4}, ValueError, "leave a tenth of the cell empty"),
            ({"layout": "square"}, ValueError, "layout must be"),
            ({"layout": "random"}, ValueError, 'layout="random" needs a seed'),
            ({"layout": [[0.0, 0.0]]}, ValueError, "n_bubbles says 3, but layout holds 1"),
            ({"layout": [[0.0, 0.0], [0.05, 0.0], [1.0, 0.0]]}, ValueError, "closer than a fifth"),
            ({"layout": [[0.0, 0.0], [1.0, 0.0], [6.0, 0.0]]}, ValueError, "makes 2 outlines"),
            ({"centre": [[24.0, 0.0, 0.0]] * 2}, ValueError, "centre must hold 1 points"),
            ({"max_turn": 5.0}, ValueError, "max_turn must be"),
            ({"order": 1}, ValueError, "order must be"),
            ({"cell": None}, TypeError, "cell must be a HeleShawCell"),
        ],
    )
    def test_bad_arguments(self, change: dict, fault: type[Exception], message: str) -> None:
        arguments = {"cell": TORUS, "n_bubbles": 3, "volumes": 0.5, **change}
        with pytest.raises(fault, match=message):
            wf.cluster_foam(arguments.pop("cell"), arguments.pop("n_bubbles"), **arguments)

    def test_exteriors_that_are_none(self) -> None:
        foam = wf.cluster_foam(TORUS, 2, volumes=0.5)
        with pytest.raises(ValueError, match="exterior must be at most 2"):
            replace(foam, exterior=3)
        with pytest.raises(ValueError, match="must have an exterior"):
            wf.cluster_clearance(wf.voronoi_foam(SPHERE, 20, seed=0))


def test_bubbles_too_small_for_their_digits_are_refused() -> None:
    """A gap of 1e6 on a sphere of 10 leaves a volume of a half next to no area."""
    with pytest.raises(ValueError, match="too few digits; take larger volumes, or a smaller gap"):
        wf.cluster_foam(wf.HeleShawCell(wf.Sphere(10.0), 1e6), 7, volumes=0.5)
