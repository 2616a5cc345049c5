"""Motion with friction: closed forms, orders in the time step, energies that only fall, volumes that stay."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import warpedfoam as wf
from warpedfoam.kernels.quadrature import lobatto
from warpedfoam.motion import markers
from warpedfoam.motion.drag import Across, Drag, FrictionLaw
from warpedfoam.motion.stepper import Stepper
from warpedfoam.relax.held import moved_points
from warpedfoam.relax.system import State

THIN = 1e-6
PAPER = wf.Torus(20.0, 4.0)


def orders(errors: list[float]) -> np.ndarray:
    out = np.log2(np.abs(errors[:-1]) / np.abs(errors[1:]))
    return np.asarray(out)


def circle(colatitude: float = 1.0, n_markers: int = 12, order: int = 6, turn: float = 0.0) -> wf.Foam:
    """A circle on the unit sphere, divided by markers."""
    angle = turn + 2.0 * np.pi * np.arange(n_markers) / n_markers
    sine, height = np.sin(colatitude), np.cos(colatitude)
    points = np.stack([sine * np.cos(angle), sine * np.sin(angle), np.full(n_markers, height)], axis=1)
    loop = list(range(n_markers))
    cell = wf.HeleShawCell(wf.Sphere(1.0), gap=0.01)
    foam = wf.Foam.from_loops(cell, points, [loop, loop[::-1]], order=order)
    tail, head = foam.film_ends
    left = np.cross(tail, head)
    left /= np.linalg.norm(left, axis=1, keepdims=True)
    length = np.arccos((tail * head).sum(axis=1))[:, None]
    along = lobatto(order).nodes[1:-1] * length
    # height of the great circle, and latitude over it that leads to the circle's height
    base = np.cos(along) * tail[:, 2:] + np.sin(along) * np.cross(left, tail)[:, 2:]
    lean = left[:, 2:]
    latitude = np.arctan2(lean, base) - np.sign(lean) * np.arccos(height / np.hypot(base, lean))
    return replace(foam, film_offsets=latitude / length, target_volumes=None)


def sphere_grains(n: int = 12) -> wf.Foam:
    cell = wf.HeleShawCell(wf.Sphere(1.0), gap=THIN)
    return wf.relax(wf.voronoi_foam(cell, n_bubbles=n, seed=3), order=8).foam


def one_bubble(phi: float = 2.5, order: int = 8, volume: float = 0.5) -> wf.Foam:
    cell = wf.HeleShawCell(PAPER, gap=0.5)
    at = PAPER.points(np.array([phi]), np.zeros(1))
    return wf.cluster_foam(cell, 1, volumes=volume, centre=at, order=order)


def quench(seed: int = 3, order: int = 3) -> wf.Foam:
    """Raw Voronoi cells that keep their volumes: far from rest, with a T1 or two to come."""
    cell = wf.HeleShawCell(wf.Sphere(1.0), gap=0.01)
    foam = wf.voronoi_foam(cell, n_bubbles=20, seed=seed, order=order)
    return replace(foam, target_volumes=None)


# ---------------------------------------------------------------------------- closed forms


def test_a_circle_on_a_sphere_obeys_its_closed_form() -> None:
    """cos θ = cos θ₀ exp(γ t/λ), first and second order in the step."""
    foam = circle()
    start = 1.0 - foam.bubble_areas.min() / (2.0 * np.pi)
    assert start == pytest.approx(np.cos(1.0), abs=1e-9)
    for method, order, friction in (("euler", 1.0, 1.0), ("extrapolated", 2.0, 2.0)):
        time, errors = 0.2 * friction, []
        for n in (4, 8):
            moved = wf.drift(
                foam, friction=friction, duration=time, every=time, step=time / n, method=method,
                hold_volumes=False,
            )  # fmt: skip
            cosine = 1.0 - moved.foam.bubble_areas.min() / (2.0 * np.pi)
            errors.append(cosine - start * np.exp(time / friction))
            assert moved.n_steps == n
            assert moved.n_rejected == 0
        assert orders(errors) == pytest.approx(order, abs=0.25)
        assert abs(errors[-1]) < (4e-3 if method == "euler" else 1e-5)


def reaper(width: float = 1.0, order: int = 8) -> wf.Foam:
    """A film along a channel ends in a vertex from which two films lead to the walls."""
    flat = wf.Graph(lambda x: np.zeros(len(x)), lambda x: np.zeros((len(x), 2)), 4.0 * width, width)
    speed = np.pi / (3.0 * width)
    back = -np.log(np.cos(np.pi / 6.0)) / speed
    points = np.array([[0, 0, 0], [-back, 0.5 * width, 0], [-back, -0.5 * width, 0], [2.0 * width, 0, 0]])
    cell = wf.HeleShawCell(flat, gap=0.01)
    foam = wf.Foam.from_loops(cell, points, [(0, 3, 1), (0, 2, 3), (0, 1, 2)], order=order)
    offsets, (tail, head) = foam.film_offsets.copy(), foam.film_ends
    for k, (a, b) in enumerate(zip(tail, head, strict=True)):
        if max(abs(a[1]), abs(b[1])) < 0.1 * width:
            continue
        left = np.cross([0.0, 0.0, 1.0], b - a)
        for j, xi in enumerate(lobatto(order).nodes[1:-1]):
            for _ in range(50):
                x, y, _ = a + xi * (b - a) + offsets[k, j] * left
                from_wall = 0.5 * width - abs(y)
                fault = x + back + np.log(np.cos(speed * from_wall)) / speed
                slope = left[0] + np.tan(speed * from_wall) * np.sign(y) * left[1]
                offsets[k, j] -= fault / slope
    return replace(foam, film_offsets=offsets, target_volumes=None)


@pytest.mark.parametrize("method", ["euler", "extrapolated"])
def test_a_grim_reaper_moves_at_its_closed_form_speed(method: str) -> None:
    """v = γπ/(3wλ); since the shape only moves on, steps of any length are exact."""
    width, friction, time = 1.5, 2.0, 0.5
    foam = reaper(width)
    moved = wf.drift(
        foam, friction=friction, duration=time, every=time, step=time / 2, method=method, hold_volumes=False
    )
    way = np.pi * time / (3.0 * width * friction)
    inner = foam.network.vertex_degrees == 3
    ends = (foam.network.vertex_degrees == 1) & (np.abs(foam.vertex_points[:, 1]) > 0.1)
    for chosen in (inner, ends):
        shift = (moved.foam.vertex_points - foam.vertex_points)[chosen]
        np.testing.assert_allclose(shift[:, 0], way, atol=1e-9)
        np.testing.assert_allclose(shift[:, 1:], 0.0, atol=1e-9)
    np.testing.assert_allclose(moved.foam.film_offsets[1:], foam.film_offsets[1:], atol=1e-8)


def test_grain_growth_on_a_sphere() -> None:
    """dA/dt = (γ/λ)[(π/3)(n − 6) + A]: A(t) in closed form for every bubble."""
    time, friction = 0.1, 1.0
    smooth = wf.drift(
        sphere_grains(), duration=time / 5, every=time / 5, hold_volumes=False, t1=False, tolerance=1e-4
    ).foam
    rest = np.pi / 3.0 * (smooth.network.sides - 6)
    exact = (smooth.bubble_areas + rest) * np.exp(time / friction) - rest
    for method, order, counts in (("euler", 1.0, (4, 8)), ("extrapolated", 2.0, (8, 16))):
        errors = []
        for n in counts:
            moved = wf.drift(
                smooth, duration=time, every=time, step=time / n, method=method, hold_volumes=False, t1=False
            )
            errors.append(np.abs(moved.foam.bubble_areas - exact).max())
        assert orders(errors) == pytest.approx(order, abs=0.15)
    assert errors[-1] < 1e-6


def test_grain_growth_on_a_torus() -> None:
    """dA/dt = (γ/λ)[(π/3)(n − 6) + ∫ G dA], integrated by Simpson's rule over the frames."""
    surface = wf.Torus(2.0, 1.0)
    cell = wf.HeleShawCell(surface, gap=THIN)
    rest = wf.relax(wf.voronoi_foam(cell, n_bubbles=60, seed=3), order=6).foam
    time = 0.006
    start = wf.drift(
        rest, duration=time / 4, every=time / 4, hold_volumes=False, t1=False, tolerance=1e-4
    ).foam
    errors = []
    for n in (2, 4):
        moved = wf.drift(start, duration=time, every=time / n, step=time / n, hold_volumes=False, t1=False)
        weights = {2: [1, 4, 1], 4: [1, 4, 2, 4, 1]}[n]
        curvature = sum(w * f.bubble_curvatures for w, f in zip(weights, moved.foams, strict=True))
        grown = np.pi / 3.0 * (start.network.sides - 6) * time + curvature * time / (3 * n)
        errors.append(np.abs(moved.foam.bubble_areas - start.bubble_areas - grown).max())
    assert errors[0] < 1e-4 * time
    assert orders(errors)[0] > 1.7


# ---------------------------------------------------------------------------- energy and volumes


def test_what_the_energy_loses_is_dissipated() -> None:
    """dE/dt = −λ ∫ v² dA for a bubble that drifts down the torus."""
    start = wf.drift(one_bubble(), duration=40.0, every=40.0, tolerance=1e-2).foam
    shares = []
    for n in (2, 4):
        moved = wf.drift(start, friction=1.0, duration=200.0, every=200.0, step=200.0 / n)
        spent = float(np.diff(moved.step_times) @ moved.step_dissipation[1:])
        shares.append(spent / (moved.energies[0] - moved.energies[-1]) - 1.0)
    assert abs(shares[1]) < 2e-3
    assert orders(shares)[0] == pytest.approx(1.0, abs=0.1)


@pytest.mark.parametrize("method", ["euler", "extrapolated"])
def test_energy_falls_and_volumes_stay_through_t1s(method: str) -> None:
    foam = quench()
    time = 3.0 * 4.0 * np.pi / 20
    step = {"step": time / 60} if method == "euler" else {}
    moved = wf.drift(foam, duration=time, every=time / 3, tolerance=1e-2, method=method, **step)
    assert moved.completed, moved.message
    assert moved.n_t1 >= 1
    assert (np.diff(moved.step_energies) < 0.0).all()
    assert moved.volume_errors.max() < 1e-10
    for event in moved.events:
        assert event.energy_after < event.energy_before
        assert set(event.losers).isdisjoint(event.gainers)
    sides = moved.foam.network.sides - foam.network.sides
    counted = np.zeros_like(sides)
    for event in moved.events:
        np.add.at(counted, list(event.gainers), 1)
        np.add.at(counted, list(event.losers), -1)
    np.testing.assert_array_equal(sides, counted)
    assert moved.foam.network.charges.sum() == 12


def test_a_foam_comes_to_rest_where_relax_does() -> None:
    foam = quench(seed=5, order=4)
    moved = wf.drift(foam, duration=40.0, every=20.0, tolerance=0.02)
    rest = wf.relax(moved.foam)
    assert rest.converged
    assert rest.iterations <= 3
    assert moved.energies[-1] == pytest.approx(rest.energy, rel=1e-9)
    np.testing.assert_allclose(moved.foam.pressures, rest.pressures, atol=1e-5)


@pytest.mark.slow
def test_volumes_over_a_thousand_steps() -> None:
    foam = one_bubble(order=4)
    moved = wf.drift(foam, duration=1000.0, every=100.0, step=1.0, method="euler")
    assert moved.n_steps == 1000
    assert moved.volume_errors.max() < 1e-10
    assert (np.diff(moved.step_energies) <= 1e-13 * moved.energies[0]).all()


def test_a_bubble_finds_the_outer_equator() -> None:
    moved = wf.drift(one_bubble(0.2, order=6), duration=1.5e5, every=7.5e4, tolerance=0.1)
    assert abs(PAPER.angles(moved.centres[-1, :1])[0][0]) < 5e-3
    # the ruled film's energy there, computed independently
    assert moved.energies[-1] / (2.0 * np.sqrt(np.pi * 0.25)) == pytest.approx(0.999562686, abs=2e-7)
    # markers have kept their distance on the way
    assert np.ptp(moved.foam.film_lengths) < 0.2 * moved.foam.film_lengths.mean()


# ---------------------------------------------------------------------------- invariance


def test_time_scales_with_friction() -> None:
    foam = one_bubble()
    one = wf.drift(foam, friction=1.0, duration=3.0, every=3.0, step=0.5)
    two = wf.drift(foam, friction=2.0, duration=6.0, every=6.0, step=1.0)
    np.testing.assert_allclose(two.foam.vertex_points, one.foam.vertex_points, atol=1e-11)
    stiff = wf.drift(replace(foam, tension=3.0), friction=3.0, duration=3.0, every=3.0, step=0.5)
    np.testing.assert_allclose(stiff.foam.vertex_points, one.foam.vertex_points, atol=1e-11)


def test_a_turned_foam_moves_alike() -> None:
    foam = one_bubble()
    c, s = np.cos(0.7), np.sin(0.7)
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    turned = replace(foam, vertex_points=foam.vertex_points @ turn.T)
    one = wf.drift(foam, duration=5.0, every=5.0, step=1.0)
    other = wf.drift(turned, duration=5.0, every=5.0, step=1.0)
    np.testing.assert_allclose(other.foam.vertex_points, one.foam.vertex_points @ turn.T, atol=1e-10)


# ---------------------------------------------------------------------------- parts


@pytest.mark.parametrize("yielding", [0.0, 0.3])
@pytest.mark.parametrize("make", [one_bubble, sphere_grains], ids=["torus", "sphere"])
def test_derivatives_of_friction(make, yielding: float) -> None:
    """Gradient and Hessian of D against differences of D."""
    foam = make()
    stepper = Stepper(foam, FrictionLaw(1.3, yielding), hold_volumes=True, method="euler")
    start = stepper.state_of(foam)
    rng = np.random.default_rng(0)

    def shaken(state: State, size: float) -> State:
        steps = size * stepper.length * rng.standard_normal((len(state.points), 2))
        points = moved_points(foam.cell.surface, state.network, state.points, steps)
        return replace(
            state, points=points, offsets=state.offsets + size * rng.standard_normal(state.offsets.shape)
        )

    here, base = (
        Across(foam.cell, start, stepper.length),
        Across(foam.cell, shaken(start, 0.01), stepper.length),
    )
    drag = Drag(here, base, stepper.law, 0.7, stepper.unit)
    drag.blunt = 300.0
    assert Drag(here, here, stepper.law, 0.7, stepper.unit).dissipated(start) == 0.0
    state = shaken(base.state, 0.01)
    n, count = foam.order + 3, foam.network.n_films
    force, hessian = np.zeros((n, count)), np.zeros((n, n, count))
    drag.add(state, force, hessian)
    np.testing.assert_allclose(hessian, hessian.transpose(1, 0, 2), atol=1e-12)
    vertex = rng.standard_normal((len(state.points), 2))
    offset = rng.standard_normal(state.offsets.shape)
    way = np.concatenate([vertex[state.network.tails].T, vertex[state.network.heads].T, offset.T])

    def paid(h: float) -> float:
        points = moved_points(foam.cell.surface, state.network, state.points, h * stepper.length * vertex)
        moved = replace(state, points=points, offsets=state.offsets + h * offset)
        phi = drag.law.potential(drag.displacements(moved), drag.time, drag.blunt)
        return float((base.areas * phi).sum()) / stepper.unit

    force[:4] *= 1.0
    h = 1e-4
    assert (paid(h) - paid(-h)) / (2 * h) == pytest.approx(float((force * way).sum()), rel=1e-5)
    second = (paid(h) - 2 * paid(0.0) + paid(-h)) / h**2
    assert second == pytest.approx(float(np.einsum("if,ijf,jf->", way, hessian, way)), rel=1e-4)


def test_displacements_are_right_to_third_order() -> None:
    """A circle that grows and turns: each node's normal displacement is the growth, however it slides."""
    one, errors = circle(1.0), []
    stepper = Stepper(one, FrictionLaw(1.0), hold_volumes=True, method="euler")
    for growth in (0.1, 0.05):
        states = [stepper.state_of(foam) for foam in (one, circle(1.0 + growth, turn=growth))]
        here, there = (Across(one.cell, state, stepper.length) for state in states)
        drag = Drag(here, there, stepper.law, 1.0, 1.0)
        errors.append(np.abs(np.abs(drag.displacements(states[1])) - growth).max())
        # seen from one end alone it is right to second order only
        assert np.abs(np.abs(here.displacements(states[1])) - growth).max() > 5.0 * errors[-1]
    assert orders(errors)[0] > 2.7


def test_spacing_markers_keeps_the_shape() -> None:
    foam = wf.relax(one_bubble(order=12)).foam
    # relaxed outlines have theirs nearly even
    foam = wf.remove_markers(wf.add_markers(foam, [0], 0.93), foam.network.heads[:1])
    stepper = Stepper(foam, FrictionLaw(1.0), hold_volumes=True, method="euler")
    state = stepper.state_of(foam)
    assert np.ptp(foam.film_lengths) > 0.03
    for _ in range(12):
        fresh = markers.spaced(foam.cell, state)
        if fresh is None:
            break
        state = fresh
    else:
        pytest.fail("markers never came to the middle")
    after = stepper.foam_of(state)
    assert np.ptp(after.film_lengths) < 0.15 * after.film_lengths.mean()
    assert after.energy == pytest.approx(foam.energy, rel=1e-9)
    assert stepper.volume_error(state) < 1e-8
    curves = [f.film_curves(40).reshape(-1, 3) for f in (foam, after)]
    apart = np.linalg.norm(curves[0][:, None] - curves[1][None], axis=2).min(axis=1)
    assert apart.max() < 0.02 * foam.bubble_size


# ---------------------------------------------------------------------------- yield friction


def test_yield_friction_stops_a_bubble_where_it_should() -> None:
    """|dE/ds| = ∮ τ |ν·e| dA, about 4 ρ τ d: nine tenths of that and it moves, eleven and it creeps."""
    cell = wf.HeleShawCell(PAPER, gap=0.05)
    steepest = np.radians(112.0)
    at = PAPER.points(np.array([steepest]), np.zeros(1))
    held = wf.cluster_potential(cell, 1, volumes=0.05, points=at, order=6)
    pull, foam = float(np.linalg.norm(held.forces[0])), held.foams[0]
    radius = np.sqrt(0.05 / (np.pi * 0.05))
    limit = pull / (4.0 * radius * 0.05)
    free = pull / (np.pi * radius * 0.05)
    speeds = {}
    for share in (0.0, 0.9, 1.1):
        moved = wf.drift(
            foam, duration=40.0, every=20.0, step=20.0, method="euler", yield_friction=share * limit
        )
        assert moved.completed, moved.message
        phi = PAPER.angles(moved.centres[1:, 0])[0]
        speeds[share] = 4.0 * (phi[0] - phi[1]) / 20.0 / free
    assert speeds[0.0] == pytest.approx(1.0, abs=0.03)
    assert speeds[0.9] == pytest.approx(0.1, abs=0.03)
    assert 0.0 < speeds[1.1] < 0.01


# ---------------------------------------------------------------------------- bad input and bad ends


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"friction": 0.0}, "friction must be greater than 0"),
        ({"duration": -1.0}, "duration must be greater than 0"),
        ({"every": 0.0}, "every must be greater than 0"),
        ({"yield_friction": -0.1}, "yield_friction must be at least 0"),
        ({"tolerance": 1.0}, "tolerance must be at most"),
        ({"method": "rk4"}, "method must be one of"),
        ({"method": "euler"}, "step must be given"),
        ({"cutoff": 0.5}, "cutoff must be at most"),
        ({"resume": True}, "resume needs trajectory"),
        ({"trajectory": "run.txt"}, "must end in"),
    ],
)
def test_bad_options_are_named(options: dict, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        wf.drift(one_bubble(order=4), **{"duration": 1.0, **options})


def test_bad_types_are_named() -> None:
    with pytest.raises(TypeError, match="foam must be a Foam"):
        wf.drift("foam", duration=1.0)  # type: ignore[arg-type]
    with pytest.raises(TypeError, match="progress must be callable"):
        wf.drift(one_bubble(order=4), duration=1.0, progress=3)  # type: ignore[arg-type]


def test_a_start_far_from_its_volumes_is_refused() -> None:
    cell = wf.HeleShawCell(wf.Sphere(1.0), gap=0.01)
    with pytest.raises(ValueError, match="brought to its volumes"):
        wf.drift(wf.voronoi_foam(cell, n_bubbles=20, seed=1), duration=1.0)


def test_a_grain_that_vanishes_ends_the_run() -> None:
    """No pressure holds a small circle: it shrinks to nothing, and the run says when it stopped."""
    foam = one_bubble(order=4, volume=0.05)
    moved = wf.drift(foam, duration=10.0, every=1.0, hold_volumes=False, tolerance=0.1)
    assert not moved.completed
    assert "bubble 0 has all but vanished" in moved.message
    # a flat circle lives for A λ/(2πγ)
    assert moved.times[-1] == pytest.approx(0.05 / 0.5 / (2.0 * np.pi), rel=0.1)


def test_a_fixed_step_that_is_too_long_is_shortened() -> None:
    moved = wf.drift(one_bubble(order=4), duration=4e3, every=4e3, step=4e3, method="euler")
    assert moved.completed
    assert moved.n_rejected > 0
    assert moved.n_steps > 1
    assert (np.diff(moved.step_energies) < 0.0).all()


def test_the_shortest_steps_end_at_round_off() -> None:
    """Friction makes round-off of positions a force in steps of 1e-7 of the time scale."""
    cell = wf.HeleShawCell(wf.Sphere(10.0), 0.5)
    rest = wf.relax(wf.voronoi_foam(cell, 20, seeds="lattice")).foam
    moved = wf.drift(rest, duration=2e-4, every=4e-6)
    assert moved.completed, moved.message
    assert np.abs(moved.foam.vertex_points - rest.vertex_points).max() < 1e-9
