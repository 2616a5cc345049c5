"""Surfaces from formulas for the Surface Evolver: level sets of any kind, with rims and symmetries."""

from __future__ import annotations

import ast

import numpy as np

from warpedfoam.arrays import Bools, Floats
from warpedfoam.foam import Foam
from warpedfoam.io.evolver_charts import (
    Chart,
    fitted_forms,
    from_rim,
    outlines,
    round_axis,
    seen_from,
    turned,
)
from warpedfoam.io.evolver_forms import Triple, films_cross, number, refuse, samples
from warpedfoam.io.evolver_formulas import Formulas, layers, levelled, ruled_films
from warpedfoam.io.evolver_symbols import derivative, minus, spelt
from warpedfoam.kernels.periodic import nearest_image
from warpedfoam.surfaces import Formula, Graph, Implicit, Revolution, SchwarzP, Surface
from warpedfoam.surfaces.level import LevelSurface

_PLACES = {"x": "x", "y": "y", "z": "z"}
_COLUMNS = {"x": "x1", "y": "x2", "z": "x3"}


def level_tree(surface: Surface) -> ast.expr | None:
    """The formula f of a surface f = 0, or None if it has none."""
    match surface:
        case SchwarzP():
            k = 2.0 * np.pi / surface.cell_length
            waves = " + ".join(f"cos({k!r}*{e})" for e in "xyz")
            return Formula(f"-({waves})/{k!r}").tree
        case Implicit(function=Formula() as f):
            return f.tree
        case Graph(function=Formula() as f):
            return minus(ast.Name("z"), f.tree)
        case Revolution(square=Formula() as f):
            return minus(Formula("x**2 + y**2").tree, f.tree)
    return None


def level_formulas(foam: Foam, tree: ast.expr, *, ruled: bool) -> Formulas:
    """Formulas for a foam on f = 0.

    Raises
    ------
    ValueError
        If a bubble is too large for its volume's form.
    """
    surface = foam.cell.surface
    assert isinstance(surface, LevelSurface)
    slopes = [derivative(tree, e) for e in "xyz"]
    x, y, z = (spelt(s, _COLUMNS) for s in slopes)
    energy = None
    if ruled:
        bend: list[Triple] = []
        for s in slopes:
            a, b, c = (spelt(derivative(s, e), _COLUMNS) for e in "xyz")
            bend.append((_blank(a), _blank(b), _blank(c)))
        energy = ruled_films(foam, levelled((x, y, z), bend))
    # in units of length, so that the Evolver's tolerance means the same for every f
    steepness = np.linalg.norm(surface.level(foam.vertex_points, second=False)[1], axis=1).mean()
    charts, bases = _charts(foam, surface)
    weights = layers(foam, ruled)
    return Formulas(
        surface=f"{number(1.0 / steepness)}*{spelt(tree, _PLACES)} = 0",
        outer=None,
        tension=0.0 if ruled else foam.tension * foam.cell.mean_gap,
        energy=energy,
        one_form=fitted_forms(foam, charts, bases, weights),
        flux=None,
        volume=foam.cell.volume if ruled else foam.cell.mean_gap * surface.area,
        pinned=held_back(foam),
        rims=_rims(foam, surface),
    )


def _blank(text: str) -> str:
    return "0" if text == "0.0" else text


def held_back(foam: Foam) -> tuple[tuple[int, Floats], ...]:
    """Vertices and the normals of planes through them that hold the motions of the plates back, one each.

    Each motion is held where it is fastest, and taken out of the others there.
    """
    motions = np.array(foam.cell.rigid_motions(foam.vertex_points))
    motions[:, foam.network.rim_vertices] = 0.0
    out: list[tuple[int, Floats]] = []
    for k in range(len(motions)):
        speed = np.linalg.norm(motions[k:], axis=2)
        for vertex, _ in out:
            speed[:, vertex] = 0.0
        which, vertex = (int(i) for i in np.unravel_index(int(speed.argmax()), speed.shape))
        motions[[k, k + which]] = motions[[k + which, k]]
        normal = motions[k, vertex] / np.linalg.norm(motions[k, vertex])
        out.append((vertex, normal))
        share = motions[k + 1 :, vertex] @ normal / (motions[k, vertex] @ normal)
        motions[k + 1 :] -= share[:, None, None] * motions[k]
    return tuple(out)


def _charts(foam: Foam, surface: LevelSurface) -> tuple[list[Chart], Floats]:
    """A chart for every bubble, and the a from which its form is integrated."""
    edge, owner = outlines(foam)
    middles, period = foam.bubble_centres, surface.period
    away = nearest_image(edge - middles[owner], period)
    scales = np.zeros(foam.n_bubbles)
    np.maximum.at(scales, owner, np.linalg.norm(away, axis=1))
    walled = np.asarray(np.bincount(foam.walls.bubble, minlength=foam.n_bubbles) > 0)
    bases = np.zeros(foam.n_bubbles)
    axes, bends = np.array(surface.normals(middles)), np.zeros(foam.n_bubbles)
    if isinstance(surface, Graph):
        axes[:] = [0.0, 0.0, 1.0]
    else:
        count = np.bincount(owner, minlength=foam.n_bubbles)
        np.add.at(axes, owner, surface.normals(edge) / count[owner, None])
        axes /= np.linalg.norm(axes, axis=1, keepdims=True)
        bends = np.bincount(owner, surface.principal_curvatures(edge).sum(axis=1), len(axes)) / (4.0 * count)
    parts = np.split(edge[np.argsort(owner, kind="stable")], np.cumsum(np.bincount(owner))[:-1])
    charts = [
        seen_from(axis, middle, scale, bend, period, part)
        for axis, middle, scale, bend, part in zip(
            axes, middles, scales.tolist(), bends.tolist(), parts, strict=True
        )
    ]
    rimmed = np.flatnonzero(walled).tolist()
    if isinstance(surface, Revolution) or (isinstance(surface, Graph) and surface.disk):
        angles = [np.arctan2(points[..., 1], points[..., 0]) for points in (samples(foam), middles)]
        refuse(foam, walled & films_cross(foam, *angles), "reaches from the rim round the axis")
        for k in rimmed:
            charts[k] = (
                from_rim(middles[k], 0.5 * surface.width, scales[k])
                if isinstance(surface, Graph)
                else round_axis(middles[k], scales[k])
            )
    elif isinstance(surface, Graph):
        at, wall = foam.wall_points(12)
        half = 0.5 * np.array([surface.width, surface.height])
        # which of the sides x = ±a, y = ±b each bubble touches
        met = np.zeros((2, 2, foam.n_bubbles), dtype=bool)
        for axis in range(2):
            for k, sign in enumerate((-1.0, 1.0)):
                on = np.abs(at[:, axis] - sign * half[axis]) < 1e-9 * surface.size
                met[axis, k, foam.walls.bubble[wall[on]]] = True
        across: Bools = np.asarray(met.all(axis=1))
        refuse(foam, np.asarray(across.all(axis=0)), "touches all four sides of the rim")
        for k in rimmed:
            axis = int(across[0, k])
            place = sum(s * half[axis] for s, m in zip((-1.0, 1.0), met[axis, :, k], strict=True) if m)
            bases[k] = (place - middles[k, axis]) / scales[k] if met[axis, :, k].any() else 0.0
            charts[k] = turned(charts[k]) if axis else charts[k]
    return charts, bases


def _rims(foam: Foam, surface: LevelSurface) -> tuple[tuple[str, tuple[int, ...]], ...]:
    """Equations of the rim, and the vertices on each part."""
    ends = foam.network.rim_vertices
    if not len(ends):
        return ()
    points = foam.vertex_points[ends]
    if isinstance(surface, Revolution):
        levels = np.array([surface.bottom, surface.top])
        part = np.abs(points[:, 2:] - levels).argmin(axis=1)
        equations = [f"z = {level!r}" for level in levels.tolist()]
    elif isinstance(surface, Graph) and surface.disk:
        part = np.zeros(len(ends), dtype=np.int64)
        equations = [f"x^2 + y^2 = {(0.5 * surface.width) ** 2!r}"]
    else:
        assert isinstance(surface, Graph)
        half = 0.5 * np.array([surface.width, surface.width, surface.height, surface.height])
        levels = half * [-1.0, 1.0, -1.0, 1.0]
        part = np.abs(points[:, [0, 0, 1, 1]] - levels).argmin(axis=1)
        equations = [f"{e} = {level!r}" for e, level in zip("xxyy", levels.tolist(), strict=True)]
    return tuple(
        (equation, tuple(ends[part == k].tolist()))
        for k, equation in enumerate(equations)
        if (part == k).any()
    )
