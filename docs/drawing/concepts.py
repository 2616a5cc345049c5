"""Pictures of the ideas: each is drawn from a foam that has been relaxed for it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.colors import LinearSegmentedColormap, Normalize
from matplotlib.figure import Figure
from matplotlib.patches import Circle

import warpedfoam as wf
from warpedfoam.io.colours import FILM_COLOUR, RAMP, charge_rgb, ramp_rgb
from warpedfoam.io.patches import bubble_patches
from warpedfoam.plot.projection import View, back_to_front, facing, shades

NOTE = {"arrowprops": {"arrowstyle": "-", "lw": 0.9, "color": "0.25"}, "fontsize": 11, "color": "0.1"}
GLASS, FILM_BLUE = np.array([0.55, 0.75, 0.90]), np.array([0.45, 0.66, 0.82])


def relaxed(foam: wf.Foam, **options: object) -> wf.Foam:
    """A foam at a minimum; anything else is no picture."""
    result = wf.relax(foam, **options)
    if not result.converged:
        raise SystemExit(f"not converged: {result.message}")
    return result.foam


def flat_foam(n_bubbles: int, *, seed: int, volumes: float | None = None) -> wf.Foam:
    """A foam between flat plates that repeats along x and y; bubbles are about 1 wide."""
    side = float(np.sqrt(n_bubbles))
    cell = wf.HeleShawCell(wf.FlatTorus(side, side), gap=0.2)
    extra = {} if volumes is None else {"volumes": volumes}
    return relaxed(wf.voronoi_foam(cell, n_bubbles, seeds="blue", seed=seed, **extra))


def flat_outlines(foam: wf.Foam, points: int = 12) -> list[np.ndarray]:
    """Outline of each bubble in the plane, in one piece."""
    loops, curves = foam.network.loops, foam.film_curves(points)[..., :2]
    parts = curves[loops.halves >> 1]
    parts[(loops.halves & 1) == 1] = parts[(loops.halves & 1) == 1, ::-1]
    if foam.loop_shifts is not None:
        parts = parts + foam.loop_shifts[:, None, :2]
    ends = np.append(loops.starts[1:], len(loops.halves))
    return [parts[a:b, :-1].reshape(-1, 2) for a, b in zip(loops.starts, ends, strict=True)]


def draw_flat(
    axes: Axes,
    foam: wf.Foam,
    rgb: np.ndarray,
    *,
    window: tuple[float, float, float, float] | None = None,
    labels: Callable[[int], str] | None = None,
    fontsize: float = 10.0,
) -> None:
    """Bubbles of a flat foam with their images next to the window (x0, x1, y0, y1)."""
    outlines, period = flat_outlines(foam), foam.cell.surface.period[:2]
    x0, x1, y0, y1 = window or (-period[0] / 2, period[0] / 2, -period[1] / 2, period[1] / 2)
    shapes, colours, texts = [], [], []
    for i in (-1, 0, 1):
        for j in (-1, 0, 1):
            for bubble, outline in enumerate(outlines):
                moved = outline + period * (i, j)
                low, high = moved.min(axis=0), moved.max(axis=0)
                if high[0] > x0 and low[0] < x1 and high[1] > y0 and low[1] < y1:
                    shapes.append(moved)
                    colours.append(rgb[bubble] / 255.0)
                    texts.append((moved.mean(axis=0), bubble))
    axes.add_collection(
        PolyCollection(shapes, facecolors=colours, edgecolors=FILM_COLOUR, linewidths=1.6, joinstyle="round")
    )
    if labels is not None:
        for (x, y), bubble in texts:
            if x0 + 0.15 < x < x1 - 0.15 and y0 + 0.15 < y < y1 - 0.15:
                dark = rgb[bubble].mean() < 130
                axes.text(x, y, labels(bubble), ha="center", va="center", fontsize=fontsize,
                          color="white" if dark else "0.1")  # fmt: skip
    axes.set(xlim=(x0, x1), ylim=(y0, y1), aspect="equal", xticks=[], yticks=[])
    for side in axes.spines.values():
        side.set_color("0.7")


def cell() -> Figure:
    """A spherical cell, the outer plate cut away over one half."""
    gap = 0.28
    ball = wf.HeleShawCell(wf.Sphere(1.0), gap)
    foam = relaxed(wf.voronoi_foam(ball, n_bubbles=50, seeds="blue", seed=5))
    eye = View.from_angles(28.0, -60.0)
    figure = Figure(figsize=(7.4, 5.0), layout="constrained")
    axes = figure.add_subplot()

    patches = bubble_patches(foam, curve_points=13, rings=6)
    corners = eye.project(patches.points)[patches.triangles]
    front = facing(corners) > 0.0
    normals = eye.project(patches.points)[patches.triangles].mean(axis=1)
    fill = charge_rgb(foam.network.charges.astype(float))[patches.triangle_bubble] / 255.0
    fill = (fill * shades(normals)[:, None])[front]
    axes.add_collection(PolyCollection(corners[front][..., :2], facecolors=fill, edgecolors=fill, lw=0.4))

    # films stand on the plate, ruled along the normals; those that lean away behind the limb are left out
    curves = foam.film_curves(17)
    sheet = np.stack([curves, (1.0 + gap) * curves])
    quads = np.stack([sheet[0, :, :-1], sheet[0, :, 1:], sheet[1, :, 1:], sheet[1, :, :-1]], axis=2)
    quads = eye.project(quads.reshape(-1, 4, 3))
    quads = quads[quads[:, :2, 2].mean(axis=1) > -0.25]
    quads = quads[back_to_front(quads[..., 2].mean(axis=1))]
    lit = 0.72 + 0.28 * np.clip(quads[:, 0, 2], 0.0, 1.0)
    ink = np.hstack([FILM_BLUE * lit[:, None], np.full((len(quads), 1), 0.62)])
    foot = [q[:2, :2] for q in quads if q[:2, 2].mean() > 0.0]
    axes.add_collection(LineCollection(foot, colors=FILM_COLOUR, linewidths=1.0, capstyle="round"))
    axes.add_collection(PolyCollection(quads[..., :2], facecolors=ink, edgecolors="none"))
    head = [q[2:, :2] for q in quads]
    axes.add_collection(LineCollection(head, colors="#1d4e79", linewidths=1.3, capstyle="round"))

    # the lid over one half: a lune, its rim on the cut, and the cut itself through the gap
    half = np.linspace(-0.5 * np.pi, 0.5 * np.pi, 181)
    outer = 1.0 + gap
    limb = np.stack([outer * -np.cos(half), outer * np.sin(half)], axis=1)
    tilt = 0.12
    cut = np.stack([outer * tilt * np.cos(half), outer * np.sin(half)], axis=1)
    lid = np.concatenate([limb, cut[::-1]])
    axes.fill(*lid.T, color=GLASS, alpha=0.5, lw=0)
    axes.plot(*limb.T, color="#1d4e79", lw=1.6)
    axes.plot(*cut.T, color="#1d4e79", lw=2.4)
    axes.add_patch(Circle((0.0, 0.0), 1.0, fill=False, color="0.35", lw=1.0))

    axes.annotate("outer plate,\ncut open", (-1.05, 0.62), (-2.05, 0.95), **NOTE)
    axes.annotate("inner plate", (0.62, -0.42), (1.45, -0.95), **NOTE)
    top = quads[np.argmax(quads[:, 2, 0] - 0.35 * np.abs(quads[:, 2, 1] - 0.5))]
    axes.annotate("film", top[:, :2].mean(axis=0), (1.5, 0.75), **NOTE)
    axes.annotate("", (1.0, 0.0), (outer, 0.0), arrowprops={"arrowstyle": "<->", "lw": 1.4, "color": "0.1"})
    axes.annotate("gap d", (0.5 * (1.0 + outer), 0.0), (1.5, 0.05), **NOTE)
    axes.set(xlim=(-2.1, 2.1), ylim=(-1.34, 1.34), aspect="equal")
    axes.set_axis_off()
    return figure


def words() -> Figure:
    """Bubble, film and vertex, in a piece of a flat foam."""
    foam = flat_foam(36, seed=4, volumes=0.35)
    figure = Figure(figsize=(6.4, 4.6), layout="constrained")
    axes = figure.add_subplot()
    pale = np.tile([236.0, 236.0, 232.0], (foam.n_bubbles, 1))
    chosen = int(np.argmin(np.linalg.norm(foam.bubble_centres[:, :2] - (-1.0, 0.2), axis=1)))
    pale[chosen] = 205.0, 226.0, 240.0
    draw_flat(axes, foam, pale, window=(-2.7, 2.7, -1.9, 1.9))
    # a film and a vertex away from the chosen bubble
    tails, heads = foam.film_ends
    inside = (np.abs(tails[:, :2]) < (1.9, 1.3)).all(axis=1) & (np.abs(heads[:, :2]) < (1.9, 1.3)).all(axis=1)
    right = inside & (tails[:, 0] > 0.4) & (heads[:, 0] > 0.4)
    film = int(np.flatnonzero(right)[np.argmax(foam.film_lengths[right])])
    curve = foam.film_curves(30)[film, :, :2]
    axes.plot(*curve.T, color="#cc3d28", lw=3.4, solid_capstyle="round")
    at = foam.vertex_points[:, :2]
    near = int(np.argmin(np.linalg.norm(at - (0.3, -0.9), axis=1)))
    vertex = at[near]
    axes.plot(*vertex, "o", ms=9, color="#2f78bd")
    centre = flat_outlines(foam)[chosen].mean(axis=0)
    axes.annotate("bubble", centre, centre, ha="center", va="center", fontsize=12)
    middle = curve[15]
    axes.annotate("film", middle, middle + np.array([0.7, 0.42]),
                  bbox={"fc": "white", "ec": "0.8", "pad": 3.0}, **NOTE | {"fontsize": 12})  # fmt: skip
    axes.annotate("vertex:\nthree films at 120°", vertex, vertex + np.array([-1.85, -0.68]),
                  bbox={"fc": "white", "ec": "0.8", "pad": 3.0}, **NOTE | {"fontsize": 12})  # fmt: skip
    return figure


def charge() -> Figure:
    """Sides and charges in the plane, and the twelve fives of a sphere."""
    foam = flat_foam(49, seed=1, volumes=0.3)
    figure = Figure(figsize=(8.4, 4.3), layout="constrained")
    left, right = figure.subplots(1, 2)
    q = foam.network.charges
    sign = {k: ("0" if k == 0 else f"{'+' if k > 0 else '−'}{abs(k)}") for k in range(-6, 7)}
    draw_flat(left, foam, charge_rgb(q.astype(float)), labels=lambda b: sign[int(q[b])])
    left.set_title(f"flat and periodic: charges q = 6 − n, sum {int(q.sum())}", fontsize=11)

    ball = relaxed(wf.voronoi_foam(wf.HeleShawCell(wf.Sphere(1.0), 0.05), 132, seeds="lattice"))
    eye = View.from_angles(25.0, -60.0)
    patches = bubble_patches(ball, curve_points=11, rings=5)
    corners = eye.project(patches.points)[patches.triangles]
    front = facing(corners) > 0.0
    normals = eye.project(patches.points)[patches.triangles].mean(axis=1)
    fill = charge_rgb(ball.network.charges.astype(float))[patches.triangle_bubble] / 255.0
    fill = (fill * shades(normals)[:, None])[front]
    right.add_collection(PolyCollection(corners[front][..., :2], facecolors=fill, edgecolors=fill, lw=0.4))
    curves = eye.project(ball.film_curves(11))
    seen = curves[..., 2].mean(axis=1) > 0.0
    right.add_collection(LineCollection(curves[seen][..., :2], colors=FILM_COLOUR, linewidths=1.2))
    right.set(xlim=(-1.05, 1.05), ylim=(-1.05, 1.05), aspect="equal")
    right.set_axis_off()
    charges = ball.network.charges
    fives, sevens = int((charges == 1).sum()), int((charges == -1).sum())
    right.set_title(f"a sphere: {fives} fives, {sevens} sevens, sum {int(charges.sum())}", fontsize=11)
    return figure


def t1() -> Figure:
    """A T1: the short film, the turned one, and the new minimum."""
    foam = flat_foam(36, seed=4)
    network, reach = foam.network, np.abs(foam.vertex_points[:, :2]).max(axis=1)
    best: tuple[float, int, wf.Foam] | None = None
    tails, heads = foam.network.tails, foam.network.heads
    length = foam.film_lengths
    for film in np.argsort(length)[:12]:
        if max(reach[tails[film]], reach[heads[film]]) > 2.0 or network.sides.min() < 4:
            continue
        turned = wf.t1(foam, int(film))
        after = wf.relax(turned)
        # a T1 that stays: it is not undone, and nothing else happens
        if after.converged and after.n_t1 == 0:
            best = (float(length[film]), int(film), turned)
            settled = after.foam
            break
    if best is None:
        raise SystemExit("no T1 of this foam stays")
    _, film, turned = best
    middle = foam.film_curves(3)[film, 1, :2]
    window = (middle[0] - 1.75, middle[0] + 1.75, middle[1] - 1.75, middle[1] + 1.75)
    figure = Figure(figsize=(9.0, 3.5), layout="constrained")
    names = (
        f"before: E = {foam.energy:.4f}",
        "a T1: the film has turned",
        f"relaxed: E = {settled.energy:.4f}",
    )
    for axes, one, name in zip(figure.subplots(1, 3), (foam, turned, settled), names, strict=True):
        q = one.network.charges
        sign = [("0" if k == 0 else f"{'+' if k > 0 else '−'}{abs(k)}") for k in q]
        draw_flat(axes, one, charge_rgb(q.astype(float)), window=window, labels=sign.__getitem__, fontsize=12)
        axes.plot(*one.film_curves(20)[film, :, :2].T, color="#d9a400", lw=4.0, solid_capstyle="round")
        axes.set_title(name, fontsize=10.5)
    return figure


def gap() -> Figure:
    """A section through one bubble between spherical plates: the ruled film and the real one."""
    radius, d = 1.0, 0.72
    plates = wf.HeleShawCell(wf.Sphere(radius), gap=d)
    volume, layers = 0.30, 10
    pole = [0.0, 0.0, radius]
    real = wf.bubble_between_plates(plates, volume, pole, layers=layers)
    ruled = wf.bubble_between_plates(plates, volume, pole, layers=1)
    if not (real.converged and ruled.converged):
        raise SystemExit(f"{real.message}; {ruled.message}")
    figure = Figure(figsize=(7.2, 3.6), layout="constrained")
    axes = figure.add_subplot()
    angle = np.linspace(-0.86, 0.86, 200)
    for r, name, side in ((radius, "inner plate", 1.0), (radius + d, "outer plate", 1.0)):
        axes.plot(r * np.sin(angle), r * np.cos(angle), color="0.45", lw=3.0)
        axes.annotate(name, (r * np.sin(0.8) * side, r * np.cos(0.8)), (8, 4), textcoords="offset points",
                      fontsize=11, color="0.3")  # fmt: skip

    def section(bubble: wf.BubbleBetweenPlates) -> np.ndarray:
        # the bubble is round about the pole: mean distance from the axis, and height, level by level
        out = np.hypot(bubble.points[..., 0], bubble.points[..., 1]).mean(axis=1)
        return np.stack([out, bubble.points[..., 2].mean(axis=1)], axis=1)

    free, cone = section(real), section(ruled)
    # between the levels the film is a polynomial in the height
    t = np.linalg.norm(free, axis=1) - radius
    fine = np.linspace(0.0, d, 80)
    fit = np.polynomial.Polynomial.fit(t, np.arctan2(free[:, 0], free[:, 1]), len(t) - 1)
    lean = fit(fine)
    curve = np.stack([(radius + fine) * np.sin(lean), (radius + fine) * np.cos(lean)], axis=1)
    for side in (-1.0, 1.0):
        axes.plot(side * cone[:, 0], cone[:, 1], "--", color="#2f78bd", lw=1.8,
                  label="ruled along the normals" if side > 0 else None)  # fmt: skip
        axes.plot(side * curve[:, 0], curve[:, 1], color="#cc3d28", lw=2.4,
                  label="free: 90° on both plates, bulging" if side > 0 else None)  # fmt: skip
    arcs = []
    for r, edge in ((radius + d, lean[-1]), (radius, -lean[0])):
        along = np.linspace(edge, -edge, 60)
        arcs.append(np.stack([r * np.sin(along), r * np.cos(along)], axis=1))
    ring = np.concatenate([curve, arcs[0], curve[::-1] * (-1.0, 1.0), arcs[1]])
    axes.fill(*ring.T, color="#fbe9e4", zorder=0)
    axes.annotate(
        "", (0.0, radius + 0.01), (0.0, radius + d - 0.01), arrowprops={"arrowstyle": "<->", "lw": 1.2}
    )
    axes.text(0.03, radius + 0.45 * d, "d", fontsize=14, style="italic")
    axes.text(-0.16, radius + 0.45 * d, "V", fontsize=14, style="italic")
    axes.set(aspect="equal", xlim=(-1.35, 1.7), ylim=(0.42, 1.8))
    axes.legend(frameon=False, fontsize=10, loc="lower center")
    axes.set_axis_off()
    return figure


def pressure() -> Figure:
    """Pressures of a polydisperse flat foam: films bulge away from the higher one."""
    foam = flat_foam(49, seed=3, volumes=0.6)
    values = foam.pressures
    limits = float(values.min()), float(values.max())
    figure = Figure(figsize=(6.6, 5.0), layout="constrained")
    axes = figure.add_subplot()
    rgb = ramp_rgb(values, limits)
    draw_flat(axes, foam, rgb, labels=lambda b: str(int(foam.network.sides[b])), fontsize=9)
    ramp = LinearSegmentedColormap.from_list("ramp", RAMP)
    bar = figure.colorbar(ScalarMappable(Normalize(*limits), ramp), ax=axes, shrink=0.8)
    bar.set_label("pressure, in units of γ per length; mean 0", fontsize=11)
    axes.set_title("numbers of sides; small bubbles have few and press hard", fontsize=11)
    return figure


PICTURES = {
    "cell": cell,
    "words": words,
    "charge": charge,
    "t1": t1,
    "gap": gap,
    "pressure": pressure,
}


def draw(folder: Path, names: list[str] | None = None) -> None:
    """Write the pictures."""
    for name in names or PICTURES:
        wf.save_figure(folder / f"concept_{name}.png", PICTURES[name](), dpi=130)
