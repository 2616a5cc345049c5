"""Foams on meshes against the same foams on formulas: errors and their orders in the mesh size h.

    python benchmarks/mesh_accuracy.py --csv benchmarks/data/mesh_accuracy.csv --plot docs/mesh_accuracy.png
    python benchmarks/mesh_accuracy.py --redraw benchmarks/data/mesh_accuracy.csv --plot again.png

Two surfaces: Torus(20, 4) with gap 0.5 and Sphere(10) with gap 0.1, each as meshes whose nodes are pushed
about by 0.2 mean edges and put back on the surface, several times with other random numbers. A foam of 200
bubbles from blue noise is relaxed on the formula and carried to each mesh (vertices projected, volumes in
proportion); both are relaxed to the end without T1s and compared: energy, pressures (largest difference over
their range), areas of bubbles (largest relative difference); and of the surface itself its area, and the
largest errors of positions (in units of the least radius of curvature a), normals and principal curvatures
(times a) at 4000 points. Film order 8: at order 4 the films' own error makes pressures differ by 1e-6. Root
mean squares over the meshes of one size; orders are slopes of least squares over all sizes (and between the
two finest), and h is the mean edge.

Then Newton steps: random foams of order 4 with all their T1s, from the same starts on the finest mesh and on
the formula.

Ends with an error if energy, pressures or areas converge slower than h⁴, if the energy on the finest meshes
(20 000 nodes) is off by 2e-6 or more, if the mesh needs more than twice the steps, or if a foam does not
converge.
"""

from __future__ import annotations

import os

os.environ.update(OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1", MKL_NUM_THREADS="1")

import argparse
import csv
import sys
import time
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from common import whole_numbers

import warpedfoam as wf

#: Surface, gap and least radius of curvature by name.
CASES = {"torus": (wf.Torus(20.0, 4.0), 0.5, 4.0), "sphere": (wf.Sphere(10.0), 0.1, 10.0)}
#: What is compared; the first four are of the foam and must converge at the order wanted.
QUANTITIES = ("energy", "pressures", "bubbles", "area", "positions", "normals", "curvatures")
ORDER_WANTED, ENERGY_WANTED, STEPS_WANTED, FINE = 4.0, 2e-6, 2.0, 20_000


@dataclass
class Curve:
    """Errors of one surface: by mesh size, of each mesh and quantity."""

    name: str
    edges: list[float] = field(default_factory=list)
    nodes: list[int] = field(default_factory=list)
    errors: list[np.ndarray] = field(default_factory=list)
    steps: list[tuple[int, int]] = field(default_factory=list)
    good: bool = True

    @property
    def means(self) -> np.ndarray:
        """Root mean squares (sizes, quantities)."""
        return np.array([np.sqrt((rows**2).mean(axis=0)) for rows in self.errors])

    @property
    def orders(self) -> np.ndarray:
        """Slopes of log(error) over log(h), (quantities,)."""
        return np.polyfit(np.log(self.edges), np.log(self.means), 1)[0]

    @property
    def last_orders(self) -> np.ndarray:
        """The same between the two finest sizes."""
        return np.polyfit(np.log(self.edges[-2:]), np.log(self.means[-2:]), 1)[0]


def jittered(surface: wf.Surface, n_nodes: int, seed: int) -> wf.TriangleMesh:
    """Nodes pushed about by 0.2 mean edges, back on the surface."""
    mesh = surface.triangulate(n_nodes)
    push = np.random.default_rng(seed).uniform(-1.0, 1.0, mesh.nodes.shape)
    return wf.TriangleMesh(surface.project(mesh.nodes + 0.2 * mesh.mean_edge * push), mesh.triangles)


def carried(foam: wf.Foam, cell: wf.HeleShawCell) -> wf.Foam:
    """The same foam in another cell: vertices projected, volumes in proportion."""
    points = cell.surface.project(foam.vertex_points)
    targets = foam.target_volumes * cell.volume / foam.cell.volume
    return wf.Foam(cell, foam.network, points, foam.film_offsets, targets * cell.volume / targets.sum())


def compared(mine: wf.Relaxation, twin: wf.Relaxation, scale: float) -> list[float]:
    """Errors of a foam on a mesh and of the mesh, by `QUANTITIES`."""
    surface, exact = mine.foam.cell.surface, twin.foam.cell.surface
    x = exact.random_points(4000, 1)
    bend = np.sort(surface.principal_curvatures(x)) - np.sort(exact.principal_curvatures(x))
    return [
        abs(mine.energy / twin.energy - 1.0),
        float(np.abs(mine.pressures - twin.pressures).max() / np.ptp(twin.pressures)),
        float(np.abs(mine.foam.bubble_areas / twin.foam.bubble_areas - 1.0).max()),
        abs(surface.area / exact.area - 1.0),
        float(np.linalg.norm(surface.project(x) - x, axis=1).max()) / scale,
        float(np.linalg.norm(surface.normals(x) - exact.normals(x), axis=1).max()),
        float(np.abs(bend).max()) * scale,
    ]


def measure(name: str, sizes: list[int], meshes: int, bubbles: int, order: int, seeds: list[int]) -> Curve:
    """All comparisons on one surface."""
    exact, gap, scale = CASES[name]
    cell = wf.HeleShawCell(exact, gap)
    start = wf.relax(wf.voronoi_foam(cell, bubbles, seeds="blue", seed=0, order=order))
    curve = Curve(name, good=start.converged)
    print(f"\n{name}: {exact}, gap {gap}, {bubbles} bubbles; formula {start.message}")
    print(f"{'nodes':>6}{'h':>7}" + "".join(f"{q:>12}" for q in QUANTITIES) + "  steps    s")
    fine = cell
    for size in sizes:
        began, rows, steps, edges = time.perf_counter(), [], [], []
        for k in range(meshes):
            mesh = jittered(exact, size, k)
            fine = wf.HeleShawCell(wf.MeshSurface(mesh.nodes, mesh.triangles), gap)
            mine = wf.relax(carried(start.foam, fine), t1=False)
            twin = wf.relax(carried(mine.foam, cell), t1=False)
            curve.good &= mine.converged and twin.converged
            for result in (mine, twin):
                if not result.converged:
                    print(f"# {mesh.n_nodes} nodes: {result.message}")
            rows.append(compared(mine, twin, scale))
            steps.append(mine.iterations)
            edges.append(mesh.mean_edge)
        curve.nodes.append(mesh.n_nodes)
        curve.edges.append(float(np.mean(edges)))
        curve.errors.append(np.array(rows))
        cells = "".join(f"{error:12.1e}" for error in curve.means[-1])
        took = (time.perf_counter() - began) / meshes
        print(f"{mesh.n_nodes:6d}{curve.edges[-1]:7.3f}{cells}{max(steps):7d}{took:5.0f}", flush=True)
    for label, orders in (("order", curve.orders), ("at the end", curve.last_orders)):
        print(f"{label:>13}" + "".join(f"{order:12.1f}" for order in orders))
    for seed in seeds:
        foam = wf.voronoi_foam(cell, bubbles, seed=seed)
        there, here = wf.relax(carried(foam, fine)), wf.relax(foam)
        curve.good &= there.converged and here.converged
        curve.steps.append((there.iterations, here.iterations))
        print(
            f"random seed {seed}: mesh {there.message}, formula {here.message}; "
            f"energies {there.energy / here.energy - 1.0:+.1e}",
            flush=True,
        )
    return curve


def judged(curve: Curve) -> bool:
    """Whether every target is met; says which is not."""
    faults = [] if curve.good else ["a foam did not converge"]
    for quantity, order in list(zip(QUANTITIES, curve.orders, strict=True))[:4]:
        if order < ORDER_WANTED:
            faults.append(f"{quantity} converge at order {order:.1f}")
    worst = float(curve.errors[-1][:, 0].max())
    if curve.nodes[-1] >= 0.9 * FINE and worst >= ENERGY_WANTED:
        faults.append(f"energy off by {worst:.1e} at {curve.nodes[-1]} nodes")
    mesh, formula = np.sum(curve.steps, axis=0) if curve.steps else (0, 1)
    if mesh > STEPS_WANTED * formula:
        faults.append(f"{mesh} Newton steps against {formula}")
    print(
        f"{curve.name}: largest error of the energy at {curve.nodes[-1]} nodes {worst:.1e}; "
        f"Newton steps, mesh {mesh}, formula {formula}: {'; '.join(faults) or 'all targets met'}"
    )
    return not faults


def write_csv(curves: list[Curve], path: Path) -> None:
    """A row per mesh: all that `draw` needs."""
    with path.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.writer(stream)
        writer.writerow(["surface", "nodes", "mean_edge", *QUANTITIES])
        for curve in curves:
            for nodes, edge, rows in zip(curve.nodes, curve.edges, curve.errors, strict=True):
                for row in rows:
                    writer.writerow([curve.name, nodes, f"{edge:.6g}", *(f"{error:.4g}" for error in row)])


def read_csv(path: Path) -> list[Curve]:
    """The curves that `write_csv` wrote, without Newton steps."""
    curves: dict[str, Curve] = {}
    with path.open(newline="", encoding="utf-8") as stream:
        for row in csv.DictReader(stream):
            curve = curves.setdefault(row["surface"], Curve(row["surface"]))
            if int(row["nodes"]) not in curve.nodes:
                curve.nodes.append(int(row["nodes"]))
                curve.edges.append(float(row["mean_edge"]))
                curve.errors.append(np.empty((0, len(QUANTITIES))))
            errors = [float(row[quantity]) for quantity in QUANTITIES]
            curve.errors[-1] = np.vstack([curve.errors[-1], errors])
    return list(curves.values())


def draw(curves: list[Curve], path: Path) -> None:
    """Errors over h, logarithmic: left the foam, right the surface."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    rows = ((0, 1, 2), (3, 4, 5, 6))
    names = dict(
        zip(QUANTITIES, ("energy", "pressures", "bubble areas", "total area", "positions", "normals",
                         "curvatures"), strict=True)
    )  # fmt: skip
    figure, axes = plt.subplots(
        len(rows), len(curves), figsize=(4.6 * len(curves), 7.6), layout="constrained", squeeze=False
    )
    for j, curve in enumerate(curves):
        h = np.array(curve.edges) / CASES[curve.name][2]
        for i, chosen in enumerate(rows):
            ax = axes[i, j]
            for k in chosen:
                label = f"{names[QUANTITIES[k]]} ({curve.orders[k]:.1f})"
                ax.loglog(h, curve.means[:, k], "os^D"[k % 4] + "-", color=f"C{k}", label=label, zorder=3)
                for place, errors in zip(h, curve.errors, strict=True):
                    ax.plot(np.full(len(errors), place), errors[:, k], ".", color=f"C{k}", alpha=0.35, ms=4)
            guide = curve.means[-1, chosen[0]] * (h / h[-1]) ** 4 * 0.25
            ax.loglog(h, guide, ":", color="0.4", label="slope 4")
            if i == 0:
                label = f"target of the energy\nat {FINE:,} nodes".replace(",", " ")
                ax.axhline(ENERGY_WANTED, color="0.5", lw=0.9, ls="--", label=label)
            ax.set(title=f"{curve.name}: {('the foam', 'the surface')[i]}", xlabel="mean edge h / a; nodes")
            ax.set_xticks(h, [f"{x:.2g}\n{n}" for x, n in zip(h, curve.nodes, strict=True)], fontsize=8)
            ax.set_xticks([], minor=True)
            ax.grid(True, which="major", color="0.92")
            ax.legend(frameon=False, fontsize=8, title="order in h over all sizes", title_fontsize=8)
    for row in axes:
        low, high = min(ax.get_ylim()[0] for ax in row), max(ax.get_ylim()[1] for ax in row)
        for ax in row:
            ax.set_ylim(low, high)
        row[0].set_ylabel("error against the formula")
    figure.savefig(path, dpi=130)


def main() -> int:
    """Print the tables, draw the plot; 1 if a target is missed."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--surfaces", nargs="+", choices=tuple(CASES), default=list(CASES))
    parser.add_argument("--nodes", type=int, nargs="+", default=[1250, 2500, 5000, 10_000, 20_000])
    parser.add_argument("--meshes", type=int, default=2, help="meshes of each size")
    parser.add_argument("--bubbles", type=int, default=200)
    parser.add_argument("--order", type=int, default=8, help="of the films that are compared")
    parser.add_argument("--seeds", type=whole_numbers, default=[0, 1, 2], help="of random foams, such as 0-2")
    parser.add_argument("--csv", type=Path, help="write the error of every mesh there")
    parser.add_argument("--redraw", type=Path, help="measure nothing: take the errors from this file")
    parser.add_argument("--plot", type=Path, help="write a PNG of the errors")
    args = parser.parse_args()
    if args.redraw:
        draw(read_csv(args.redraw), args.plot or args.redraw.with_suffix(".png"))
        return 0
    curves = [
        measure(name, args.nodes, args.meshes, args.bubbles, args.order, args.seeds) for name in args.surfaces
    ]
    print()
    good = [judged(curve) for curve in curves]
    if args.csv:
        write_csv(curves, args.csv)
    if args.plot:
        draw(curves, args.plot)
        print(f"wrote {args.plot}")
    return 0 if all(good) else 1


if __name__ == "__main__":
    sys.exit(main())
