"""Geodesic circles by three methods: closed forms, an independent integration, series, refusals."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import warpedfoam as wf
from warpedfoam import theory

from .level_samples import FAMILY

TORUS = wf.Torus(20.0, 4.0)
GRID = [(rho, phi) for rho in (0.5, 1.0, 2.0, 3.0) for phi in (0.0, 90.0, 180.0)]
on_grid = pytest.mark.parametrize(("rho", "phi"), GRID)


def at(phi, torus=TORUS, theta=0.4):
    return torus.points(np.radians(phi), np.array(theta))


@cache
def reference(rho, phi, ring=20.0, tube=4.0, n=48):
    """C and A on a torus in its own angles (φ, θ) by Christoffel symbols."""
    alpha = 2 * np.pi * (np.arange(n) + 0.5) / n

    def rate(_, flat):
        f, df, dt, m, dm, _ = flat.reshape(6, n)
        w, slope = ring + tube * np.cos(f), -tube * np.sin(f)
        g = np.cos(f) / (tube * w)
        return np.concatenate([df, w * slope / tube**2 * dt**2, -2 * slope / w * df * dt, dm, -g * m, m])

    f = np.radians(phi) * np.ones(n)
    w = ring + tube * np.cos(f)
    zero = np.zeros(n)
    start = np.concatenate([f, np.cos(alpha) / tube, np.sin(alpha) / w, zero, zero + 1.0, zero])
    end = solve_ivp(rate, (0.0, rho), start, method="DOP853", rtol=1e-12, atol=1e-14).y[:, -1].reshape(6, n)
    return 2 * np.pi * end[[3, 5]].mean(axis=1)


@on_grid
def test_traced_circles_on_the_papers_torus_agree_with_an_independent_integration(rho, phi):
    circle = wf.geodesic_circle(TORUS, at(phi), rho)
    c, a = reference(rho, phi)
    assert circle.perimeter == pytest.approx(c, abs=1e-8)
    assert circle.area == pytest.approx(a, abs=1e-8)
    assert abs(circle.perimeter - c) < circle.error + 1e-9
    assert circle.error < 1e-9


@pytest.mark.parametrize("radius", [0.3, 1.5, 3.0])
def test_traced_circles_on_spheres_are_closed_forms(radius):
    circle = wf.geodesic_circle(wf.Sphere(1.0), [0.3, -0.5, 2.0], radius)
    assert circle.perimeter == pytest.approx(theory.cap_perimeter(radius, 1.0), abs=1e-11)
    assert circle.area == pytest.approx(theory.cap_area(radius, 1.0), abs=1e-11)
    away = np.arccos(circle.points @ circle.centre)
    np.testing.assert_allclose(away, radius, atol=1e-10)


@pytest.mark.parametrize(
    "surface", [wf.Cylinder(1.5, 20.0, periodic=True), wf.FlatTorus(12.0, 12.0)], ids=repr
)
def test_traced_circles_where_nothing_curves_are_flat(surface):
    """On the cylinder up to half way round it, the plane's disk is rolled up."""
    circle = wf.geodesic_circle(surface, [1.5, 0.0, 0.0], 4.5)
    assert circle.perimeter == pytest.approx(9.0 * np.pi, abs=1e-10)
    assert circle.area == pytest.approx(20.25 * np.pi, abs=1e-10)


def laplacian(phi, ring=20.0, tube=4.0):
    """ΔG = ∂_φ (w ∂_φ G)/(r² w), w = R + r cos φ, by differences."""
    h = 1e-4

    def flux(f):
        slope = (theory.torus_gaussian_curvature(f + h, ring, tube)
                 - theory.torus_gaussian_curvature(f - h, ring, tube)) / (2 * h)  # fmt: skip
        return (ring + tube * np.cos(f)) * slope

    f = np.radians(phi)
    return (flux(f + h) - flux(f - h)) / (2 * h) / (tube**2 * (ring + tube * np.cos(f)))


@pytest.mark.parametrize("phi", [0.0, 60.0, 135.0, 180.0])
def test_series_are_right_to_their_order_only_with_the_laplacian(phi):
    """Errors of C fall as ρ⁷ with ΔG, as ρ⁵ without; those of A as ρ⁸ and ρ⁶."""
    radii = np.array([1.6, 0.8])
    found = [wf.geodesic_circle(TORUS, at(phi), rho) for rho in radii]
    g, bend = theory.torus_gaussian_curvature(np.radians(phi), 20.0, 4.0), laplacian(phi)
    for series, name, order in (
        (theory.perimeter_series, "perimeter", 7),
        (theory.area_series, "area", 8),
    ):
        values = np.array([getattr(c, name) for c in found])
        for given, slope in ((bend, order), (0.0, order - 2)):
            fault = np.abs(values - series(radii, g, given))
            assert np.log2(fault[0] / fault[1]) == pytest.approx(slope, abs=0.35)


def test_directions_converge_faster_than_any_power():
    """From 16 directions on a lopsided circle the trapezoid rule gains digits with each one."""
    torus = wf.Torus(3.0, 1.0)
    exact = wf.geodesic_circle(torus, at(110.0, torus), 1.2, n_directions=256).perimeter
    centre = torus.project(at(110.0, torus)[None])[0]
    from warpedfoam.studies.traced_circle import _trace

    frame = torus.vertex_frames(centre[None])[0]
    errors = []
    for n in (4, 8, 16, 32):
        ends = _trace(torus, centre, frame, 2 * np.pi * np.arange(n) / n, 1.2, 1e-12)
        errors.append(abs(2.4 * np.pi * ends[:, 9].mean() - exact) / exact)
    assert errors[3] < 1e-10
    assert errors[2] < errors[1] ** 1.5 < errors[0] ** 2


@on_grid
def test_exact_distances_resolve_the_curvature_term(rho, phi):
    """Within 2 % at h ≤ 0.2 ρ; where G = 0 in per cent of the term on the outer equator."""
    traced = wf.geodesic_circle(TORUS, at(phi), rho)
    found = wf.geodesic_circle(TORUS, at(phi), rho, method="exact", spacing=0.2 * rho / 1.3)
    assert 0.1 * rho < found.spacing <= 0.2 * rho
    term = max(abs(2 * np.pi * rho - traced.perimeter), np.pi * rho**3 / 3 / 96)
    assert abs(found.perimeter - traced.perimeter) < 0.02 * term
    assert abs(found.perimeter - traced.perimeter) < found.error
    part = max(abs(np.pi * rho**2 - traced.area), np.pi * rho**4 / 12 / 96)
    assert abs(found.area - traced.area) < 0.02 * part
    assert abs(found.area - traced.area) < found.area_error
    if phi != 90.0:
        assert found.curvature_from_perimeter == pytest.approx(traced.curvature_from_perimeter, rel=0.02)
        assert found.curvature_from_area == pytest.approx(traced.curvature_from_area, rel=0.02)


@pytest.mark.parametrize("phi", [0.0, 180.0])
def test_heat_is_off_by_more_than_the_curvature_term_and_says_so(phi):
    traced = wf.geodesic_circle(TORUS, at(phi), 1.0)
    found = wf.geodesic_circle(TORUS, at(phi), 1.0, method="heat")
    fault = abs(found.perimeter - traced.perimeter)
    assert fault > abs(2 * np.pi - traced.perimeter)
    assert fault < found.error < 10 * fault
    assert abs(found.area - traced.area) < found.area_error
    assert fault < 0.02 * traced.perimeter


@pytest.mark.parametrize("method", ["exact", "heat"])
def test_isolines_on_the_sphere(method):
    found = wf.geodesic_circle(wf.Sphere(2.0), [1.0, 2.0, -0.7], 2.0, method=method, spacing=0.3)
    limit = 1e-4 if method == "exact" else 0.05
    assert found.perimeter == pytest.approx(theory.cap_perimeter(2.0, 2.0), rel=limit)
    assert found.area == pytest.approx(theory.cap_area(2.0, 2.0), rel=limit)


def test_one_isoline_in_the_plane_and_on_a_cylinder_is_right_without_extrapolation():
    """Where distances on facets are exact (or nearly), chords become arcs by both of their curvatures."""
    from warpedfoam.studies.measured_circle import _exact, _isoline
    from warpedfoam.studies.mesh_disk import mesh_disk

    flat, q = wf.FlatTorus(12.0, 12.0), np.array([0.13, 0.21, 0.0])
    faults = []
    for spacing in (0.4, 0.2):
        disk = mesh_disk(flat, q, 1.02, spacing)
        line = _isoline(flat, disk, _exact(disk, q, 1.0), 1.0, 0.0)
        faults.append(abs(line.perimeter / (2 * np.pi) - 1))
        assert line.area == pytest.approx(np.pi, rel=3e-4 if spacing == 0.4 else 3e-5)
    assert faults[0] < 3e-4
    assert faults[1] < 1e-5
    # the isoline of true distances on a tube: its chords are short by the tube's curvature too
    tube = wf.Cylinder(0.8, 20.0, periodic=True)
    centre = np.array([0.8, 0.0, 0.0])
    disk = mesh_disk(tube, centre, 1.02, 0.1)
    along = 0.8 * np.arctan2(disk.nodes[:, 1], disk.nodes[:, 0])
    line = _isoline(tube, disk, np.hypot(along, disk.nodes[:, 2]), 1.0, 0.0)
    assert line.perimeter == pytest.approx(2 * np.pi, rel=1e-5)


def test_points_lie_in_order_at_the_distance():
    for method in ("jacobi", "exact"):
        found = wf.geodesic_circle(wf.Sphere(1.0), [0.0, 0.0, 1.0], 0.8, method=method)
        np.testing.assert_allclose(found.points[:, 2], np.cos(0.8), atol=2e-3)
        angle = np.unwrap(np.arctan2(found.points[:, 1], found.points[:, 0]))
        steps = np.diff(np.append(angle, angle[0] + 2 * np.pi * np.sign(angle[-1] - angle[0])))
        assert (steps * steps[0] > 0).all()
        assert abs(steps.sum()) == pytest.approx(2 * np.pi)
        with pytest.raises(ValueError, match="read-only"):
            found.points[0] = 0.0


def test_meshes_have_the_circles_of_the_surface_they_sample():
    mesh, ring = FAMILY["mesh"].surface, wf.Torus(3.0, 1.0)
    for phi in (10.0, 170.0):
        q = at(phi, ring)
        want = wf.geodesic_circle(ring, q, 0.8)
        found = wf.geodesic_circle(mesh, q, 0.8)
        assert found.perimeter == pytest.approx(want.perimeter, rel=2e-4)
        assert found.error < 1e-3
        # on one and the same smooth surface the two ways agree much better
        again = wf.geodesic_circle(mesh, q, 0.8, method="exact", spacing=0.08)
        assert again.perimeter == pytest.approx(found.perimeter, rel=3e-5)


@pytest.mark.parametrize("name", ["egg", "ring", "vase", "hills", "crystal"])
def test_tracing_and_isolines_agree_on_formulas(name):
    surface = FAMILY[name].surface
    q = surface.random_points(1, 5)[0]
    radius = 0.35 / max(abs(k) for k in surface.curvature_range())
    traced = wf.geodesic_circle(surface, q, radius)
    found = wf.geodesic_circle(surface, q, radius, method="exact")
    assert found.perimeter == pytest.approx(traced.perimeter, rel=3e-6)
    assert found.area == pytest.approx(traced.area, rel=3e-6)


def test_scale_and_rotation_about_the_axis():
    one = wf.geodesic_circle(wf.Torus(3.0, 1.0), at(130.0, wf.Torus(3.0, 1.0)), 0.9)
    big = wf.Torus(300.0, 100.0)
    many = wf.geodesic_circle(big, at(130.0, big, theta=2.0), 90.0)
    assert many.perimeter == pytest.approx(100 * one.perimeter, rel=1e-11)
    assert many.area == pytest.approx(1e4 * one.area, rel=1e-11)


def test_film_over_the_circle():
    circle = wf.geodesic_circle(TORUS, at(0.0), 0.5)
    assert circle.film_area(0.5) == 0.5 * circle.perimeter
    assert circle.film_energy(0.5, 3.0) == 1.5 * circle.perimeter
    assert circle.series_limit == pytest.approx(24.0)
    assert circle.gaussian_curvature == pytest.approx(1 / 96)
    # the paper's cylinder, whose radius is ρ(V), costs E0 − E1 G up to the next order
    rho = float(theory.flat_radius(0.5, 0.5))
    energy = wf.geodesic_circle(TORUS, at(0.0), rho).film_energy(0.5)
    assert energy == pytest.approx(theory.cylinder_energy(0.5, 0.5, 1 / 96), abs=3e-6)


# ---------------------------------------------------------------------------- too large, or not numbers


def test_conjugate_points_are_refused():
    for radius in (3.2, 4.0, 7.0):
        with pytest.raises(ValueError, match="conjugate point"):
            wf.geodesic_circle(wf.Sphere(1.0), [0.0, 0.0, 1.0], radius)
    wf.geodesic_circle(wf.Sphere(1.0), [0.0, 0.0, 1.0], 3.1)


@pytest.mark.parametrize(
    ("surface", "centre", "limit"),
    [
        (TORUS, at(0.0), 4 * np.pi),
        (TORUS, at(180.0), 4 * np.pi),
        (wf.Cylinder(1.5, 20.0, periodic=True), [1.5, 0.0, 0.0], 1.5 * np.pi),
        (wf.FlatTorus(5.0, 9.0), [0.0, 0.0, 0.0], 2.5),
    ],
    ids=["outside", "inside", "tube", "sheet"],
)
def test_circles_beyond_the_injectivity_radius_are_refused(surface, centre, limit):
    wf.geodesic_circle(surface, centre, 0.999 * limit)
    for share in (1.0001, 1.05, 1.3):
        with pytest.raises(ValueError, match="crosses itself"):
            wf.geodesic_circle(surface, centre, share * limit)


def test_isolines_beyond_the_injectivity_radius_are_refused():
    torus = wf.Torus(3.0, 1.0)
    with pytest.raises(ValueError, match="one closed curve"):
        wf.geodesic_circle(torus, at(0.0, torus), 3.5, method="exact", spacing=0.4)
    with pytest.raises(ValueError, match="no point of the surface is that far"):
        wf.geodesic_circle(wf.Sphere(1.0), [0.0, 0.0, 1.0], 3.6, method="exact", spacing=0.4)
    with pytest.raises(ValueError, match="half the period"):
        wf.geodesic_circle(wf.FlatTorus(5.0, 9.0), [0.0, 0.0, 0.0], 2.4, method="heat")


@pytest.mark.parametrize(
    ("change", "fault", "says"),
    [
        ({"surface": TORUS.mesh}, TypeError, "surface must be a surface"),
        ({"surface": wf.Torus}, TypeError, "surface must be a surface"),
        ({"centre": [[24.0, 0.0, 0.0]]}, ValueError, "centre must have shape"),
        ({"centre": [np.nan, 0.0, 0.0]}, ValueError, "centre must be finite"),
        ({"centre": [0.0, 0.0, 1.0]}, ValueError, "axis"),
        ({"radius": 0.0}, ValueError, "radius must be greater than 0"),
        ({"radius": np.nan}, ValueError, "radius must be finite"),
        ({"radius": "1"}, TypeError, "radius must be a number"),
        ({"radius": 1e5}, ValueError, "ten times"),
        ({"method": "fast"}, ValueError, "method must be one of"),
        ({"spacing": 0.1}, ValueError, "needs no mesh"),
        ({"method": "exact", "spacing": -0.1}, ValueError, "spacing must be greater than 0"),
        ({"method": "exact", "spacing": 0.6}, wf.ResolutionError, "take a smaller spacing"),
        ({"method": "exact", "spacing": 1e-4}, wf.ResolutionError, "take a larger one"),
        ({"n_directions": 8}, ValueError, "n_directions must be at least 16"),
        ({"tolerance": 0.0}, ValueError, "tolerance must be at least"),
        ({"n_directions": 18}, ValueError, "multiple of 4"),
    ],
)
def test_bad_arguments(change, fault, says):
    arguments = {"surface": TORUS, "centre": [24.0, 0.0, 0.0], "radius": 0.5, **change}
    with pytest.raises(fault, match=says):
        wf.geodesic_circle(**arguments)
    circle = wf.geodesic_circle(wf.Sphere(1.0), [0.0, 0.0, 1.0], 0.5)
    with pytest.raises(ValueError, match="gap must be greater than 0"):
        circle.film_area(0.0)
