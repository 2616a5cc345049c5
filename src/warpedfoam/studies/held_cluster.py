"""A cluster relaxed with its centre of volume held, and perhaps its orientation: constraints and Newton."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from warpedfoam.arrays import Floats, Ints, frozen
from warpedfoam.cell import HeleShawCell
from warpedfoam.foam import Foam
from warpedfoam.kernels.periodic import nearest_image
from warpedfoam.kernels.quadrature import lobatto
from warpedfoam.relax.held import held_vertices, moved_points
from warpedfoam.relax.kkt import KKT
from warpedfoam.relax.linear import SingularMatrixError, factoriser
from warpedfoam.relax.steps import EXACT_BELOW, SOFTNESS, VOLUME_STEP
from warpedfoam.relax.system import Linearised, State, Step, System, one_ring, pinned_unknowns, rigid_modes

#: Order of the rays from the held point to the outer films, and by how much rays outnumber a film's nodes.
RADIAL, MORE = 14, 6
#: Step of the four-point differences, in ℓ.
DIFFERENCE = 1e-3
#: Largest step, in ℓ, and the largest at which a cluster may have converged.
MOST_STEP = 0.2
#: Eigenvalues of the reduced matrix above this are no descent: motions that change nothing.
NEUTRAL = -1e-9
#: Singular values of the reduced system below this share of the largest are motions that change nothing.
RANK = 1e-11


@dataclass(frozen=True, eq=False)
class Hold:
    """Where a cluster's centre of volume is held, and its orientation.

    With the frame (e1, e2) at the point q the constraints are c_k = e_k · ∫ (x − q) w dA / V over the
    cluster, w = d + H d² + G d³/3 the volume per area, and, if ``arms`` (n_vertices, 2) are given,
    c_3 = Σ a × u / Σ |a|² with u the vertices' places in the frame: the mean turn away from the arms.
    ``bubbles`` are those whose centre is held: all but the exterior by default.
    """

    point: Floats
    frame: Floats
    arms: Floats | None
    bubbles: Ints | None = None

    @property
    def count(self) -> int:
        """Number of constraints."""
        return 2 if self.arms is None else 3


@dataclass(frozen=True, eq=False)
class HeldCluster:
    """A cluster at rest under the constraints' forces.

    ``force`` (3,) is −∇E, tangent at the held point; ``torque`` −dE/dα by the orientation, NaN where it is
    free; ``residual`` in γ d, ``displaced`` what is left of the constraints in ℓ. Of several holds these
    are the first one's; ``forces`` (k, 3) has all.
    """

    foam: Foam
    force: Floats
    torque: float
    residual: float
    displaced: float
    converged: bool
    is_minimum: bool
    iterations: int
    forces: Floats


def outer_films(foam: Foam, bubbles: Ints | None = None) -> tuple[np.ndarray, np.ndarray]:
    """Films round ``bubbles`` (None: all but the exterior), and +1 where these lie on their left, else −1."""
    network = foam.network
    mine = np.zeros(network.n_bubbles, dtype=np.bool_)
    if bubbles is None:
        mine[:] = True
        mine[foam.exterior] = False
    else:
        mine[bubbles] = True
    outer = np.flatnonzero(mine[network.left] != mine[network.right])
    return outer, np.where(mine[network.left[outer]], 1.0, -1.0)


def held_volume(foam: Foam, bubbles: Ints | None) -> float:
    """What the volumes of ``bubbles`` are to add up to; of all but the exterior if None."""
    if bubbles is not None:
        return float(foam.target_volumes[bubbles].sum())
    assert foam.exterior is not None
    return float(np.delete(foam.target_volumes, foam.exterior).sum())


def volume_moment(foam: Foam, about: Floats, bubbles: Ints | None = None) -> tuple[Floats, float]:
    """∫ (x − q) w dA over some bubbles, (3,), and their volume ∫ w dA, by one fan about q.

    Rays run from q (3,) through the surface to the outer films; both directions are differentiated
    spectrally, so that any surface will do.
    """
    surface, layer = foam.cell.surface, foam.cell.layer
    films, sign = outer_films(foam, bubbles)
    along, across = lobatto(foam.order + MORE), lobatto(RADIAL)
    tail, head = foam.film_ends
    curve = surface.arc_points(tail[films], head[films], foam.film_offsets[films], along.nodes)
    arm = curve - about
    if surface.period is not None:
        arm = arm - (arm - nearest_image(arm, surface.period))[:, :1]
    rays = about + across.nodes[:, None, None, None] * arm
    flat = surface.project(rays.reshape(-1, 3))
    normal = surface.normals(flat).reshape(rays.shape)
    curvature = surface.principal_curvatures(flat)
    weight = layer.density(flat, 0.5 * curvature.sum(axis=1), curvature.prod(axis=1))
    weight = weight.reshape(rays.shape[:-1])
    x = flat.reshape(rays.shape)
    outward = np.einsum("rs,sfkx->rfkx", across.derivative, x)
    forward = np.einsum("kl,rflx->rfkx", along.derivative, x)
    area = np.einsum("rfkx,rfkx->rfk", normal, np.cross(outward, forward))
    density = np.einsum("rfk,rfk,r,k,f->rfk", area, weight, across.weights, along.weights, sign)
    return np.einsum("rfk,rfkx->x", density, x - about), float(density.sum())


def constraints(foam: Foam, hold: Hold, volume: float) -> Floats:
    """c_1, c_2 in units of length, and c_3 if the orientation is held."""
    moment, _ = volume_moment(foam, hold.point, hold.bubbles)
    values = hold.frame @ moment / volume
    if hold.arms is None:
        return np.asarray(values)
    return np.append(values, _turn(foam.vertex_points, hold, foam))


def _places(points: Floats, hold: Hold, foam: Foam) -> Floats:
    away = points - hold.point
    if foam.cell.surface.period is not None:
        away = nearest_image(away, foam.cell.surface.period)
    out: Floats = away @ hold.frame.T
    return out


def _turn(points: Floats, hold: Hold, foam: Foam) -> float:
    assert hold.arms is not None
    u, a = _places(points, hold, foam), hold.arms
    return float((a[:, 0] * u[:, 1] - a[:, 1] * u[:, 0]).sum() / (a**2).sum())


def _gradients(foam: Foam, hold: Hold, volume: float, length: float) -> Floats:
    """Derivatives of c_1/ℓ, c_2/ℓ and c_3 by the films' unknowns, steps in ℓ: (count, p + 3, F).

    That of an integral over the cluster is ∮ f w δx · ν ds along its outline; δx by differences.
    """
    surface, network = foam.cell.surface, foam.network
    films, sign = outer_films(foam, hold.bubbles)
    rule = lobatto(foam.order + MORE)
    offsets, tail = foam.film_offsets[films], foam.vertex_points[network.tails[films]]
    head = foam.vertex_points[network.heads[films]]
    curve = surface.arc_points(tail, head, offsets, rule.nodes)
    slope = np.einsum("kl,flx->fkx", rule.derivative, curve)
    flat = curve.reshape(-1, 3)
    normal = surface.normals(flat).reshape(curve.shape)
    curvature = surface.principal_curvatures(flat)
    layer = foam.cell.layer
    weight = layer.density(flat, 0.5 * curvature.sum(axis=1), curvature.prod(axis=1)).reshape(
        curve.shape[:-1]
    )
    # steps out of the cluster times the length passed
    outward = np.cross(slope, normal) * sign[:, None, None]
    arm = curve - hold.point
    if surface.period is not None:
        arm = nearest_image(arm, surface.period)
    lever = np.einsum("k,fk,ix,fkx->ifk", rule.weights, weight, hold.frame, arm) / (volume * length)

    n = foam.order + 3
    out = np.zeros((hold.count, n, network.n_films))
    stencil = ((-2.0, 1.0 / 12.0), (-1.0, -2.0 / 3.0), (1.0, 2.0 / 3.0), (2.0, -1.0 / 12.0))
    for k in range(n):
        moved = np.zeros_like(curve)
        for times, share in stencil:
            a, b, u = tail, head, offsets
            if k < 4:
                step = np.zeros((len(films), 2))
                step[:, k % 2] = times * DIFFERENCE * length
                a = surface.retract(tail, step) if k < 2 else tail
                b = surface.retract(head, step) if k >= 2 else head
            else:
                u = offsets.copy()
                u[:, k - 4] += times * DIFFERENCE
            moved += share / DIFFERENCE * surface.arc_points(a, b, u, rule.nodes)
        out[:2, k, films] = np.einsum("ifk,fkx,fkx->if", lever, moved, outward)
    if hold.arms is not None:
        a = hold.arms / (hold.arms**2).sum()
        pull = length * (a[:, :1] * hold.frame[1] - a[:, 1:] * hold.frame[0])
        steps = np.einsum("vix,vx->vi", surface.vertex_frames(foam.vertex_points), pull)
        # each vertex counts once, on the first half-film that leaves it
        order = np.argsort(network.origin, kind="stable")
        half = order[np.searchsorted(network.origin[order], np.arange(network.n_vertices))]
        row = 2 * (half & 1)
        out[2, row, half >> 1] = steps[:, 0]
        out[2, row + 1, half >> 1] = steps[:, 1]
    held = held_vertices(surface, network, foam.vertex_points, foam.film_offsets)
    if held is not None:
        where = np.full(network.n_vertices, -1)
        where[held.vertices] = np.arange(len(held.vertices))
        for first, ends in ((0, network.tails), (2, network.heads)):
            film = np.flatnonzero(where[ends] >= 0)
            t = held.directions[where[ends[film]]].T
            part = out[:, first : first + 2, film]
            out[:, first : first + 2, film] = part - np.einsum("cif,if,jf->cjf", part, t, t)
    return out


def _inner(gradient: Floats, step: Step, foam: Foam) -> Floats:
    """Change of constraints with film gradients (…, p + 3, F) by a step."""
    network = foam.network
    unknowns = np.concatenate(
        [step.vertices[network.tails].T, step.vertices[network.heads].T, step.offsets.T]
    )
    out: Floats = np.einsum("...if,if->...", gradient, unknowns)
    return out


def _free_motions(foam: Foam, state: State, gradient: Floats) -> Floats | None:
    """Rigid motions that no constraint forbids, orthonormal columns; their forces are quadrature error."""
    modes = rigid_modes(foam.cell, state)
    if not len(modes):
        return None
    none = np.zeros_like(foam.film_offsets)
    steps = [Step(mode.reshape(-1, 2), none, np.zeros(foam.n_bubbles)) for mode in modes]
    seen = np.stack([_inner(gradient, step, foam) for step in steps], axis=1)
    _, size, rows = np.linalg.svd(seen)
    rank = int((size > 1e-3 * size.max(initial=1e-300)).sum())
    free = rows[rank:] @ modes
    return np.linalg.qr(free.T)[0] if len(free) else None


def _pins(foam: Foam, hold: Hold) -> np.ndarray:
    """Vertex unknowns that fix the cluster's place and turn."""
    from scipy.linalg import qr

    frames = foam.cell.surface.vertex_frames(foam.vertex_points)
    normal = np.cross(hold.frame[0], hold.frame[1])
    away = _places(foam.vertex_points, hold, foam) @ hold.frame
    fields = np.stack([np.broadcast_to(e, away.shape) for e in hold.frame] + [np.cross(normal, away)])
    modes = np.einsum("kvx,vix->kvi", fields, frames)
    held = held_vertices(foam.cell.surface, foam.network, foam.vertex_points, foam.film_offsets)
    if held is not None:
        t = held.directions
        modes[:, held.vertices] -= np.einsum("kmi,mi,mj->kmj", modes[:, held.vertices], t, t)
    count = 3 if (foam.network.vertex_degrees == 3).any() else 2
    flat = modes.reshape(3, -1)[:count]
    return np.asarray(qr(flat, mode="economic", pivoting=True)[2][:count])


def relax_held(
    foam: Foam, hold: Hold | Sequence[Hold], *, tolerance: float, max_iterations: int
) -> HeldCluster:
    """Newton's method on the foam's KKT system bordered by the constraints of one hold or of several.

    The matrix is factored with stiffnesses on a few vertex unknowns, which fix the motions that the
    constraints forbid, and these are taken out again together with the border (Woodbury). Second
    derivatives of the constraints are left out: they come times their small multipliers. Far from rest
    the steps are shifted as in `warpedfoam.relax`.
    """
    surface, network = foam.cell.surface, foam.network
    method = factoriser("superlu", foam.n_bubbles)
    system = System(foam.cell, foam.target_volumes, foam.order, method, foam.n_bubbles, foam.exterior)
    scale = foam.tension * system.film_unit / system.mean_volume
    start = np.zeros(foam.n_bubbles) if foam.pressures is None else foam.pressures / scale
    state = State(network, foam.vertex_points, foam.film_offsets, start)
    holds = (hold,) if isinstance(hold, Hold) else tuple(hold)
    volumes = [held_volume(foam, one.bubbles) for one in holds]
    counts = [one.count for one in holds]
    first = np.cumsum([0, *counts])
    force, length = np.zeros(first[-1]), system.length
    unit = np.concatenate([[length, length, 1.0][:count] for count in counts])
    iteration, now = 0, foam
    while True:
        lin = system.linearise(state)
        now = replace(
            foam, vertex_points=state.points, film_offsets=state.offsets, pressures=state.pressures * scale
        )
        pairs = list(zip(holds, volumes, strict=True))
        values = np.concatenate([constraints(now, one, volume) for one, volume in pairs]) / unit
        gradient = np.concatenate([_gradients(now, one, volume, length) for one, volume in pairs])
        lin.rigid = _free_motions(now, state, gradient)
        loaded = lin.loaded(lin.force + np.einsum("c,cif->if", force, gradient))
        fault = float((np.abs(lin.volume_fault) / lin.system.shares).max())
        displaced = float(np.abs(values).max())
        done = loaded.residuals.force <= tolerance and max(fault, displaced) <= max(0.1 * tolerance, 1e-11)
        try:
            pins = _pins(now, holds[0])
            if len(holds) > 1:
                # what the first hold alone does not fix
                pins = np.union1d(pins, pinned_unknowns(foam.cell, state))
            step, change, is_minimum = _step(now, loaded, gradient, values, pins)
        except SingularMatrixError:
            step = None
        finite = step is not None and all(np.isfinite(a).all() for a in (step.vertices, step.offsets))
        if done or iteration >= max_iterations or not finite:
            # the full force of each constraint per length, not per bubble size
            real = force / unit * foam.tension * system.film_unit
            parts = zip(holds, volumes, np.split(real, first[1:-1]), strict=True)
            reactions = [_reaction(now, *part) for part in parts]
            return HeldCluster(
                now,
                frozen(reactions[0][0]),
                reactions[0][1],
                loaded.residuals.force,
                displaced,
                bool(done and finite),
                bool(finite and is_minimum),
                iteration,
                frozen(np.array([pull for pull, _ in reactions])),
            )
        assert step is not None
        size = max(float(np.abs(step.vertices).max()), float(np.abs(step.offsets).max(initial=0.0)))
        share = min(1.0, MOST_STEP / max(size, 1e-300))
        state = State(
            network,
            moved_points(surface, network, state.points, share * length * step.vertices),
            state.offsets + share * step.offsets,
            state.pressures + share * step.pressures,
        )
        force = force + share * change
        iteration += 1


def _step(
    foam: Foam, lin: Linearised, gradient: Floats, values: Floats, pins: np.ndarray
) -> tuple[Step, Floats, bool]:
    """Newton step, change of the constraints' forces, and whether the state is a minimum under them."""
    network, shares = foam.network, lin.system.shares
    vertex = np.zeros(2 * network.n_vertices)
    pressure = np.zeros(network.n_bubbles)
    fault = lin.volume_fault
    rough = lin.residuals.force > EXACT_BELOW or float(np.abs(fault / shares).max()) > EXACT_BELOW
    if rough:
        # as in `relax` far from rest: shifted, soft volumes, positive blocks
        residual = one_ring(network, lin.residuals.vertex)
        shift = np.maximum(1e-5, residual / 0.15 * np.minimum(1.0, residual / 0.5))
        vertex += np.repeat(shift, 2)
        pressure = SOFTNESS * shares**1.5
        most = VOLUME_STEP * np.maximum(shares, lin.volumes)
        fault = np.clip(fault, -most, most)
    else:
        pressure[foam.exterior or 0] = 1.0
    vertex[pins] += 1.0
    condensed = lin.condensed(positive=rough)
    kkt = KKT(lin, condensed, vertex, pressure)
    count, held = len(gradient), len(pins)
    free = kkt.step(fault)
    ways = [kkt.response(lin.loaded(part).condensed(positive=rough)) for part in gradient]
    still = lin.loaded(np.zeros_like(lin.force)).condensed(positive=rough)
    ways += [
        kkt.response(still, np.bincount([pin], minlength=vertex.size).astype(np.float64)) for pin in pins
    ]

    def seen(step: Step) -> Floats:
        return np.concatenate([_inner(gradient, step, foam), step.vertices.ravel()[pins]])

    response = np.stack([seen(way) for way in ways], axis=1)
    response[count:, count:] -= np.eye(held)
    target = -seen(free)
    target[:count] -= values
    change = np.asarray(np.linalg.lstsq(response, target, rcond=RANK)[0], dtype=np.float64)
    step = Step(
        free.vertices + sum(c * w.vertices for c, w in zip(change, ways, strict=True)),
        free.offsets + sum(c * w.offsets for c, w in zip(change, ways, strict=True)),
        free.pressures + sum(c * w.pressures for c, w in zip(change, ways, strict=True)),
    )
    # Haynsworth: inertia of the bordered matrix from the factor's and the reduced matrix's
    reduced = response.copy()
    reduced[count:] *= -1.0
    negative = int((np.linalg.eigvalsh(0.5 * (reduced + reduced.T)) < NEUTRAL).sum())
    total = kkt.n_negative + int(condensed.negative.sum()) + negative
    return step, change[:count], kkt.n_negative >= 0 and total == network.n_bubbles + count


def _reaction(foam: Foam, hold: Hold, volume: float, force: Floats) -> tuple[Floats, float]:
    """−∇E (3,) and −dE/dα: minus the constraints' forces times their derivatives by the hold itself."""
    surface, h = foam.cell.surface, 1e-3 * foam.bubble_size

    def work(moved: Hold) -> float:
        return float(force @ constraints(foam, moved, volume))

    def slope(f: list[float], by: float) -> float:
        return (8.0 * (f[2] - f[1]) - (f[3] - f[0])) / (12.0 * by)

    pull = np.zeros(3)
    for e in hold.frame:
        ends = [carried(surface_cell=foam.cell, hold=hold, step=t * h * e) for t in (-2.0, -1.0, 1.0, 2.0)]
        pull -= slope([work(end) for end in ends], h) * e
    if hold.arms is None:
        return pull, float("nan")
    turns = [replace(hold, arms=hold.arms @ turn_by(1e-3 * t)) for t in (-2.0, -1.0, 1.0, 2.0)]
    normal = surface.normals(hold.point[None])[0]
    return pull - (pull @ normal) * normal, -slope([work(turn) for turn in turns], 1e-3)


def carried(surface_cell: HeleShawCell, hold: Hold, step: Floats) -> Hold:
    """The hold moved by a small tangent step (3,), its frame carried along parallel to itself."""
    surface = surface_cell.surface
    point = surface.project((hold.point + step)[None])[0]
    old, new = surface.normals(np.stack([hold.point, point]))
    axis, cosine = np.cross(old, new), float(old @ new)
    turned = cosine * hold.frame + np.cross(axis, hold.frame)
    turned += np.outer(hold.frame @ axis, axis) / (1.0 + cosine)
    return replace(hold, point=point, frame=turned)


def turn_by(angle: float) -> Floats:
    """Turns plane vectors (n, 2) counter-clockwise from the right."""
    return np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
