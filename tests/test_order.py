"""Hexatic order, transport, correlations and statistics by sides: closed forms and exact sum rules."""

from __future__ import annotations

import numpy as np
import pytest

import warpedfoam as wf
from warpedfoam.analysis import excess_charges
from warpedfoam.analysis.frames import links, oriented_frames
from warpedfoam.analysis.paths import BubblePaths

from .io_foams import bubble_on_torus, lone_bubble, sphere_foam, torus_foam
from .nets import hemispheres, lunes
from .planted import honeycomb, icosahedron, relabelled, subdivided, turned

SURFACES = [wf.Sphere(3.0), wf.Torus(4.0, 1.5), wf.FlatTorus(6.0, 5.0), wf.Ellipsoid(2.0, 1.5, 1.0)]


def random_foam(surface: wf.Surface, n: int = 150, seed: int = 1) -> wf.Foam:
    return wf.voronoi_foam(wf.HeleShawCell(surface, gap=0.01), n, seed=seed)


def rotation(angle: float) -> np.ndarray:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


@pytest.mark.parametrize("weights", ["length", "equal"])
def test_honeycombs_are_perfect(weights: str) -> None:
    order = wf.bond_order(honeycomb(), weights=weights)
    np.testing.assert_allclose(order.magnitude, 1.0, rtol=1e-12)
    # rows run along x: so does one of the six directions, with e^{6iθ} = 1
    angle = np.arctan2(order.directions[:, 1], order.directions[:, 0])
    np.testing.assert_allclose(np.exp(6j * angle), 1.0, atol=1e-9)


def test_a_regular_pentagon_has_none() -> None:
    """Σ e^{6iθ} over five even directions is 0."""
    foam = subdivided(icosahedron(), 4)
    order = wf.bond_order(foam)
    five = foam.network.charges == 1
    np.testing.assert_allclose(order.magnitude[five], 0.0, atol=1e-6)
    assert order.magnitude[~five].min() > 0.8


def test_short_films_leave_no_jump() -> None:
    """Weighted by length, ψ6 is the same before and after a T1 of a film that has nearly vanished."""
    foam = honeycomb()
    film = 30
    change = {}
    for length in (0.02, 0.002):
        once = wf.t1(foam, film, length=length)
        again = wf.t1(once, film, length=length)
        for weights in ("length", "equal"):
            one, two = (wf.bond_order(f, weights=weights).psi6 for f in (once, again))
            change[weights, length] = np.abs(one - two).max()
    assert change["length", 0.002] < 0.15 * change["length", 0.02]
    assert change["equal", 0.002] > 0.5 * change["equal", 0.02]


@pytest.mark.parametrize("surface", SURFACES)
def test_frames_do_not_matter(surface: wf.Surface) -> None:
    """Turned frames multiply ψ6 by a phase, which transport takes back."""
    foam = random_foam(surface)
    order = wf.bond_order(foam)
    angle = np.random.default_rng(0).uniform(0, 2 * np.pi, foam.n_bubbles)
    c, s = np.cos(angle)[:, None], np.sin(angle)[:, None]
    e1, e2 = order.frames[:, 0], order.frames[:, 1]
    other = np.stack([c * e1 + s * e2, c * e2 - s * e1], axis=1)
    psi6 = order.psi6 * np.exp(-6j * angle)
    one, two = foam.network.left, foam.network.right
    keep = one != two
    one, two = one[keep], two[keep]
    for frames, psi in ((order.frames, order.psi6), (other, psi6)):
        turn = links(order.normals, frames, one, two)
        back = links(order.normals, frames, two, one)
        np.testing.assert_allclose(np.exp(1j * (turn + back)), 1.0, atol=1e-9)
        product = (psi[one] * np.exp(6j * turn)).conj() * psi[two]
        if frames is order.frames:
            expected = product
    np.testing.assert_allclose(product, expected, atol=1e-9)


@pytest.mark.parametrize("surface", [wf.Sphere(3.0), wf.Torus(4.0, 1.5), wf.Ellipsoid(2.0, 1.5, 1.0)])
def test_holonomy_is_curvature(surface: wf.Surface) -> None:
    """Turns of frames round all vertices add up to 2πχ; on a sphere each is its triangle's area."""
    foam = random_foam(surface, 300)
    normals, frames = oriented_frames(foam, foam.bubble_centres)
    three = foam.network.bubble[foam.network.outgoing]
    total = np.zeros(len(three))
    for k in range(3):
        total += links(normals, frames, three[:, k], three[:, (k + 1) % 3])
    # a vector carried counter-clockwise round G > 0 comes back turned left by ∫ G dA
    total = (total + np.pi) % (2 * np.pi) - np.pi
    assert total.sum() == pytest.approx(2 * np.pi * surface.euler_characteristic, abs=1e-6)
    if isinstance(surface, wf.Sphere):
        a, b, c = (normals[three[:, k]] for k in range(3))
        triple = np.einsum("nx,nx->n", a, np.cross(b, c))
        sums = 1 + sum(np.einsum("nx,nx->n", x, y) for x, y in ((a, b), (b, c), (c, a)))
        np.testing.assert_allclose(total, 2 * np.arctan2(triple, sums), atol=1e-9)


def test_paths_on_a_sphere() -> None:
    """Never shorter than the geodesic, at most a few percent longer; exact between neighbours."""
    foam = subdivided(icosahedron(), 8)
    order = wf.bond_order(foam)
    distance, _ = BubblePaths(foam, order.normals, order.frames).distances(np.array([0, 17]))
    exact = np.arccos(np.clip(foam.bubble_centres[[0, 17]] @ foam.bubble_centres.T, -1, 1))
    far = exact > 1e-6
    ratio = distance[far] / exact[far]
    assert ratio.min() > 1.0 - 1e-9
    assert ratio.max() < 1.06
    near = far & (exact < 0.2)
    np.testing.assert_allclose(ratio[(exact < 0.2)[far]].min(), 1.0, atol=1e-9)
    assert near.sum() > 10


def test_paths_do_not_go_round_a_flat_torus_the_long_way() -> None:
    foam = honeycomb(12, 12)
    order = wf.bond_order(foam)
    distance, angle = BubblePaths(foam, order.normals, order.frames).distances(np.array([0]))
    assert distance.max() < 0.5 * np.hypot(12, 12 * np.sqrt(0.75)) * 1.04
    np.testing.assert_allclose(np.exp(1j * angle), 1.0, atol=1e-12)


def test_correlations_of_a_honeycomb() -> None:
    found = wf.correlations(honeycomb(), bin_width=1.2)
    some = found.pairs > 0
    np.testing.assert_allclose(found.g6[some], 1.0, rtol=1e-9)
    assert not found.charge.any()
    assert found.screening_length is None
    assert found.pairs.sum() == 144 * 143
    # a ring of six and one of twelve, at 1, √3 and 2 spacings
    assert (found.pairs[:2] / 144).round(6).tolist() == [6.0, 12.0]


def test_correlations_do_not_see_pose_or_names() -> None:
    foam = random_foam(wf.Sphere(3.0), 80)
    other, _ = relabelled(turned(foam, rotation(0.7)), 2)
    one, two = wf.correlations(foam), wf.correlations(other)
    np.testing.assert_array_equal(one.pairs, two.pairs)
    np.testing.assert_allclose(one.g6, two.g6, atol=1e-8)
    np.testing.assert_allclose(one.charge, two.charge, atol=1e-8)
    mirrored = wf.correlations(turned(foam, np.diag([1.0, -1.0, 1.0])))
    np.testing.assert_allclose(one.g6, mirrored.g6, atol=1e-8)


def test_charges_screen_each_other() -> None:
    """All charge beyond curvature adds up to 0, so the screening ends at 0; most of it is near."""
    foams = [random_foam(wf.Torus(4.0, 1.5), 150, seed) for seed in range(3)]
    found = wf.correlations(foams)
    assert found.n_foams == 3
    assert found.screening[0] == 1.0
    assert found.screening[-1] == pytest.approx(0.0, abs=1e-9)
    assert 0.5 < found.screening_length / found.spacing < 1.5
    for foam in (*foams, random_foam(wf.Sphere(2.0))):
        assert excess_charges(foam).sum() == pytest.approx(0.0, abs=1e-9)
    few = wf.correlations(foams, n_sources=40, seed=3)
    np.testing.assert_array_equal(few.charge, wf.correlations(foams, n_sources=40, seed=3).charge)
    assert few.screening[-1] == pytest.approx(0.0, abs=1e-9)
    assert np.abs(few.g6 - found.g6)[found.pairs > 3000].max() < 0.2


@pytest.mark.parametrize("surface", SURFACES)
def test_weaires_sum_rule(surface: wf.Surface) -> None:
    foams = [random_foam(surface, 100, seed) for seed in range(2)]
    found = wf.foam_statistics(foams)
    rule = (found.fractions * found.sides * found.neighbour_sides).sum()
    assert rule == pytest.approx(found.mu2 + found.mean_sides**2, rel=1e-12)
    assert found.mean_sides == pytest.approx(6.0 - 6.0 * surface.euler_characteristic / 100, rel=1e-12)
    assert (found.fractions * found.area_by_sides).sum() == pytest.approx(1.0, rel=1e-9)
    assert found.pressure_by_sides is None
    assert found.n_bubbles == 200


def test_statistics_agree_with_a_count_by_hand() -> None:
    foam = random_foam(wf.Sphere(1.0), 60)
    found = wf.foam_statistics(foam)
    sides, graph = foam.network.sides, foam.network.to_networkx()
    for n, m in zip(found.sides.tolist(), found.neighbour_sides.tolist(), strict=True):
        near = [sides[j] for i in np.flatnonzero(sides == n).tolist() for _, j in graph.edges(i)]
        assert m == pytest.approx(np.mean(near), rel=1e-12)
    slope = np.polyfit(sides, foam.bubble_areas / foam.bubble_areas.mean(), 1)[0]
    assert found.lewis == pytest.approx(slope, rel=1e-9)
    # least squares of the whole law with a alone free, bubble by bubble
    mean, mu2 = found.mean_sides, found.mu2
    seen = dict(zip(found.sides.tolist(), (found.sides * found.neighbour_sides).tolist(), strict=True))
    misfit = [
        sum((seen[n] - (mean - a) * n - mean * a - mu2) ** 2 for n in sides.tolist())
        for a in found.aboav + np.array([-1e-3, 0.0, 1e-3])
    ]
    assert misfit[1] < min(misfit[0], misfit[2])
    assert wf.side_distribution(foam).mu2 == pytest.approx(found.mu2, rel=1e-12)


@pytest.mark.parametrize(
    "foam",
    [
        hemispheres(0.01, 4, 4, 0.1),
        lunes(0.01, 4, 0.05),
        lone_bubble(),
        torus_foam(2, 3),
        sphere_foam(4, even=True),
    ],
)
def test_small_foams(foam: wf.Foam) -> None:
    assert np.isfinite(wf.bond_order(foam).psi6).all()
    assert np.isfinite(wf.correlations(foam).g6).all()
    assert np.isfinite(wf.foam_statistics(foam).area_deviation)


def test_one_bubble_has_no_pairs() -> None:
    with pytest.raises(wf.ResolutionError, match="at least two bubbles"):
        wf.correlations(bubble_on_torus())


@pytest.mark.parametrize(
    ("call", "match"),
    [
        (lambda f: wf.bond_order("foam"), "foam must be a Foam"),
        (lambda f: wf.bond_order(f, weights="area"), "weights must be one of"),
        (lambda f: wf.correlations([]), "at least one Foam"),
        (lambda f: wf.correlations(f, bin_width=0.0), "bin_width must be greater than 0"),
        (lambda f: wf.correlations(f, n_sources=0), "n_sources must be at least 1"),
        (lambda f: wf.foam_statistics([f, 3]), "at least one Foam"),
        (lambda f: wf.plot_order(f, wf.bond_order(sphere_foam(30))), "order is of 30 bubbles"),
        (lambda f: wf.plot_defects(f, wf.defects(sphere_foam(30))), "report is of another foam"),
        (lambda f: wf.plot_sides(f), "statistics must be a FoamStatistics"),
        (lambda f: wf.plot_correlations(f), "found must be a Correlations"),
    ],
)
def test_bad_input(call, match: str) -> None:
    with pytest.raises((ValueError, TypeError), match=match):
        call(sphere_foam(20))
