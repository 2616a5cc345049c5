"""Gaps that vary: derivatives, closed forms, Plateau's and Laplace's laws, symmetry, what is refused."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from scipy.integrate import quad

import warpedfoam as wf
from warpedfoam.energy import film_terms
from warpedfoam.foam import bubble_integrals
from warpedfoam.kernels.differences import differences
from warpedfoam.kernels.taylor import CARRIED
from warpedfoam.relax.held import moved_points
from warpedfoam.surfaces import FunctionGap, LevelSurface

from .gap_samples import BALL, CASES, PLATE, RING, cell_of, each_case, mesh_cell, relaxed_in
from .test_level_surfaces import along_rims

TORUS = wf.Torus(20.0, 4.0)
READY = {
    "wedge": (wf.LinearGap(0.5, (0.005, 0.01, -0.003), (1.0, 0.0, 2.0)), TORUS),
    "spheres": (wf.ShiftedSphereGap(wf.Sphere(10.0), 0.5, (0.1, -0.2, 0.05)), wf.Sphere(10.0)),
    "tubes": (wf.ShiftedTubeGap(TORUS, 0.5, 0.1, -0.05), TORUS),
    "formula": (
        wf.FormulaGap(
            "0.5 + 0.1*sin(x/5)*cos(y/7) + 0.01*exp(-z**2/100) + 0.02*atan2(z, 30 + x) - (-x)/900"
            " + 2**(x/40)/99"
            " + hypot(x, y)/700 + tanh(z)/99 + log(50 + x)**1.5/100 + (30 + x)**(z/50)/100 + 1/(40 + y)"
            " + sqrt(40 + z)/100 + tan(x/60)/100 + sinh(z/9)/100 + cosh(y/9)/100 + pi/100 + x**2/9999"
        ),
        TORUS,
    ),
}


def same_parts(cell, foam, turn=None):
    """The foam's network and shapes in another cell, turned if asked, its volumes scaled to the new total."""
    targets = foam.target_volumes * (cell.volume / foam.cell.volume)
    points = foam.vertex_points if turn is None else foam.vertex_points @ turn.T
    return wf.Foam(cell, foam.network, points, foam.film_offsets, targets)


# ---------------------------------------------------------------------------- gaps themselves


@pytest.mark.parametrize("name", READY)
def test_ready_made_gaps_know_their_derivatives(name):
    gap, surface = READY[name]
    x = surface.random_points(60, 1)
    x = x + 0.05 * np.random.default_rng(0).standard_normal(x.shape)
    value, slope, bend = differences(gap, x, 0.05, second=True)
    np.testing.assert_array_equal(gap(x), value)
    np.testing.assert_allclose(gap.gradient(x), slope, atol=2e-9)
    np.testing.assert_allclose(gap.hessian(x), bend, atol=1e-7)
    assert isinstance(gap, wf.GapField)
    assert len(CARRIED) == 11


def test_outer_plates_are_where_they_are_said_to_be():
    """x + d n lies on the shifted sphere, or on the shifted tube."""
    gap, sphere = READY["spheres"]
    x = sphere.random_points(200, 0)
    away = x + gap(x)[:, None] * sphere.normals(x) - gap.shift
    np.testing.assert_allclose(np.linalg.norm(away, axis=1), 10.5, rtol=1e-14)
    gap, torus = READY["tubes"]
    x = torus.random_points(200, 0)
    y = x + gap(x)[:, None] * torus.normals(x)
    tube = np.hypot(np.hypot(y[:, 0], y[:, 1]) - 20.1, y[:, 2] + 0.05)
    np.testing.assert_allclose(tube, 4.5, rtol=1e-14)


def test_differences_are_of_sixth_order():
    x = np.random.default_rng(0).standard_normal((20, 3))

    def wave(p):
        return np.sin(p @ [1.0, 2.0, -1.0])

    def error(h):
        _, slope, bend = differences(wave, x, h, second=True)
        exact = np.cos(x @ [1.0, 2.0, -1.0])[:, None] * [1.0, 2.0, -1.0]
        curved = -np.sin(x @ [1.0, 2.0, -1.0])[:, None, None] * np.outer([1, 2, -1], [1, 2, -1])
        return np.array([np.abs(slope - exact).max(), np.abs(bend - curved).max()])

    order = np.log2(error(0.2) / error(0.1))
    assert (order > 5.7).all()
    assert (order < 6.3).all()


def test_the_step_follows_the_function():
    """A gap with waves much shorter than the plate is still differentiated to nine digits."""
    cell = wf.HeleShawCell(wf.Sphere(10.0), lambda x: 0.5 + 0.01 * np.sin(4.0 * x[:, 0]))
    x = cell.surface.random_points(50, 0)
    assert isinstance(cell.gap, FunctionGap)
    exact = 0.04 * np.cos(4.0 * x[:, 0])
    np.testing.assert_allclose(cell.gap.gradient(x)[:, 0], exact, atol=4e-11)
    np.testing.assert_allclose(cell.gaps(x), 0.5 + 0.01 * np.sin(4.0 * x[:, 0]), rtol=1e-14)
    np.testing.assert_allclose(cell.log_gap_slopes(x)[:, 0], exact / cell.gaps(x), atol=1e-10)


# ---------------------------------------------------------------------------- constants


@pytest.mark.parametrize("surface", [BALL, RING, PLATE], ids=["sphere", "torus", "plane"])
def test_a_constant_function_is_the_constant_bit_for_bit(surface):
    plain = wf.HeleShawCell(surface, 0.05)
    for gap in (lambda x: np.full(len(x), 0.05), wf.FormulaGap("0.05"), wf.LinearGap(0.05, (0, 0, 0))):
        cell = wf.HeleShawCell(surface, gap)
        assert cell == plain
        assert cell.parallel
        assert type(cell.surface) is type(surface)
    count = 160 if surface is RING else 30
    one, two = (wf.voronoi_foam(c, count, seeds="blue") for c in (plain, cell))
    one, two = wf.relax(one), wf.relax(two)
    np.testing.assert_array_equal(one.foam.vertex_points, two.foam.vertex_points)
    np.testing.assert_array_equal(one.pressures, two.pressures)
    assert one.energy == two.energy


@pytest.mark.parametrize("name", ["egg", "plane"])
def test_nearly_constant_gaps_go_over_into_the_constant(name):
    """d (1 + 1e-13 x): the same formulas up to round-off."""
    surface = CASES[name].surface
    plain = wf.HeleShawCell(surface, 0.05)
    near = wf.HeleShawCell(surface, lambda x: 0.05 * (1.0 + 1e-13 * x[:, 0]))
    assert plain.parallel
    assert not near.parallel
    assert near.volume == pytest.approx(plain.volume, rel=1e-12)
    foam = wf.relax(wf.voronoi_foam(plain, 40, seeds="blue")).foam
    other = same_parts(near, foam)
    np.testing.assert_allclose(other.film_areas, foam.film_areas, rtol=1e-12)
    np.testing.assert_allclose(other.bubble_volumes, foam.bubble_volumes, rtol=1e-11)
    assert wf.relax(other).energy == pytest.approx(foam.energy, rel=1e-12)


@pytest.mark.parametrize(("surface", "count"), [(BALL, 60), (RING, 240)], ids=["sphere", "torus"])
def test_nearly_constant_gaps_on_closed_forms_agree_to_the_order_of_films(surface, count):
    """Sphere and torus change from closed forms to level sets there: spectrally in p."""
    plain = wf.HeleShawCell(surface, 0.05)
    near = wf.HeleShawCell(surface, lambda x: 0.05 * (1.0 + 1e-13 * x[:, 0]))
    start = wf.voronoi_foam(plain, count, seeds="lattice")
    energy = {}
    for order in (4, 8):
        foam = wf.relax(start, order=order).foam
        straight = wf.Foam(near, foam.network, foam.vertex_points, np.zeros_like(foam.film_offsets))
        scaled = foam.target_volumes * (near.volume / plain.volume)
        twin = wf.relax(
            wf.Foam(near, foam.network, straight.vertex_points, target_volumes=scaled), order=order
        )
        assert twin.converged
        energy[order] = abs(twin.energy / foam.energy - 1.0)
        # rotations still change nothing
        assert len(near.rigid_motions(foam.vertex_points)) == len(plain.rigid_motions(foam.vertex_points))
    assert energy[4] < 3e-6
    assert energy[8] < 2e-10
    assert energy[8] < 0.01 * energy[4]


# ---------------------------------------------------------------------------- volumes and areas


def test_volume_between_shifted_spheres_is_a_closed_form():
    """The outer ball less the inner one, wherever its centre is."""
    for shift in ((0.0, 0.0, 0.1), (0.2, -0.1, 0.3)):
        cell = wf.HeleShawCell(wf.Sphere(2.0), wf.ShiftedSphereGap(wf.Sphere(2.0), 0.5, shift))
        assert cell.volume == pytest.approx(4.0 / 3.0 * np.pi * (2.5**3 - 2.0**3), rel=1e-9)


def test_volume_between_shifted_tubes_is_a_closed_form():
    """By Pappus: 2π² (R + a)(r + d)² less 2π² R r²."""
    cell = wf.HeleShawCell(RING, wf.ShiftedTubeGap(RING, 0.3, 0.05, 0.1))
    exact = 2.0 * np.pi**2 * (3.05 * 1.3**2 - 3.0)
    assert cell.volume == pytest.approx(exact, rel=1e-8)
    assert cell.mean_gap == pytest.approx(cell.gaps(cell.surface.random_points(200_000, 0)).mean(), rel=1e-3)


@each_case
def test_volumes_of_bubbles_add_up_and_are_held(name):
    result = relaxed_in(name)
    assert result.converged, result.message
    foam = result.foam
    assert foam.bubble_volumes.sum() == pytest.approx(foam.cell.volume, rel=1e-6)
    assert result.volume_error < 1e-12
    # areas differ where volumes do not: narrow places hold wide bubbles
    gaps = foam.cell.gaps(foam.bubble_centres)
    assert np.corrcoef(foam.bubble_areas, 1.0 / gaps)[0, 1] > 0.9


def test_a_film_in_a_wedge_is_a_trapezium():
    """Straight films over a plane: length times mean gap, whatever the direction."""
    foam = wf.voronoi_foam(wf.HeleShawCell(PLATE, wf.LinearGap(1.0, (0.03, 0.01, 0.0))), 30, seeds="blue")
    flat = wf.Foam(foam.cell, foam.network, foam.vertex_points)
    tail, head = flat.film_ends
    mean = 0.5 * (flat.cell.gaps(tail) + flat.cell.gaps(head))
    np.testing.assert_allclose(flat.film_areas, mean * np.linalg.norm(head - tail, axis=1), rtol=1e-12)


def test_a_meridian_film_between_shifted_spheres():
    """∫∫ (1 + t/r) dt ds along half a meridian, cut into arcs; n_heights is exact from 1 on."""
    sphere = wf.Sphere(2.0)
    gap = wf.ShiftedSphereGap(sphere, 0.5, (0.0, 0.0, 0.3))

    def thickness(theta):
        u = 0.3 * np.cos(theta)
        return u + np.sqrt(2.5**2 - 0.09 + u**2) - 2.0

    def density(theta):
        d = thickness(theta)
        return 2.0 * d + 0.5 * d**2

    exact = quad(density, 0.3, 1.1, epsabs=1e-13)[0]
    ends = 2.0 * np.array([[np.sin(a), 0.0, np.cos(a)] for a in (0.3, 1.1)])
    for heights in (1, 2, 5):
        cell = wf.HeleShawCell(sphere, gap, heights)
        area = cell.surface.arc_measure(ends[:1], ends[1:], np.zeros((1, 9)), cell.layer)
        assert area[0] == pytest.approx(exact, rel=1e-9)


# ---------------------------------------------------------------------------- derivatives


def cell_and_films(name):
    """A cell, and vertices and films of a foam in it that is not at rest."""
    foam = relaxed_in("sphere" if name == "mesh" else name).foam
    cell = mesh_cell() if name == "mesh" else foam.cell
    points = cell.surface.project(foam.vertex_points)
    rng = np.random.default_rng(2)
    return cell, foam.network, points, foam.film_offsets + 0.05 * rng.standard_normal(foam.film_offsets.shape)


@pytest.mark.parametrize("name", ["sphere", "torus", "plane", "sheet", "mesh"])
def test_film_gradients_are_derivatives(name):
    """Sixth-order differences along every unknown, to their round-off; for all films at once."""
    cell, network, points, u = cell_and_films(name)
    surface = cell.surface
    some = slice(0, 24)
    tail, head, u = points[network.tails][some], points[network.heads][some], u[some]
    terms = surface.arc_terms(tail, head, u, cell.layer, tension=1.0, jump=None)
    np.testing.assert_allclose(terms.measure, surface.arc_measure(tail, head, u, cell.layer), rtol=1e-12)
    size = np.linalg.norm(tail - surface.arc_points(tail, head, u, np.ones(1))[:, 0], axis=1)
    whole = size > 0.3 * np.median(size)
    h = 1e-3
    for k in range(7):
        step = np.zeros((len(tail), 7))
        step[:, k] = h * (size if k < 4 else 1.0)

        def measure(share, step=step):
            s = share * step
            return surface.arc_measure(
                surface.retract(tail, s[:, :2]), surface.retract(head, s[:, 2:4]), u + s[:, 4:], cell.layer
            )

        slope = (
            45.0 * (measure(1) - measure(-1)) - 9.0 * (measure(2) - measure(-2)) + measure(3) - measure(-3)
        )
        slope /= 60.0 * step[:, k]
        scale = np.abs(terms.gradient[k]).max()
        np.testing.assert_allclose(terms.gradient[k][whole], slope[whole], atol=1e-10 * scale)


@pytest.mark.parametrize("name", ["sphere", "torus", "plane"])
def test_volume_gradients_are_derivatives_of_the_fans(name):
    foam = relaxed_in(name, 8).foam
    surface, network, cell = foam.cell.surface, foam.network, foam.cell
    terms = film_terms(cell, network, foam.vertex_points, foam.film_offsets, tension=1.0, pressures=None)
    rng = np.random.default_rng(3)
    vertices = along_rims(foam, foam.bubble_size * rng.standard_normal((network.n_vertices, 2)))
    offsets = 0.1 * rng.standard_normal(foam.film_offsets.shape)

    def volumes(s):
        points = moved_points(surface, network, foam.vertex_points, s * vertices)
        return bubble_integrals(cell, network, points, foam.film_offsets + s * offsets, cell.layer)

    h = 1e-3
    slope = (8 * (volumes(h) - volumes(-h)) - (volumes(2 * h) - volumes(-2 * h))) / (12 * h)
    step = np.concatenate([vertices[network.tails].T, vertices[network.heads].T, offsets.T])
    flow = (step * terms.volume).sum(axis=0)
    given = np.bincount(network.left, flow, foam.n_bubbles) - np.bincount(network.right, flow, foam.n_bubbles)
    np.testing.assert_allclose(given, slope, atol=2e-5 * np.abs(slope).max())


@pytest.mark.parametrize("name", ["sphere", "torus"])
def test_hessians_are_right_at_equilibrium_at_any_gap(name):
    """Second differences of the Lagrangian at rest: dW is not left out, so the gap need not be thin."""
    foam = relaxed_in(name, 8).foam
    surface, network, cell = foam.cell.surface, foam.network, foam.cell
    terms = film_terms(
        cell, network, foam.vertex_points, foam.film_offsets, tension=1.0, pressures=foam.pressures
    )
    np.testing.assert_allclose(terms.hessian, terms.hessian.transpose(1, 0, 2), atol=1e-14)
    rng = np.random.default_rng(4)
    for trial, close in ((0, 1e-4), (1, 1e-7)):
        vertices = 0.1 * foam.bubble_size * rng.standard_normal((network.n_vertices, 2))
        offsets = 0.05 * rng.standard_normal(foam.film_offsets.shape) * (trial == 0)
        step = np.concatenate([vertices[network.tails].T, vertices[network.heads].T, offsets.T])

        def lagrangian(s, vertices=vertices, offsets=offsets):
            points = moved_points(surface, network, foam.vertex_points, s * vertices)
            u = foam.film_offsets + s * offsets
            area = surface.arc_measure(points[network.tails], points[network.heads], u, cell.layer).sum()
            volume = bubble_integrals(cell, network, points, u, cell.layer)
            return area - foam.pressures @ (volume - foam.bubble_volumes)

        h = 0.03
        f = [lagrangian(k * h) for k in range(-3, 4)]
        bend = np.dot(f, [2, -27, 270, -490, 270, -27, 2]) / (180 * h**2)
        assert np.einsum("if,ijf,jf->", step, terms.hessian, step) == pytest.approx(bend, rel=close)


# ---------------------------------------------------------------------------- laws


@pytest.mark.parametrize("name", ["sphere", "plane"])
def test_films_meet_at_120_degrees_and_pressures_balance_curvature_and_slope(name):
    """In a thin gap γ (κ_g + ∂_ν ln d) = p_i − p_j; on planes at any gap."""
    gap = 1e-5 if name == "sphere" else 0.05
    result = relaxed_in(name, 8, gap)
    assert result.converged, result.message
    report = wf.equilibrium_report(result.foam)
    assert report.angle_error < 3e-5
    assert report.wall_error < 3e-5
    assert report.laplace_error < 2e-5
    assert report.identity_error < 2e-5
    assert report.curvature_spread.max() < 2e-3
    # without the slope it would not be so
    slope = np.abs(report.geodesic_curvatures - report.film_curvatures).max()
    assert slope > 100.0 * report.laplace_error


def test_laplaces_law_is_met_to_the_order_of_the_gap():
    """A ruled film in a gap d of a sphere: the error falls with d, angles are 120° at any d."""
    errors = []
    for gap in (1e-2, 5e-3):
        report = wf.equilibrium_report(relaxed_in("sphere", 8, gap).foam)
        errors.append(report.laplace_error)
        assert report.angle_error < 3e-5
    rates = np.log2(np.divide(errors[:-1], errors[1:]))
    np.testing.assert_allclose(rates, 1.0, atol=0.1)


def test_laplaces_law_converges_with_the_order_of_films():
    reports = [wf.equilibrium_report(relaxed_in("plane", order).foam) for order in (4, 8)]
    for name, share in (("laplace_error", 1e-2), ("angle_error", 1e-1), ("identity_error", 1e-3)):
        assert getattr(reports[1], name) < share * getattr(reports[0], name)


def test_a_rotation_changes_nothing():
    """Plates and foam turned together."""
    c, s = np.cos(0.7), np.sin(0.7)
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]) @ [[1, 0, 0], [0, c, -s], [0, s, c]]
    shift = np.array([0.01, 0.0, 0.005])
    cells = [wf.HeleShawCell(BALL, wf.ShiftedSphereGap(BALL, 0.05, tuple(v))) for v in (shift, turn @ shift)]
    one = wf.relax(wf.voronoi_foam(cells[0], 40, seeds="blue")).foam
    two = same_parts(cells[1], one, turn)
    np.testing.assert_allclose(two.film_areas, one.film_areas, rtol=1e-12)
    np.testing.assert_allclose(two.bubble_volumes, one.bubble_volumes, rtol=1e-11)
    # the whole volume is a sum over a mesh that does not turn
    assert cells[1].volume == pytest.approx(cells[0].volume, rel=1e-7)


def test_symmetries_are_those_of_both_plates():
    x = wf.Sphere(2.0).random_points(20, 0)
    along = wf.HeleShawCell(wf.Sphere(2.0), wf.ShiftedSphereGap(wf.Sphere(2.0), 0.1, (0.0, 0.0, 0.02)))
    (motion,) = along.rigid_motions(x)
    turned = np.cross([0.0, 0.0, 1.0], x)
    assert abs(np.vdot(motion, turned)) == pytest.approx(
        np.linalg.norm(motion) * np.linalg.norm(turned), rel=1e-12
    )
    assert len(cell_of("sphere").rigid_motions(x)) == 0
    assert (
        len(wf.HeleShawCell(RING, wf.ShiftedTubeGap(RING, 0.1, 0.01)).rigid_motions(RING.random_points(9, 0)))
        == 1
    )
    assert len(cell_of("torus").rigid_motions(RING.random_points(9, 0))) == 0


# ---------------------------------------------------------------------------- files and refusals


@dataclass(frozen=True)
class Own:
    """A gap of a user's own, saved like a ready-made one."""

    depth: float

    def __call__(self, x):
        return 0.1 * (1.0 + self.depth * x[:, 2])

    def gradient(self, x):
        return np.tile([0.0, 0.0, 0.1 * self.depth], (len(x), 1))

    def hessian(self, x):
        return np.zeros((len(x), 3, 3))


@pytest.mark.parametrize("name", READY)
def test_ready_made_gaps_are_saved(name, tmp_path):
    gap, surface = READY[name]
    cell = wf.HeleShawCell(surface, gap)
    foam = wf.cluster_foam(cell, 2, volumes=0.5)
    again = wf.load(wf.save(tmp_path / "foam.npz", foam))
    assert again.cell == cell
    assert again.cell.gap == gap
    assert again.energy == foam.energy
    np.testing.assert_array_equal(again.bubble_volumes, foam.bubble_volumes)


def test_gaps_of_ones_own_are_saved_and_functions_are_not(tmp_path):
    foam = wf.voronoi_foam(wf.HeleShawCell(BALL, Own(0.3)), 30, seeds="lattice")
    path = wf.save(tmp_path / "own.npz", foam)
    assert wf.load(path, surfaces=[Own]).energy == foam.energy
    with pytest.raises(wf.FileFormatError, match="'Own', which is not known here"):
        wf.load(path)
    plain = wf.voronoi_foam(wf.HeleShawCell(BALL, Own(0.3).__call__), 30, seeds="lattice")
    with pytest.raises(TypeError, match="cannot save the gap: it is a plain function; LinearGap"):
        wf.save(tmp_path / "plain.npz", plain)
    assert not (tmp_path / "plain.npz").exists()
    assert plain.energy == pytest.approx(foam.energy, rel=1e-12)


def test_pictures_tables_and_meshes_are_written(tmp_path):
    foam = relaxed_in("sphere").foam
    wf.write_ply(tmp_path / "foam.ply", foam)
    wf.write_bubbles_csv(tmp_path / "bubbles.csv", foam)
    wf.write_films_csv(tmp_path / "films.csv", foam)
    with pytest.raises(TypeError, match="plain function"):
        wf.save(tmp_path / "foam.npz", foam)
    # a picture, without the foam that no file can hold
    wf.write_vtp(tmp_path / "foam.vtp", foam)
    with pytest.raises(wf.FileFormatError, match="holds no foam"):
        wf.read_vtp(tmp_path / "foam.vtp")
    wf.write_view(tmp_path / "foam.html", foam)
    assert "Sphere" in repr(foam.cell)
    assert isinstance(foam.cell.surface, wf.Sphere)
    assert isinstance(foam.cell.surface, LevelSurface)
    assert foam.cell.surface.radius == 1.0
    table = (tmp_path / "bubbles.csv").read_text(encoding="utf-8").splitlines()
    assert len(table) == 1 + foam.n_bubbles


def test_a_mesh_carries_a_gap_that_varies():
    """The same foam as on the formula, to the mesh's accuracy."""
    exact = relaxed_in("sphere")
    cell = mesh_cell()
    assert cell.volume == pytest.approx(exact.foam.cell.volume, rel=1e-4)
    points = cell.surface.project(exact.foam.vertex_points)
    start = wf.Foam(cell, exact.foam.network, points, target_volumes=np.full(40, cell.volume / 40))
    found = wf.relax(start)
    assert found.converged, found.message
    assert found.energy == pytest.approx(exact.energy, rel=1e-4)


def test_models_take_the_gap_of_each_place():
    cell = wf.HeleShawCell(TORUS, wf.LinearGap(0.5, (0.005, 0.0, 0.0)))
    points = TORUS.points(np.full(2, 0.5 * np.pi), np.array([0.0, np.pi]))
    found = wf.geometric_potential(cell, 0.5, points=points, method="theory")
    k1, k2 = TORUS.principal_curvatures(points).T
    exact = wf.theory.second_order_energy(0.5, cell.gaps(points), k1, k2)
    np.testing.assert_allclose(found.energies, exact, rtol=1e-14)
    assert found.forces[0] @ [1.0, 0.0, 0.0] < 0.0


def test_number_and_function_swap():
    """A cell made anew with a number has its closed forms back."""
    from dataclasses import replace

    varied = wf.HeleShawCell(RING, wf.ShiftedTubeGap(RING, 0.1, 0.01))
    plain = replace(varied, gap=0.1)
    assert plain == wf.HeleShawCell(RING, 0.1)
    assert type(plain.surface) is wf.Torus
    assert varied == wf.HeleShawCell(varied.surface, varied.gap)
