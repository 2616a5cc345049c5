"""Foams whose films are free to bulge through the gap: Newton's method on the whole KKT system."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy as np
from scipy.linalg import qr
from scipy.sparse import coo_array, csc_array
from scipy.sparse.linalg import splu

from warpedfoam.arrays import Floats, Ints, frozen
from warpedfoam.foam import Foam
from warpedfoam.kernels import height_arcs as arcs
from warpedfoam.kernels.jets import frames_of
from warpedfoam.kernels.layered_films import Heights, bulging_terms, contact_slips
from warpedfoam.kernels.periodic import nearest_image
from warpedfoam.kernels.quadrature import lobatto
from warpedfoam.relax.result import Relaxation
from warpedfoam.surfaces.level_forms import as_level
from warpedfoam.surfaces.protocol import Layer

#: Newton steps; the longest step of a vertex in bubble sizes; steps that may fail to halve the residual.
MOST_STEPS, LONGEST, PATIENCE = 40, 0.1, 4
#: Softness of the volumes in the matrix whose inertia is read, in units of |J|²/|H|.
SOFT = 1e-4
#: Residual that counts as round-off of places through a thin gap, in ε size ℓ / d².
ROUNDING = 4.0
#: Contact angle's error, in radians, that a message tells of.
UNRESOLVED = 0.02
#: Gauss points on the rays of the fans that give volumes: bubbles of a few dozen on a surface are large.
RAYS = 12


@dataclass(frozen=True, eq=False)
class LayeredRelaxation(Relaxation):
    """A foam whose films slide on the plates and bulge between them.

    ``energy``, ``pressures``, ``residual``, ``volume_error`` and ``converged`` are those of the bulging
    films; ``foam`` is the ruled foam next to it, from which it started, with the new pressures.

    Attributes
    ----------
    layers : int
        Degree of the films across the gap.
    heights : (layers + 1,) array
        Gauss–Lobatto heights of the curves of nodes.
    vertex_lines : (layers + 1, n_vertices, 3) array
        The lines in which three films meet, from plate to plate.
    film_points : (layers + 1, n_films, order + 1, 3) array
        Nodes of the films.
    ruled_energy : float
        Energy of the relaxed ruled foam.
    contact_error : float
        Largest deviation of a film from 90° at a plate, in radians.
    """

    layers: int
    heights: Floats
    vertex_lines: Floats
    film_points: Floats
    ruled_energy: float
    contact_error: float


@dataclass(frozen=True, eq=False)
class _State:
    """Vertices (K, V, 3) and offsets (K, F, p − 1) of all curves on the inner plate; pressures (N,)."""

    points: Floats
    offsets: Floats
    pressures: Floats


@dataclass(frozen=True, eq=False)
class _Terms:
    """Energy, its derivatives film by film, and the volumes.

    ``gradient``, ``swept`` (F, M): derivatives of a film's energy and of the volume left of it by the film's
    own M unknowns; ``hessian`` (F, M, M) of the energy less pressures times volumes.
    """

    energy: float
    gradient: Floats
    swept: Floats
    hessian: Floats
    volumes: Floats
    lifted: Floats
    contact_error: float


class LayeredSystem:
    """The unknowns of a foam with bulging films and how they enter the KKT system."""

    def __init__(self, foam: Foam, layers: int) -> None:
        self.foam, self.layers = foam, layers
        self.surface = as_level(foam.cell.surface)
        self.rule = lobatto(foam.order)
        self.across = Heights.across(foam.cell.mean_gap, layers)
        network, n_curves, inner = foam.network, layers + 1, foam.order - 1
        self.n_vertex = 2 * n_curves * network.n_vertices
        self.n_shape = self.n_vertex + n_curves * inner * network.n_films
        curve = np.arange(n_curves)[None, :, None]
        pair = np.arange(2)
        ends = [2 * (n_curves * end[:, None, None] + curve) + pair for end in (network.tails, network.heads)]
        film = np.arange(network.n_films)[:, None, None]
        own = self.n_vertex + inner * (n_curves * film + curve) + np.arange(inner)
        #: global numbers of each film's unknowns, (F, M)
        self.numbers: Ints = np.concatenate([*ends, own], axis=2).reshape(network.n_films, -1)

    def start(self) -> _State:
        """Ruled films: all curves like those of the foam."""
        foam = self.foam
        tail, head = foam.film_ends
        nodes = foam.film_curves_at(self.rule.nodes)[:, 1:-1]
        axis = self._normals(tail) + self._normals(head)
        axis /= np.linalg.norm(axis, axis=1, keepdims=True)
        left = np.cross(axis, head - tail)
        offsets = np.einsum("fjx,fx->fj", nodes - tail[:, None], left) / arcs.dots(left, left)[:, None]
        curves = self.layers + 1
        pressures = np.zeros(foam.n_bubbles) if foam.pressures is None else foam.pressures
        return _State(
            np.repeat(foam.vertex_points[None], curves, axis=0),
            np.repeat(offsets[None], curves, axis=0),
            pressures,
        )

    def _normals(self, points: Floats) -> Floats:
        frames = self.surface.vertex_frames(points)
        out: Floats = np.cross(frames[:, 0], frames[:, 1])
        return out

    def terms(self, state: _State) -> _Terms:
        """Everything at a state."""
        foam, across, surface = self.foam, self.across, self.surface
        network, n_curves = foam.network, self.layers + 1
        n_films, q = network.n_films, foam.order + 3
        tail = state.points[:, network.tails].reshape(-1, 3)
        head = state.points[:, network.heads].reshape(-1, 3)
        if surface.period is not None:
            head = tail + nearest_image(head - tail, surface.period)
        offsets = state.offsets.reshape(n_curves * n_films, -1)
        ends = (self._normals(tail), self._normals(head))
        placed = arcs.place(self.rule, tail, head, ends, offsets, surface.foot)
        shape = placed.points.shape
        normals = self._normals(placed.points.reshape(-1, 3)).reshape(shape)
        shapes = surface.shape_operators(placed.points.reshape(-1, 3), project=False).reshape(*shape, 3)
        frames = (frames_of(normals[0])[:, :2], frames_of(normals[-1])[:, :2])
        moves = arcs.jacobians(placed, normals, shapes, frames)

        def by_curve(field: Floats) -> Floats:
            return field.reshape(field.shape[0], n_curves, n_films, *field.shape[2:])

        nodes = (by_curve(placed.points), by_curve(normals))
        value, gradient, hessian = bulging_terms(
            self.rule, across, *nodes, by_curve(shapes), by_curve(moves), second=True
        )
        assert hessian is not None
        trace = np.einsum("jaxx->ja", shapes)
        gauss = 0.5 * (trace**2 - np.einsum("jaxy,jaxy->ja", shapes, shapes))
        t, w = (np.repeat(v, n_films) for v in (across.heights, across.weights))
        density = w * (1.0 + t * trace + t**2 * gauss)
        swept, bending = arcs.swept_terms(placed, normals, density, moves, second=True)
        assert bending is not None
        jump = state.pressures[network.left] - state.pressures[network.right]
        hessian *= foam.tension
        blocks = hessian.reshape(n_films, n_curves, q, n_curves, q)
        bends = bending.reshape(q, q, n_curves, n_films)
        for k in range(n_curves):
            blocks[:, k, :, k] -= jump[:, None, None] * bends[:, :, k].transpose(2, 0, 1)
        volumes = np.zeros(foam.n_bubbles)
        for k in range(n_curves):
            height, weight = float(across.heights[k]), float(across.weights[k])
            steiner = (weight, 2.0 * height * weight, height**2 * weight)
            layer = Layer(frozen(np.zeros(1)), frozen(np.ones(1)), steiner, RAYS)
            part = slice(k * n_films, (k + 1) * n_films)
            volumes += surface.loop_integrals(tail[part], head[part], offsets[part], network.loops, layer)
        slips = contact_slips(self.rule, across, *nodes)
        return _Terms(
            foam.tension * float(value.sum()),
            foam.tension * gradient.transpose(2, 0, 1).reshape(n_films, -1),
            swept.reshape(q, n_curves, n_films).transpose(2, 1, 0).reshape(n_films, -1),
            hessian,
            volumes,
            nodes[0] + across.heights[:, None, None] * nodes[1],
            float(np.abs(np.arcsin(np.clip(slips, -1.0, 1.0))).max()),
        )

    def pull(self, terms: _Terms, pressures: Floats) -> Floats:
        """Derivative of the energy less pressures times volumes, (n_shape,)."""
        network = self.foam.network
        jump = pressures[network.left] - pressures[network.right]
        parts = terms.gradient - jump[:, None] * terms.swept
        return np.bincount(self.numbers.ravel(), parts.ravel(), self.n_shape).astype(np.float64)

    def matrices(self, terms: _Terms) -> tuple[csc_array, csc_array]:
        """Hessian (n_shape, n_shape) and volume derivatives (n_shape, N − 1), the last bubble left out."""
        network, n = self.foam.network, self.n_shape
        row = np.broadcast_to(self.numbers[:, :, None], terms.hessian.shape)
        column = np.broadcast_to(self.numbers[:, None], terms.hessian.shape)
        hessian = coo_array((terms.hessian.ravel(), (row.ravel(), column.ravel())), shape=(n, n)).tocsc()
        owner = np.concatenate([network.left, network.right])
        slopes = np.concatenate([terms.swept, -terms.swept])
        unknown = np.concatenate([self.numbers, self.numbers])
        column = np.broadcast_to(owner[:, None], unknown.shape)
        volume = coo_array(
            (slopes.ravel(), (unknown.ravel(), column.ravel())), shape=(n, self.foam.n_bubbles)
        ).tocsc()
        return csc_array(hessian), csc_array(volume[:, :-1])

    def rigid(self, state: _State) -> Floats:
        """Unit vectors of the rigid motions among the unknowns, (n_shape, k)."""
        n_curves, n_vertices = state.points.shape[:2]
        flat = state.points.reshape(-1, 3)
        motions = self.surface.rigid_motions(flat)
        out = np.zeros((self.n_shape, len(motions)))
        frames = frames_of(self._normals(flat))[:, :2]
        for i, motion in enumerate(motions):
            steps = np.einsum("nix,nx->ni", frames, motion).reshape(n_curves, n_vertices, 2)
            out[: self.n_vertex, i] = steps.transpose(1, 0, 2).ravel()
        return np.linalg.qr(out)[0] if len(motions) else out

    def moved(self, state: _State, step: Floats, pressures: Floats) -> _State:
        """The state after a step."""
        n_curves, n_vertices = state.points.shape[:2]
        steps = step[: self.n_vertex].reshape(n_vertices, n_curves, 2).transpose(1, 0, 2).reshape(-1, 2)
        points = self.surface.retract(state.points.reshape(-1, 3), steps).reshape(state.points.shape)
        change = step[self.n_vertex :].reshape(state.offsets.shape[1], n_curves, -1).transpose(1, 0, 2)
        return _State(points, state.offsets + change, state.pressures + pressures)


def require_lines(foam: Foam) -> None:
    """Refuse foams with marker vertices, whose lines could slide along their films, rims or varying gaps.

    Raises
    ------
    ValueError
        If there are any.
    """
    foam.cell.parallel_gap("relaxing with layers above 1")
    if foam.cell.surface.rim is not None:
        raise ValueError(
            "layers above 1 need a surface without rims: films that bulge against a wall are not available; "
            "relax the foam with layers=1"
        )
    if len(foam.network.markers):
        raise ValueError(
            "layers above 1 need a foam without marker vertices (where only two films meet), this one has "
            f"{len(foam.network.markers)}; relax it with layers=1 or give it more bubbles"
        )


def relax_layers(ruled: Relaxation, layers: int, tolerance: float) -> LayeredRelaxation:
    """Let the films of a relaxed ruled foam bulge: least energy at the same volumes, at the same topology.

    Each vertex becomes a line across the gap; every curve of nodes slides on its parallel surface.

    Parameters
    ----------
    ruled : Relaxation
        Converged, without marker vertices.
    layers : int
        2 or more.
    tolerance : float
        Of the residual, in γ d; round-off in very thin gaps, where that is more.

    Raises
    ------
    TypeError
        If its surface is not known as a level set.
    """
    foam = ruled.foam
    system = LayeredSystem(foam, layers)
    state = system.start()
    unit, gap = foam.tension * foam.cell.mean_gap, foam.cell.mean_gap
    noise = ROUNDING * float(np.finfo(float).eps) * foam.cell.surface.size * foam.bubble_size / gap**2
    tolerance = max(tolerance, noise)
    least, stale, iterations, fatal = np.inf, 0, 0, ""
    terms = system.terms(state)
    while True:
        rigid = system.rigid(state)
        pull = system.pull(terms, state.pressures)
        pull -= rigid @ (rigid.T @ pull)
        # shares of the total that the same quadrature gives: the last bubble takes up no error
        wanted = foam.target_volumes * (terms.volumes.sum() / foam.cell.volume)
        missing = wanted - terms.volumes
        residual = float(np.abs(pull).max()) / unit
        fault = float(np.abs(missing / wanted).max())
        done = residual <= tolerance and fault <= max(0.01 * tolerance, 1e-12)
        stale = 0 if residual + fault < 0.5 * least else stale + 1
        least = min(least, residual + fault)
        if done or stale > PATIENCE or iterations >= MOST_STEPS:
            break
        try:
            step, change = _newton(system, terms, rigid, pull, missing)
        except RuntimeError:
            fatal = "stopped: the Newton matrix is singular"
            break
        longest = float(np.abs(step[: system.n_vertex]).max())
        # offsets are in units of chords, about as long as a bubble
        longest = max(longest, foam.bubble_size * float(np.abs(step[system.n_vertex :]).max(initial=0.0)))
        share = min(1.0, LONGEST * foam.bubble_size / max(longest, 1e-300))
        trial = system.moved(state, share * step, share * change)
        ahead = _terms_at(system, trial)
        if ahead is None:
            fatal = "stopped: a step left the surface"
            break
        state, terms = trial, ahead
        iterations += 1
    minimum = done and _is_minimum(system, terms, rigid)
    if minimum:
        message = f"converged in {iterations} steps from the ruled foam"
        if terms.contact_error > UNRESOLVED:
            message += (
                f"; films are not resolved: they meet the plates up to {terms.contact_error:.2g} rad off a "
                "right angle; take a higher order"
            )
    elif done:
        message = "at rest, but the Hessian's inertia is not seen to be that of a minimum"
    else:
        message = fatal or f"stopped: residual {residual:.2g}, volume error {fault:.2g} in {iterations} steps"
    pressures = frozen(state.pressures - state.pressures.mean())
    known = {f.name: getattr(ruled, f.name) for f in fields(Relaxation)}
    known |= {
        "foam": replace(foam, pressures=pressures),
        "energy": terms.energy,
        "pressures": pressures,
        "residual": residual,
        "volume_error": fault,
        "converged": ruled.converged and minimum,
        "is_minimum": minimum,
        "iterations": ruled.iterations + iterations,
        "message": message,
    }
    lines = state.points + system.across.heights[:, None, None] * system._normals(
        state.points.reshape(-1, 3)
    ).reshape(state.points.shape)
    return LayeredRelaxation(
        **known,
        layers=layers,
        heights=frozen(system.across.heights),
        vertex_lines=frozen(lines),
        film_points=frozen(terms.lifted.transpose(1, 2, 0, 3)),
        ruled_energy=ruled.energy,
        contact_error=terms.contact_error,
    )


def _terms_at(system: LayeredSystem, state: _State) -> _Terms | None:
    """Everything at a state, or None where nodes find no place on the surface."""
    if not np.isfinite(state.points).all():
        return None
    try:
        terms = system.terms(state)
    except ValueError:  # a node is not finite
        return None
    return terms if np.isfinite(terms.energy + terms.volumes.sum()) else None


def _newton(
    system: LayeredSystem, terms: _Terms, rigid: Floats, pull: Floats, missing: Floats
) -> tuple[Floats, Floats]:
    """Steps of the shape (n_shape,) and of the pressures (N,), the last one unchanged."""
    hessian, volume = system.matrices(terms)
    n, count, k = system.n_shape, volume.shape[1], rigid.shape[1]
    border = csc_array(rigid)
    matrix = _bordered(hessian, [-volume, border], np.zeros(count + k))
    factor = splu(matrix, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.01, options={"SymmetricMode": True})
    right = np.concatenate([-pull, -missing[:-1], np.zeros(k)])
    found = factor.solve(right)
    found += factor.solve(right - matrix @ found)
    return found[:n], np.append(found[n : n + count], 0.0)


def _is_minimum(system: LayeredSystem, terms: _Terms, rigid: Floats) -> bool:
    """Whether H + J Jᵀ/ε with pinned rigid motions is positive: then H is, on motions that keep volumes.

    Read off the inertia of [H, −J; −Jᵀ, −ε], whose pivots are taken from the diagonal.
    """
    hessian, volume = system.matrices(terms)
    diagonal = hessian.diagonal()
    stiff = float(np.abs(diagonal).max())
    extra = np.zeros(system.n_shape)
    if rigid.shape[1]:
        extra[qr(rigid.T, mode="r", pivoting=True)[1][: rigid.shape[1]]] = stiff
    place = np.arange(system.n_shape)
    hessian = csc_array(hessian + coo_array((extra, (place, place)), shape=hessian.shape).tocsc())
    square = float((volume.multiply(volume)).sum(axis=0).max())
    matrix = _bordered(hessian, [-volume], np.full(volume.shape[1], -SOFT * square / stiff))
    factor = splu(
        matrix,
        permc_spec="MMD_AT_PLUS_A",
        diag_pivot_thresh=0.0,
        options={"SymmetricMode": True, "Equil": False},
    )
    if not np.array_equal(factor.perm_r, factor.perm_c):
        return False
    return int((factor.U.diagonal() < 0.0).sum()) == volume.shape[1]


def _bordered(block: csc_array, borders: list[csc_array], corner: Floats) -> csc_array:
    """[block, borders; bordersᵀ, diag(corner)]."""
    n = block.shape[0]
    core = block.tocoo()
    rows: list[Ints] = [core.row.astype(np.int64)]
    columns: list[Ints] = [core.col.astype(np.int64)]
    values: list[Floats] = [core.data]
    start = n
    for border in borders:
        part = border.tocoo()
        row, column = part.row.astype(np.int64), part.col.astype(np.int64)
        rows += [row, column + start]
        columns += [column + start, row]
        values += [part.data, part.data]
        start += border.shape[1]
    place = np.arange(n, start)
    rows, columns, values = [*rows, place], [*columns, place], [*values, corner]
    index = (np.concatenate(rows), np.concatenate(columns))
    return csc_array(coo_array((np.concatenate(values), index), shape=(start, start)).tocsc())
