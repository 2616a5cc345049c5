"""Formulas of `warpedfoam.theory` against closed forms, limits, quadrature and independent 3D solutions."""

from __future__ import annotations

import inspect

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad

from warpedfoam import theory as th

volumes = st.floats(0.05, 5.0)
gaps = st.floats(0.02, 0.4)
curvatures = st.floats(-0.3, 0.3)

#: Full 3D films, independent spectral computation, error below 1e-9: E/E0 on spheres (r, V) and at φ on the
#: torus (20, 4), V = 0.5; d = 0.5.
SPHERES = {(10.0, 0.3): 0.999658749, (10.0, 0.5): 0.999513760}
TORUS = {0.0: 0.999517699, 90.0: 1.000019111, 180.0: 1.000791843}
#: The same with films made of normals.
RULED = {0.0: 0.999562686, 90.0: 1.000072659, 180.0: 1.000864669}


# ---------------------------------------------------------------------------- the paper's models


def test_numbers_of_the_paper():
    np.testing.assert_allclose(th.flat_radius([0.3, 0.7], 0.5), [0.4370, 0.6676], atol=5e-5)
    np.testing.assert_allclose(th.relative_volume([0.3, 0.7], 0.5), [2.4, 5.6], rtol=1e-14)
    assert th.critical_gap(0.5) == pytest.approx((np.pi * 0.5) ** (1 / 3), rel=1e-15)
    assert th.balancing_gap_change(0.5, 1 / 144) == pytest.approx(0.000368, abs=5e-7)
    np.testing.assert_allclose(
        th.torus_gaussian_curvature(np.radians([0, 90, 180]), 20, 4), [1 / 96, 0, -1 / 64], atol=1e-17
    )
    assert th.relative_gap(0.5, 0.01) == pytest.approx(0.05)


@given(rho=st.floats(0.01, 2.9), d=gaps, r=st.floats(1.0, 50.0))
def test_cones_are_shells_of_caps(rho, d, r):
    """Side and volume are integrals of perimeters and areas of the cap over the gap."""

    def at(t):
        return rho * (r + t) / r

    side = quad(lambda t: float(th.cap_perimeter(at(t), r + t)), 0.0, d)[0]
    inside = quad(lambda t: float(th.cap_area(at(t), r + t)), 0.0, d)[0]
    assert th.cone_film_area(rho, d, r) == pytest.approx(side, rel=1e-10)
    assert th.cone_volume(rho, d, r) == pytest.approx(inside, rel=1e-10)
    volume = th.cone_volume(rho, d, r)
    assert th.spherical_cone_energy(volume, d, r, 3.0) == pytest.approx(3.0 * side, rel=1e-10)
    assert th.spherical_cone_radius(volume, d, r) == pytest.approx(rho, rel=1e-9)
    literal = (
        np.pi
        * r**2
        * th.shell_factor(2, d, r)
        * np.sqrt(1 - (1 - 3 * volume / (2 * np.pi * th.shell_factor(3, d, r) * r**3)) ** 2)
    )
    assert th.spherical_cone_energy(volume, d, r) == pytest.approx(literal, rel=1e-6)


def test_erratum_of_the_cone_ratio():
    """The ratio tends to 1 for large spheres; the printed prefactor would make it vanish."""
    v, d = 0.5, 0.5
    r = np.array([10.0, 100.0, 1e4])
    ratio = th.spherical_cone_ratio(v, d, r)
    assert abs(ratio[-1] - 1) < 1e-8
    rho = th.flat_radius(v, d)
    root = np.sqrt(1 - (1 - 3 * v / (2 * np.pi * th.shell_factor(3, d, r) * r**3)) ** 2)
    np.testing.assert_allclose(
        ratio[:2], (th.shell_factor(2, d, r) * r**2 / (2 * rho * d) * root)[:2], rtol=1e-9
    )
    printed = 2 * rho * d / (th.shell_factor(2, d, r) * r**2) * root
    assert printed[-1] < 1e-3


@given(area=st.floats(0.01, 10.0), g=st.floats(-1.0, 0.9))
def test_disks_are_geodesic_circles(area, g):
    rho = np.sqrt(area / np.pi)
    for _ in range(60):  # Newton on A(ρ) = area; dA/dρ = C
        rho = rho - (th.circle_area(rho, g) - area) / th.circle_perimeter(rho, g)
    assert th.circle_perimeter(rho, g) == pytest.approx(th.disk_perimeter(area, g), rel=1e-8)


def test_the_2d_bubble_of_the_paper():
    s, r = 3.0, 2.0
    assert th.disk_perimeter(s, r**-2) == pytest.approx(
        2 * np.pi * r * np.sqrt(1 - (1 - s / (2 * np.pi * r**2)) ** 2), rel=1e-14
    )
    assert th.cap_perimeter(0.7, r) == pytest.approx(th.circle_perimeter(0.7, r**-2), rel=1e-14)
    assert th.cap_area(0.7, r) == pytest.approx(th.circle_area(0.7, r**-2), rel=1e-14)


@given(v=volumes, d=st.floats(0.2, 0.6), g=st.floats(-0.1, 0.1))
def test_cylinder_model_and_its_balance(v, d, g):
    rho = th.flat_radius(v, d)
    assert th.cylinder_energy(v, d, g, 2.0) == pytest.approx(
        2 * d * th.perimeter_series(rho, g, terms=2), rel=1e-12
    )
    share = th.curvature_coefficient(v, d) / th.flat_energy(v, d)
    assert share == pytest.approx(rho**2 / 6, rel=1e-12)
    change = th.balancing_gap_change(v, g)
    total = th.gap_energy_change(v, d, change) + th.curvature_energy_change(v, d, g)
    assert abs(total) < 1e-13
    if abs(g) > 1e-6:
        assert th.gap_to_curvature_ratio(v, change, g) == pytest.approx(-1.0, rel=1e-12)


def test_gap_change_to_first_order():
    h = np.array([1e-2, 5e-3])
    rest = th.gap_energy_change(0.5, 0.5, h, exact=True) - th.gap_energy_change(0.5, 0.5, h)
    assert rest[0] / rest[1] == pytest.approx(4.0, abs=0.1)
    exact = th.flat_energy(0.5, 0.51) - th.flat_energy(0.5, 0.5)
    assert th.gap_energy_change(0.5, 0.5, 0.01, exact=True) == pytest.approx(exact, rel=1e-12)


# ---------------------------------------------------------------------------- series


@pytest.mark.parametrize("g", [0.8, -0.8])
@pytest.mark.parametrize(("terms", "order"), [(1, 3), (2, 5), (3, 7)])
def test_series_where_curvature_is_constant(g, terms, order):
    rho = np.array([0.4, 0.2])
    c = np.abs(th.perimeter_series(rho, g, terms=terms) - th.circle_perimeter(rho, g))
    a = np.abs(th.area_series(rho, g, terms=terms) - th.circle_area(rho, g))
    assert np.log2(c[0] / c[1]) == pytest.approx(order, abs=0.05)
    assert np.log2(a[0] / a[1]) == pytest.approx(order + 1, abs=0.05)


@given(rho=st.floats(0.01, 2.0), g=curvatures, bend=curvatures, terms=st.integers(1, 3))
def test_the_area_is_the_integral_of_the_perimeter(rho, g, bend, terms):
    want = quad(lambda s: float(th.perimeter_series(s, g, bend, terms=terms)), 1e-300, rho)[0]
    assert th.area_series(rho, g, bend, terms=terms) == pytest.approx(want, rel=1e-10)


def test_validity():
    g = np.array([0.3, -0.02])
    rho = th.validity_radius(g)
    second = th.perimeter_series(rho, np.abs(g), terms=2)
    np.testing.assert_allclose(second, 0.0, atol=1e-12)
    np.testing.assert_allclose(th.curvature_from_perimeter(1.0, th.perimeter_series(1.0, g, terms=2)), g)
    np.testing.assert_allclose(th.curvature_from_area(1.0, th.area_series(1.0, g, terms=2)), g)


# ---------------------------------------------------------------------------- second order


def test_second_order_against_3d_films():
    """Residuals are of third order: about (k ρ)³ with k = 1/4 or 1/10 and ρ = 0.56, times a small number."""
    for (r, v), ratio in SPHERES.items():
        assert th.second_order_ratio(v, 0.5, 1 / r, 1 / r) == pytest.approx(ratio, abs=1.0e-7)
    for films, table in (("free", TORUS), ("ruled", RULED)):
        for phi, ratio in table.items():
            k = th.torus_curvatures(np.radians(phi), 20.0, 4.0)
            assert th.second_order_ratio(0.5, 0.5, *k, film=films) == pytest.approx(ratio, abs=2e-6)
    assert th.second_order_ratio(0.5, 0.5, 0.25, 1 / 24) == pytest.approx(0.999516919, abs=1e-9)
    assert th.second_order_ratio(0.5, 0.5, 0.25, -1 / 16) == pytest.approx(1.000793366, abs=1e-9)
    # r = 12: energy, pressure and contact radii of the 3D film
    assert th.second_order_energy(0.5, 0.5, 1 / 12, 1 / 12) == pytest.approx(1.77185042614, abs=1e-7)
    assert th.second_order_pressure(0.5, 0.5, 1 / 12, 1 / 12) == pytest.approx(1.770933247, abs=1e-7)
    k = th.midway_curvature(1 / 12, 0.5)
    t = np.array([-0.25, 0.25])
    away = th.flat_radius(0.5, 0.5) + th.film_displacement(0.5, 0.5, k, k, t, 0.0)
    np.testing.assert_allclose((1 / k + t) * np.sin(away * k), [0.55166956, 0.57632222], atol=2e-5)


def test_error_on_spheres_falls_at_least_as_the_third_power():
    """Full 3D films, V = d = 0.5, at r = 10 and r = 12."""
    films = np.array([0.999513760, 1.77185042614 / float(th.flat_energy(0.5, 0.5))])
    fault = np.abs(th.second_order_ratio(0.5, 0.5, [0.1, 1 / 12], [0.1, 1 / 12]) - films)
    assert np.log(fault[0] / fault[1]) / np.log(1.2) > 3.0


def test_cone_is_the_ruled_film_on_a_sphere_and_the_error_is_of_fourth_order():
    """From midway a sphere has only even powers of its curvature, so the error falls faster than k³."""
    for v in (0.3, 0.7):
        r = 5.0 * 2.0 ** np.arange(4)
        exact = th.spherical_cone_ratio(v, 0.5, r)
        fault = np.abs(th.second_order_ratio(v, 0.5, 1 / r, 1 / r, film="ruled") - exact)
        slopes = np.log2(fault[:-1] / fault[1:])
        assert (slopes[:2] > 3.7).all()
        size = th.second_order_coefficients(v, 0.5, "ruled").gauss / r**2
        np.testing.assert_allclose(exact - 1, size, rtol=0.2)


def test_the_bulge_solves_its_equations():
    """ρ u_tt + (u + u_ψψ)/ρ + t (H − 3 D cos 2ψ) = 0, upright at both plates, for k1, k2 midway."""
    v, d, k1, k2 = 0.4, 0.6, 0.3, -0.1
    rho, h = float(th.flat_radius(v, d)), 1e-3
    t, psi = np.meshgrid(np.linspace(-0.29, 0.29, 9), np.linspace(0, 6, 7), indexing="ij")

    def u(t, psi):
        return th.film_displacement(v, d, k1, k2, t, psi)

    u_tt = (u(t + h, psi) - 2 * u(t, psi) + u(t - h, psi)) / h**2
    u_pp = (u(t, psi + h) - 2 * u(t, psi) + u(t, psi - h)) / h**2
    push = t * (0.5 * (k1 + k2) - 1.5 * (k1 - k2) * np.cos(2 * psi))
    np.testing.assert_allclose(rho * u_tt + (u(t, psi) + u_pp) / rho + push, 0.0, atol=1e-6)
    for end in (-0.3, 0.3):
        inner = end - np.sign(end) * h * np.arange(3)
        slope = (3 * u(inner[0], 0.4) - 4 * u(inner[1], 0.4) + u(inner[2], 0.4)) / (2 * h)
        assert abs(slope) < 1e-6


@pytest.mark.parametrize("film", ["free", "ruled"])
def test_coefficients_are_minima_of_the_quadratic_form(film):
    """The bulge's energy by quadrature: half the work of the load −t (H − 3D cos 2ψ) over it."""
    v, d, k1, k2 = 0.4, 0.6, 0.3, -0.1
    rho = float(th.flat_radius(v, d))
    gauss, mean, twist = th.second_order_coefficients(v, d, film)
    t, w = np.polynomial.legendre.leggauss(24)
    psi = 2 * np.pi * np.arange(32) / 32
    height, angle = np.meshgrid(0.5 * d * t, psi, indexing="ij")
    big, small = 0.5 * (k1 + k2), 0.5 * (k1 - k2)
    u = th.film_displacement(v, d, k1, k2, height, angle)
    load = -height * (big - 3 * small * np.cos(2 * angle))
    work = 0.5 * (0.5 * d * w) @ (load * u).sum(axis=1) * (2 * np.pi / 32) / (2 * np.pi * rho * d)
    rest = mean * big**2 + (twist - d**2 / 48) * small**2
    assert rest == pytest.approx(work if film == "free" else 0.0, abs=1e-14)
    assert gauss == pytest.approx(-(rho**2 / 8 + d**2 / 24), rel=1e-14)


@given(v=st.floats(0.3, 2.0), d=st.floats(0.05, 0.6), k1=curvatures, k2=curvatures, c=st.floats(0.1, 10.0))
def test_symmetries_of_second_order(v, d, k1, k2, c):
    free = th.second_order_ratio(v, d, k1, k2)
    assert free == th.second_order_ratio(v, d, k2, k1)
    assert free == pytest.approx(th.second_order_ratio(c**3 * v, c * d, k1 / c, k2 / c), rel=1e-12)
    assert free <= th.second_order_ratio(v, d, k1, k2, film="ruled") + 1e-15  # a film that may bulge does
    midway = th.midway_curvature([k1, k2], d)
    assert free == pytest.approx(th.second_order_ratio(v, d, *midway, height=0.5 * d), rel=1e-14)
    # seen from the other side every curvature changes its sign and inner and outer plate their places
    outer = midway / (1 + 0.5 * d * midway)
    assert free == pytest.approx(th.second_order_ratio(v, d, *(-outer), height=0.0), rel=1e-13)


@pytest.mark.parametrize("film", ["free", "ruled"])
def test_pressure_is_the_derivative_by_volume(film):
    v, h = np.array([0.3, 0.5, 2.0]), 1e-5
    for k in ((0.25, 0.1), (0.25, -0.06), (0.2, 0.0), (0.1, 0.1)):
        ahead = th.second_order_energy(v + h, 0.5, *k, 1.7, film=film)
        behind = th.second_order_energy(v - h, 0.5, *k, 1.7, film=film)
        found = th.second_order_pressure(v, 0.5, *k, 1.7, film=film)
        np.testing.assert_allclose(found, (ahead - behind) / (2 * h), rtol=1e-8)


def test_what_delta_measures():
    v = np.array([0.3, 0.5, 5.0, 500.0])
    np.testing.assert_allclose(th.sphere_delta(v, 0.5, "ruled"), 0.75 + np.pi * 0.125 / (4 * v), rtol=1e-12)
    assert th.sphere_delta(500.0, 0.5) == pytest.approx(0.75, abs=1e-3)
    # from exact cones of large spheres
    r = 1e3
    delta = (1 - th.spherical_cone_ratio(v[:3], 0.5, r)) / (1 - th.fitted_ratio(1.0, v[:3], 0.5, r**-2))
    np.testing.assert_allclose(delta, th.sphere_delta(v[:3], 0.5, "ruled"), rtol=2e-3)
    # the coefficient of G at fixed area: P = sqrt(4πA − G A²) loses ¾ of what C at fixed ρ loses
    a, g = 0.01, 0.1
    lost = 2 * np.sqrt(np.pi * a) - th.disk_perimeter(a, g)
    rho = np.sqrt(a / np.pi)
    assert lost / (2 * np.pi * rho - th.perimeter_series(rho, g, terms=2)) == pytest.approx(0.75, rel=1e-3)


def test_cylindrical_cells_shift_the_energy():
    """G = 0, and still E ≠ E0: the paper's open question."""
    k = th.midway_curvature(0.25, 0.5)
    _, mean, twist = th.second_order_coefficients(0.5, 0.5)
    assert th.second_order_ratio(0.5, 0.5, 0.25, 0.0) - 1 == pytest.approx(
        (mean + twist) * k**2 / 4, rel=1e-9
    )
    assert 1e-6 < abs(th.second_order_ratio(0.5, 0.5, 0.25, 0.0) - 1) < 1e-4


def test_free_films_beyond_the_critical_gap_are_refused():
    d = th.critical_gap(0.5)
    th.second_order_ratio(0.5, 0.999 * d, 0.1, 0.1)
    for gap in (1.001 * d, 3 * d):
        with pytest.raises(ValueError, match="d_crit"):
            th.second_order_ratio(0.5, gap, 0.1, 0.1)
    assert np.isfinite(th.second_order_ratio(0.5, 3 * d, 0.1, 0.1, film="ruled"))


# ---------------------------------------------------------------------------- arrays and bad input


def test_everything_broadcasts():
    v, d = np.linspace(0.3, 0.7, 5)[:, None], np.array([0.2, 0.4, 0.5])
    for found in (
        th.flat_energy(v, d),
        th.cylinder_energy(v, d, 0.01),
        th.spherical_cone_ratio(v, d, 10.0),
        th.second_order_energy(v, d, 0.1, 0.2),
        th.second_order_pressure(v, d, 0.1, 0.2),
        th.sphere_delta(v, d),
        th.gap_energy_change(v, d, 0.01),
        th.perimeter_series(v, d, 0.1),
        *th.second_order_coefficients(v, d, "ruled"),
    ):
        assert found.shape == (5, 3)
        assert np.isfinite(found).all()


@pytest.mark.parametrize("name", sorted(set(th.__all__) - {"Coefficients", "shell_factor"}))
def test_every_formula_refuses_what_is_no_number(name):
    formula = getattr(th, name)
    needed = {"height": 0.0, "angle": 0.0, "k1": 0.1, "k2": 0.1}
    names = [p.name for p in inspect.signature(formula).parameters.values() if p.default is p.empty]
    good = {"major_radius": 20.0, "minor_radius": 4.0, "sphere_radius": 10.0, **needed}
    for bad, fault in ((np.nan, ValueError), ("one", TypeError), (None, TypeError), (1j, TypeError)):
        for which in names:
            arguments = {n: good.get(n, 0.5) for n in names}
            arguments[which] = bad
            with pytest.raises(fault, match=which):
                formula(**arguments)


@pytest.mark.parametrize(
    ("call", "says"),
    [
        (lambda: th.flat_energy(0.0, 0.5), "volume must be greater than 0, found 0"),
        (lambda: th.flat_energy(0.5, [0.5, -1.0]), "gap must be greater than 0, found -1"),
        (lambda: th.flat_energy([[1.0], [1.0, 2.0]], 0.5), "volume must be a number or a rectangular"),
        (lambda: th.spherical_cone_energy(1e6, 0.5, 10.0), "volume must be at most that of the shell"),
        (lambda: th.cap_area(4.0, 1.0), "radius must be at most π"),
        (lambda: th.circle_perimeter(4.0, 1.0), "radius must be at most π/sqrt"),
        (lambda: th.disk_perimeter(13.0, 1.0), "area must be at most 4π/G"),
        (lambda: th.torus_curvatures(0.0, 4.0, 4.0), "major_radius must exceed"),
        (lambda: th.perimeter_series(1.0, 1.0, terms=4), "terms must be at most 3"),
        (lambda: th.gap_energy_change(0.5, 0.5, -0.5), "must leave a gap"),
        (lambda: th.gap_to_curvature_ratio(0.5, 0.1, [1.0, 0.0]), "must not be 0"),
        (lambda: th.midway_curvature(-5.0, 0.5), "folds"),
        (lambda: th.second_order_ratio(0.5, 0.5, 0.1, 0.1, film="bent"), "film must be one of"),
        (lambda: th.film_displacement(0.5, 0.5, 0.1, 0.1, 0.3, 0.0), "height must lie between"),
        (lambda: th.fit_delta([1.0], 0.5, 0.5, [0.0]), "there is no Δ to fit"),
    ],
)
def test_values_out_of_range_are_refused(call, says):
    with pytest.raises(ValueError, match=says):
        call()
