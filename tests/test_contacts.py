"""Clusters that meet and part: markers, joins, rings, enclosed regions, relaxations with contacts."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import warpedfoam as wf
from warpedfoam.kernels.periodic import nearest_image
from warpedfoam.moves.join import join_arrays, rewire_join
from warpedfoam.moves.markers import divide, layout_of, steepness
from warpedfoam.moves.part import may_part, rewire_part
from warpedfoam.relax.marking import STEEP
from warpedfoam.relax.system import State, unfolded

SHEET = wf.HeleShawCell(wf.FlatTorus(20.0, 20.0), gap=1.0)
TORUS = wf.HeleShawCell(wf.Torus(20.0, 4.0), gap=0.5)
SPHERE = wf.HeleShawCell(wf.Sphere(10.0), gap=0.5)
EGG = wf.HeleShawCell(wf.Ellipsoid(4.0, 3.0, 3.5), gap=0.2)
ONE, TWO, THREE = 2 * np.sqrt(np.pi), 6.359129, 8.793934


def outer(foam: wf.Foam, bubble: int) -> np.ndarray:
    """Films between a bubble and the exterior."""
    net = foam.network
    pair = np.sort(np.stack([net.left, net.right]), axis=0)
    return np.flatnonzero((pair[0] == bubble) & (pair[1] == foam.exterior))


def between(foam: wf.Foam) -> np.ndarray:
    """Films that do not face the exterior."""
    net = foam.network
    return np.flatnonzero((net.left != foam.exterior) & (net.right != foam.exterior))


def nearest(foam: wf.Foam, a: int, b: int) -> list[int]:
    """Outer films of two bubbles whose middles are closest."""
    ours, theirs = outer(foam, a), outer(foam, b)
    middle = foam.film_curves(3)[:, 1]
    gap = middle[ours][:, None] - middle[theirs][None]
    gap = nearest_image(gap, foam.cell.surface.period)
    i, j = np.unravel_index(np.linalg.norm(gap, axis=2).argmin(), gap.shape[:2])
    return [int(ours[i]), int(theirs[j])]


def moved(foam: wf.Foam, bubble: int, way: np.ndarray) -> wf.Foam:
    """A bubble that touches no other one, carried along a sheet."""
    films = outer(foam, bubble)
    mine = np.unique(foam.network.tails[films])
    points = foam.vertex_points.copy()
    points[mine] += way
    return replace(foam, vertex_points=points)


class TestMarkers:
    @pytest.mark.parametrize(
        ("cell", "close"), [(SHEET, 1e-11), (TORUS, 1e-10), (SPHERE, 1e-11), (EGG, 1e-6)]
    )
    def test_put_on_and_taken_off(self, cell: wf.HeleShawCell, close: float) -> None:
        """Curves stay: energy and volumes; taking off is the inverse, number for number."""
        foam = wf.relax(wf.cluster_foam(cell, 4, volumes=0.4, order=12)).foam
        films = np.arange(foam.network.n_films)
        more = wf.add_markers(foam, films, np.linspace(0.2, 0.8, len(films)))
        assert more.network.n_films == 2 * len(films)
        assert more.energy == pytest.approx(foam.energy, rel=close)
        np.testing.assert_allclose(more.bubble_volumes[:4], foam.bubble_volumes[:4], rtol=close)
        again = wf.remove_markers(more, np.arange(foam.network.n_vertices, more.network.n_vertices))
        for name in ("next", "origin", "bubble"):
            assert np.array_equal(getattr(again.network, name), getattr(foam.network, name))
        np.testing.assert_allclose(again.film_offsets, foam.film_offsets, atol=50 * close)

    def test_refusals(self) -> None:
        foam = wf.cluster_foam(SHEET, [1, 2], volumes=1.0)
        with pytest.raises(ValueError, match="names a film twice"):
            wf.add_markers(foam, [0, 0])
        with pytest.raises(ValueError, match=r"between 0\.05 and 0\.95"):
            wf.add_markers(foam, [0], 0.01)
        corner = int(np.flatnonzero(foam.network.vertex_degrees == 3)[0])
        with pytest.raises(wf.TopologyError, match="is no marker"):
            wf.remove_markers(foam, [corner])
        with pytest.raises(wf.TopologyError, match="share a film"):
            wf.remove_markers(foam, foam.network.markers[:2])
        left = foam
        while len(outer(left, 0)) > 2:
            net = left.network
            mine = np.unique(net.tails[outer(left, 0)])
            left = wf.remove_markers(left, mine[:1])
        with pytest.raises(wf.TopologyError, match="begin and end at one vertex"):
            wf.remove_markers(left, np.unique(left.network.tails[outer(left, 0)])[:1])


class TestRewiring:
    @pytest.mark.parametrize("seed", range(6))
    def test_part_is_the_inverse_of_join(self, seed: int) -> None:
        """Any two films of two clusters: valid, χ kept, and back to the same network."""
        rng = np.random.default_rng(seed)
        cell = (TORUS, SPHERE)[seed % 2]
        counts = rng.integers(1, 6, 2).tolist()
        foam = wf.cluster_foam(cell, counts, volumes=0.5, layout="random", seed=seed)
        net, ext = foam.network, foam.exterior
        pair = np.array([rng.choice(outer(foam, 0)), rng.choice(outer(foam, counts[0]))])
        cut = divide(cell.surface, layout_of(foam), pair, rng.uniform(0.3, 0.7, 2)).network
        joined = rewire_join(cut, net.n_vertices, net.n_vertices + 1, ext)
        assert joined.euler_characteristic == cell.surface.euler_characteristic
        assert joined.bubble_euler[ext] == net.bubble_euler[ext] + 1
        assert (joined.n_films, joined.n_vertices) == (cut.n_films + 1, cut.n_vertices)
        assert may_part(joined, np.arange(joined.n_films), ext)[-1]
        back = rewire_part(joined, joined.n_films - 1, ext)
        for name in ("next", "origin", "bubble", "bubble_euler"):
            assert np.array_equal(getattr(back, name), getattr(cut, name))
        # the order of the two makes no difference
        other = rewire_join(cut, net.n_vertices + 1, net.n_vertices, ext)
        assert np.array_equal(np.sort(other.sides), np.sort(joined.sides))
        assert np.array_equal(np.sort(other.charges), np.sort(joined.charges))

    def test_refusals(self) -> None:
        foam = wf.cluster_foam(TORUS, [2, 1], volumes=0.5)
        net = foam.network
        inside = int(between(foam)[0])
        corner = int(net.tails[inside])
        with pytest.raises(wf.TopologyError, match="is no marker"):
            join_arrays(net, corner, int(net.markers[0]), foam.exterior)
        film = int(outer(foam, 2)[0])
        with pytest.raises(wf.TopologyError, match="lie on one film"):
            join_arrays(net, int(net.tails[film]), int(net.heads[film]), foam.exterior)
        with pytest.raises(wf.TopologyError, match="cannot be parted"):
            wf.part(foam, film)
        with pytest.raises(wf.TopologyError, match="does not lie between a bubble and the exterior"):
            wf.join(foam, [inside, film])
        with pytest.raises(wf.TopologyError, match="films must differ"):
            wf.join(foam, [film, film])
        with pytest.raises(ValueError, match="at must lie between"):
            wf.join(foam, [int(outer(foam, 0)[0]), film], at=[0.5, 1.5])
        full = wf.voronoi_foam(SPHERE, 20, seed=0)
        for move in (lambda: wf.join(full, [0, 1]), lambda: wf.part(full, 0)):
            with pytest.raises(ValueError, match="must have an exterior"):
                move()
        assert wf.with_contacts(full) == (full, ())


def test_gap_of_two_disks() -> None:
    """D − 2r, where the lines between them are sampled: to second order in the spacing."""
    foam = wf.relax(wf.cluster_foam(SHEET, [1, 1], volumes=1.0, centre=[[0, 0, 0], [2.0, 0, 0]])).foam
    for gap in (0.3, 0.05, -0.02):
        away = foam.bubble_centres[1, 0] - foam.bubble_centres[0, 0] - 2.0 / np.sqrt(np.pi) - gap
        near = moved(foam, 1, np.array([-away, 0.0, 0.0]))
        assert wf.outline_gap(near) == pytest.approx(gap, abs=1.5e-3)
    assert wf.outline_gap(foam) == np.inf


def test_two_bubbles_brought_into_contact_make_a_double() -> None:
    """Either by hand or by `relax`; parted again they are two disks."""
    foam = wf.relax(wf.cluster_foam(SHEET, [1, 1], volumes=1.0, centre=[[0, 0, 0], [2.0, 0, 0]])).foam
    assert foam.energy == pytest.approx(2 * ONE, abs=1e-6)
    way = 0.004 + 2.0 / np.sqrt(np.pi) - foam.bubble_centres[1, 0] + foam.bubble_centres[0, 0]
    near = moved(foam, 1, np.array([way, 0.0, 0.0]))
    alone = wf.relax(near, contacts=False)
    assert alone.energy == pytest.approx(2 * ONE, abs=1e-6)
    assert alone.contacts == ()
    # as it stands nothing pulls them together, but they are near enough to be in contact
    touched, events = wf.with_contacts(near)
    assert [(e.kind, e.bubbles, e.enclosed) for e in events] == [("join", (0, 1), None)]
    assert touched.energy < near.energy + 0.1
    double = wf.relax(touched)
    assert double.converged, double.message
    assert double.energy == pytest.approx(TWO, abs=1e-6)
    assert double.foam.network.bubble_euler.tolist() == [1, 1, -1]
    assert wf.with_contacts(double.foam)[1] == ()
    apart = wf.relax(wf.part(double.foam, int(between(double.foam)[0])), contacts=False)
    assert apart.energy == pytest.approx(2 * ONE, abs=1e-6)
    assert apart.foam.network.bubble_euler.tolist() == [1, 1, -2]


def test_bubbles_that_grow_meet() -> None:
    foam = wf.relax(wf.cluster_foam(SHEET, [1, 1], volumes=2.5, centre=[[0, 0, 0], [3.0, 0, 0]])).foam
    foam = moved(foam, 1, np.array([-1.1, 0.0, 0.0]))
    grown = wf.relax(replace(foam, target_volumes=[3.0, 3.0, SHEET.volume - 6.0]))
    assert grown.converged, grown.message
    assert [(e.kind, e.bubbles) for e in grown.contacts] == [("join", (0, 1))]
    assert grown.energy == pytest.approx(TWO * np.sqrt(3.0), abs=2e-6)
    assert grown.volume_error < 1e-10


def test_three_bubbles_make_a_triple() -> None:
    """A third bubble touches a double beside its notch: one contact, then a T1 with the exterior."""
    start = wf.cluster_foam(SHEET, [2, 1], volumes=1.0, centre=[[0, 0, 0], [0.05, 1.9, 0]])
    foam = wf.relax(start).foam
    while wf.outline_gap(foam) > 0.1:
        foam = moved(foam, 2, np.array([0.0, -0.05, 0.0]))
    while wf.outline_gap(foam) > 0.004:
        foam = moved(foam, 2, np.array([0.0, -0.002, 0.0]))
    found = wf.relax(foam)
    assert found.converged, found.message
    assert (len(found.contacts), found.n_t1) == (1, 1)
    assert found.energy == pytest.approx(THREE, abs=1e-6)
    assert wf.cluster_charges(found.foam).sum() == 6
    # whoever is called what
    net, place = foam.network, np.array([2, 3, 1, 0])
    euler, targets = np.empty(4, dtype=np.int64), np.empty(4)
    euler[place], targets[place] = net.bubble_euler, foam.target_volumes
    other = wf.Foam(
        foam.cell,
        wf.CellNetwork(net.next, net.origin, place[net.bubble], euler),
        foam.vertex_points,
        foam.film_offsets,
        targets,
        exterior=0,
    )
    again = wf.relax(other)
    assert again.energy == pytest.approx(found.energy, rel=1e-10)
    assert [sorted(e.bubbles) for e in again.contacts] == [
        sorted(place[list(e.bubbles)].tolist()) for e in found.contacts
    ]


class TestRings:
    HEIGHT, COUNT = 6.0, 5

    def ring(self) -> wf.Foam:
        """A row of bubbles round a flat torus, joined end to end."""
        cell = wf.HeleShawCell(wf.FlatTorus(20.0, self.HEIGHT), gap=1.0)
        row = np.stack([1.0746 * np.arange(self.COUNT), np.zeros(self.COUNT)], axis=1)
        foam = wf.cluster_foam(
            cell, volumes=1.0, layout=row, orientation=np.pi / 2, centre=[1.0, 0.5, 0.0], order=12
        )
        return wf.join(foam, nearest(foam, 0, self.COUNT - 1))

    def test_closed_form(self) -> None:
        """Flat films w and arcs of 60° and radius h/n between them; two outlines, charge 0."""
        start = self.ring()
        assert start.network.bubble_euler[self.COUNT] == 0
        found = wf.relax(start)
        assert found.converged, found.message
        pitch = self.HEIGHT / self.COUNT
        segment = 0.5 * pitch**2 * (np.pi / 3 - np.sqrt(0.75))
        width = (1.0 - 2.0 * segment) / pitch
        length = self.COUNT * (width + 2.0 * np.pi / 3 * pitch)
        assert found.energy == pytest.approx(length, rel=1e-11)
        np.testing.assert_allclose(found.pressures[: self.COUNT], 1.0 / pitch, rtol=1e-8)
        assert wf.cluster_charges(found.foam).tolist() == [0] * (self.COUNT + 1)
        assert found.foam.n_bubbles == self.COUNT + 1

    def test_what_goes_round_cannot_turn(self) -> None:
        foam = self.ring()
        net = foam.network
        state = State(net, foam.vertex_points, foam.film_offsets, np.zeros(foam.n_bubbles))
        part = np.zeros(net.n_vertices, dtype=np.int64)
        assert unfolded(foam.cell, state, part)[1].tolist() == [True]
        # a cluster across the edge of the sheet is one piece, whichever copies its vertices are in
        foam = wf.cluster_foam(SHEET, 3, volumes=1.0, centre=[9.9, -9.9, 0.0])
        wrapped = nearest_image(foam.vertex_points, SHEET.surface.period)
        state = State(foam.network, wrapped, foam.film_offsets, np.zeros(4))
        part = np.zeros(foam.network.n_vertices, dtype=np.int64)
        whole, rounds = unfolded(SHEET, state, part)
        assert rounds.tolist() == [False]
        gap = whole - foam.vertex_points
        assert np.abs(gap - gap[0]).max() < 1e-12
        assert np.ptp(wrapped[:, 0]) > 15.0

    def test_a_cluster_grows_round_a_thin_torus(self) -> None:
        """Seven bubbles meet themselves: an exterior of two outlines, still one region."""
        cell = wf.HeleShawCell(wf.Torus(20.0, 1.0), gap=0.1)
        foam = wf.cluster_foam(cell, 7, volumes=0.25, centre=[21.0, 0, 0], order=6)
        assert foam.network.bubble_euler[7] == -1
        volumes = np.full(8, 0.5)
        volumes[7] = cell.volume - 3.5
        found = wf.relax(replace(foam, target_volumes=volumes))
        assert found.converged, found.message
        assert [e.kind for e in found.contacts] == ["join"]
        assert found.foam.network.bubble_euler.tolist() == [1] * 7 + [0]
        assert wf.cluster_charges(found.foam).sum() == 0
        assert found.volume_error < 1e-10

    @pytest.mark.parametrize("cell", [SHEET, SPHERE, TORUS], ids=["sheet", "sphere", "torus"])
    def test_an_enclosed_region_is_a_bubble(self, cell: wf.HeleShawCell) -> None:
        """A row bent round a hole and closed: the hole holds what it holds, the exterior stays one."""
        turn = 2 * np.pi * np.arange(6) / 7
        row = 1.0746 / (2 * np.sin(np.pi / 7)) * np.stack([np.cos(turn), np.sin(turn)], axis=1)
        foam = wf.cluster_foam(cell, volumes=0.2, layout=row, centre=[24.0, 0.0, 0.0])
        assert len(wf.cluster_labels(foam)) == 7
        closed = wf.join(foam, nearest(foam, 0, 5))
        assert closed.n_bubbles == 8
        assert closed.exterior == 6
        assert closed.bubble_ids.tolist() == list(range(8))
        euler = cell.surface.euler_characteristic
        assert closed.network.bubble_euler.tolist() == [1] * 6 + [euler - 1, 1]
        assert 0.0 < closed.target_volumes[7] < 0.5
        assert closed.target_volumes.sum() == pytest.approx(cell.volume, rel=1e-12)
        assert closed.target_volumes[7] == pytest.approx(closed.bubble_volumes[7], rel=1e-9)
        found = wf.relax(closed)
        assert found.converged, found.message
        charges = wf.cluster_charges(found.foam)
        assert charges.sum() == 6
        assert charges[7] == 6 - found.foam.network.sides[7]


class TestRandom:
    @pytest.mark.parametrize("seed", range(3))
    def test_clusters_relax(self, seed: int) -> None:
        """Outlines rearrange beside markers; none is left short, none too steep."""
        rng, cell = np.random.default_rng(seed), SPHERE
        volumes = 0.5 * np.exp(0.3 * rng.normal(size=30))
        foam = wf.cluster_foam(cell, 30, volumes=volumes, layout="random", seed=seed, order=6)
        found = wf.relax(foam)
        assert found.converged, found.message
        assert wf.cluster_charges(found.foam).sum() == 6
        assert found.foam.network.bubble_euler[30] == cell.surface.euler_characteristic - 1
        films = outer_films(found.foam)
        assert steepness(found.foam.film_offsets)[films].max() < STEEP + 0.1
        assert wf.with_contacts(found.foam)[0] is found.foam

    @pytest.mark.parametrize("seed", range(5))
    def test_charges_add_up(self, seed: int) -> None:
        rng = np.random.default_rng(seed)
        counts = rng.integers(1, 12, 3).tolist()
        foam = wf.cluster_foam(TORUS, counts, volumes=0.3, layout="random", seed=seed)
        labels, charges = wf.cluster_labels(foam), wf.cluster_charges(foam)
        assert np.array_equal(np.bincount(labels[labels >= 0]), counts)
        assert np.bincount(labels[labels >= 0], charges[labels >= 0]).tolist() == [6.0, 6.0, 6.0]
        assert (labels[foam.exterior], charges[foam.exterior]) == (-1, 0)

    def test_charges_without_an_exterior(self) -> None:
        full = wf.voronoi_foam(SPHERE, 20, seed=0)
        assert np.array_equal(wf.cluster_charges(full), full.network.charges)
        assert (wf.cluster_labels(full) == 0).all()


def outer_films(foam: wf.Foam) -> np.ndarray:
    return np.flatnonzero((foam.network.left == foam.exterior) | (foam.network.right == foam.exterior))
