"""Which points of outlines face each other, have met, or would cross: on outlines drawn by hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import warpedfoam as wf
from warpedfoam.moves.enclosed import Half, _holds
from warpedfoam.relax.contacts import WINDOW, _loose, shares_of
from warpedfoam.relax.outlines import MEET, Outlines, facing, met, safe_share

SHEET = wf.HeleShawCell(wf.FlatTorus(20.0, 20.0), gap=1.0)
#: Two clusters of one bubble each: no film between bubbles, so nothing is beside one.
APART = wf.cluster_foam(SHEET, [1, 1], volumes=1.0, centre=[[0.0, 5.0, 0.0], [0.0, -5.0, 0.0]])
SHARES = np.ones(3)


def hairpin(
    gap: float, *, along: float = 10.0, around: float = 1e3, bubbles: tuple[int, int] = (0, 1), loops=(0, 0)
) -> Outlines:
    """Two straight outlines facing each other across a gap, ``along`` one loop from end to end."""
    x = np.linspace(0.0, 0.3, 9)
    points = np.zeros((2, 9, 3))
    points[0, :, 0], points[1, :, 0] = x, x[::-1]
    points[1, :, 1] = gap
    normals = np.zeros((2, 9, 3))
    normals[0, :, 1], normals[1, :, 1] = 1.0, -1.0
    place = np.stack([x, x[::-1] + along])
    return Outlines(
        np.array([0, 6]),
        np.array(bubbles),
        points,
        normals,
        np.array(loops),
        place,
        np.full(2, around),
    )


def pairs_of(lines: Outlines, reach: float = 0.05, shares: np.ndarray = SHARES):
    return facing(SHEET, lines, shares, 1.0, reach, 0.06)


@pytest.mark.parametrize("gap", [0.03, 0.004, -0.02])
def test_gaps_are_signed_distances(gap: float) -> None:
    pairs = pairs_of(hairpin(gap))
    assert len(pairs.gap)
    np.testing.assert_allclose(pairs.gap, gap, atol=1e-14)
    np.testing.assert_allclose(np.abs(pairs.across[:, 1]), 1.0)
    assert (pairs.scale == 1.0).all()
    assert not len(pairs_of(hairpin(0.06)).gap)


def test_outlines_that_face_the_same_way_or_away_do_not_face() -> None:
    lines = hairpin(0.02)
    for second in ([0.0, 1.0, 0.0], [0.9, -0.43, 0.0]):
        lines.normals[1] = second
        assert not len(pairs_of(lines).gap)


def test_a_bend_of_one_outline_is_no_contact() -> None:
    """Along it, either way round, points must be 0.75 bubble sizes apart and 5 times their distance."""
    assert len(pairs_of(hairpin(0.02, along=1.5)).gap)
    assert not len(pairs_of(hairpin(0.02, along=0.3)).gap)
    # the other way round is the shorter one
    assert not len(pairs_of(hairpin(0.02, along=9.5, around=10.0)).gap)
    # two outlines are as far apart as can be
    assert len(pairs_of(hairpin(0.02, along=0.1, loops=(0, 1))).gap)
    # a wide bend: far along, yet not against its width
    assert len(pairs_of(hairpin(0.3, along=2.5), reach=0.6).gap)
    assert not len(pairs_of(hairpin(0.3, along=1.15), reach=0.6).gap)
    # beside a bubble of a quarter of the size half as far will do
    small = np.array([1.0, 0.25, 1.0])
    assert not len(pairs_of(hairpin(0.02, along=0.7)).gap)
    assert len(pairs_of(hairpin(0.02, along=0.8), shares=small).gap)
    assert (pairs_of(hairpin(0.02), shares=small).scale == 0.5).all()


def met_of(lines: Outlines, shares: np.ndarray = SHARES) -> bool:
    pairs = pairs_of(lines, shares=shares)
    network, points = APART.network, APART.vertex_points
    return bool(met(SHEET, network, points, lines, pairs, 1.0, WINDOW).any())


def test_the_window_of_contacts() -> None:
    """Closer than 0.006 or crossed by 0.03 sizes of the smaller bubble; one with itself, by 0.006."""
    for gap, different, same in ((0.008, 0, 0), (0.004, 1, 1), (-0.004, 1, 1), (-0.02, 1, 0), (-0.04, 0, 0)):
        assert met_of(hairpin(gap)) == bool(different)
        assert met_of(hairpin(gap, bubbles=(1, 1))) == bool(same)
    small = np.array([1.0, 0.25, 1.0])
    assert not met_of(hairpin(0.004), small)
    assert met_of(hairpin(0.0025), small)
    assert not met_of(hairpin(-0.02), small)


def test_steps_end_where_outlines_meet() -> None:
    one = hairpin(0.1)
    points, network = APART.vertex_points, APART.network
    for change, share in ((-0.05, 1.0), (-0.2, (0.1 - MEET) / 0.2), (0.3, 1.0)):
        two = hairpin(0.1 + change)
        found = safe_share(SHEET, network, points, one, two, SHARES, 1.0)
        assert found == pytest.approx(share, rel=1e-12)


def test_films_let_go_unless_they_are_pulled_open() -> None:
    """At rest, at 120°, a film that has all but vanished is lost; one whose neighbours pull harder is not."""
    double = wf.relax(wf.cluster_foam(SHEET, 2, volumes=1.0, centre=[0.0, 0.0, 0.0])).foam
    inner = np.flatnonzero((double.network.left != 2) & (double.network.right != 2))

    def loose(foam: wf.Foam, length: float) -> np.ndarray:
        arrays = foam.network, foam.vertex_points, foam.film_offsets
        assert foam.exterior is not None
        return _loose(foam.cell, *arrays, foam.exterior, length, shares_of(foam))

    # seen from afar every film is short
    assert loose(double, 1e3).tolist() == inner.tolist()
    assert loose(double, 1.0).tolist() == []
    # drawn together, its ends are pulled apart
    ends = np.stack([double.network.tails[inner], double.network.heads[inner]])[:, 0]
    points = double.vertex_points.copy()
    points[ends] = 0.4 * points[ends] + 0.6 * points[ends].mean(axis=0)
    assert loose(replace(double, vertex_points=points), 1e3).tolist() == []


def test_what_lies_left_of_a_loop() -> None:
    """Beside a long bubble: not in it, hence in all the rest; what is in it is not in the rest."""
    cell = wf.HeleShawCell(wf.Sphere(10.0), gap=0.5)
    spots = np.array([[10.0, 0.0, 0.0], [10.0, 0.0, 1.6], [-10.0, 0.0, 0.0]])
    foam = wf.cluster_foam(cell, [1, 1, 1], volumes=0.5, centre=spots, order=4)
    net, exterior = foam.network, foam.exterior
    owner = net.bubble[np.arange(len(net.bubble)) ^ 1]
    outer = net.bubble == exterior
    rings = [np.flatnonzero(outer & (owner == bubble)) for bubble in range(3)]
    # the loop round the first, drawn out to an ellipse across the way to the second; in order
    half = start = int(rings[0][0])
    loop = [half]
    while (half := int(net.next[half])) != start:
        loop.append(half)
    points = foam.vertex_points.copy()
    mine = np.unique(net.origin[rings[0]])
    points[mine, 1] *= 6.0
    points = cell.surface.project(points)
    after = Half(net.next, net.origin, points, np.zeros_like(foam.film_offsets))
    whole = cell.surface.area
    for bubble in (1, 2):
        assert not _holds(cell.surface, after, np.array(loop), rings[bubble], 0.01 * whole)
        assert _holds(cell.surface, after, np.array(loop), rings[bubble], 0.99 * whole)
    inside = points.copy()
    other = np.unique(net.origin[rings[1]])
    inside[other] = cell.surface.project(spots[0] + 0.05 * (inside[other] - inside[other].mean(axis=0)))
    after = Half(net.next, net.origin, inside, np.zeros_like(foam.film_offsets))
    assert _holds(cell.surface, after, np.array(loop), rings[1], 0.01 * whole)
    assert not _holds(cell.surface, after, np.array(loop), rings[1], 0.99 * whole)
    assert not _holds(cell.surface, after, np.array(loop), rings[1][:0], 0.5 * whole)
