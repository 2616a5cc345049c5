"""Spectral convergence in film order: energies and pressures of the same foams at p = 2 … 10, against p = 12.

    python benchmarks/convergence.py --csv benchmarks/data/film_order.csv --plot docs/film_order.png
    python benchmarks/convergence.py --redraw benchmarks/data/film_order.csv --plot again.png

Three foams: 32 and 200 bubbles on the unit sphere (gap 0.01), 200 on Torus(20, 4) (gap 0.5), relaxed at
p = 4 with T1s, then at every other order from there without. The error of the energy is relative; that of the
pressures is the largest difference, in units of γ/ℓ (ℓ = sqrt(area / bubbles)). Ends with an error
if p = 4 and p = 8 differ by more than 1e-7 with 200 bubbles.
"""

from __future__ import annotations

import os

os.environ.update(OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1", MKL_NUM_THREADS="1")

import argparse
import csv
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from common import cell_of

import warpedfoam as wf


@dataclass
class Curve:
    """Errors of one foam by film order."""

    name: str
    bubbles: int
    orders: list[int]
    energy: list[float]
    pressure: list[float]
    four_to_eight: float = float("nan")
    converged: bool = True


def converge(
    surface: str, bubbles: int, kind: str, seed: int, orders: list[int], reference: int, tolerance: float
) -> Curve:
    """Relax one foam at every order."""
    foam = wf.voronoi_foam(cell_of(surface), bubbles, seeds=kind, seed=seed)
    start = wf.relax(foam, order=4)
    name = f"{bubbles} bubbles, {surface}"
    if not start.converged:
        print(f"# {name}: p = 4 {start.message}")
    results = {
        p: wf.relax(start.foam, order=p, t1=False, tolerance=tolerance)
        for p in sorted({*orders, reference, 4, 8})
    }
    for p, result in results.items():
        if not result.converged:
            print(f"# {name}: p = {p} {result.message}")
    best = results[reference]
    scale = foam.bubble_size / foam.tension
    return Curve(
        name,
        bubbles,
        orders,
        [abs(results[p].energy / best.energy - 1.0) for p in orders],
        [scale * float(np.abs(results[p].pressures - best.pressures).max()) for p in orders],
        abs(results[4].energy / results[8].energy - 1.0),
        start.converged and all(result.converged for result in results.values()),
    )


def write_csv(curves: list[Curve], path: Path) -> None:
    """A row per foam and order: all that `draw` needs."""
    with path.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.writer(stream)
        writer.writerow(["foam", "bubbles", "order", "energy", "pressures"])
        for curve in curves:
            for p, energy, pressure in zip(curve.orders, curve.energy, curve.pressure, strict=True):
                writer.writerow([curve.name, curve.bubbles, p, f"{energy:.3g}", f"{pressure:.3g}"])


def read_csv(path: Path) -> list[Curve]:
    """The curves that `write_csv` wrote."""
    curves: dict[str, Curve] = {}
    with path.open(newline="", encoding="utf-8") as stream:
        for row in csv.DictReader(stream):
            curve = curves.setdefault(row["foam"], Curve(row["foam"], int(row["bubbles"]), [], [], []))
            curve.orders.append(int(row["order"]))
            curve.energy.append(float(row["energy"]))
            curve.pressure.append(float(row["pressures"]))
    return list(curves.values())


def draw(curves: list[Curve], reference: int, path: Path) -> None:
    """Errors over order, logarithmic; energies full, pressures dashed."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    figure, axes = plt.subplots(figsize=(6.4, 4.4), layout="constrained")
    for k, curve in enumerate(curves):
        axes.semilogy(curve.orders, np.maximum(curve.energy, 1e-16), "o-", color=f"C{k}", label=curve.name)
        axes.semilogy(curve.orders, np.maximum(curve.pressure, 1e-16), "s--", color=f"C{k}", mfc="w")
    axes.semilogy([], [], "o-", color="0.4", label="energy, relative")
    axes.semilogy([], [], "s--", color="0.4", mfc="w", label="pressures, γ/ℓ")
    axes.set(xlabel="film order p", ylabel=f"difference from p = {reference}")
    axes.set(xticks=curves[0].orders, ylim=(3e-17, 1.0))
    axes.grid(True, which="major", color="0.9")
    axes.legend(frameon=False)
    figure.savefig(path, dpi=150)


def main() -> int:
    """Print the table, draw the plot; 1 if something did not converge."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--seeds", choices=("lattice", "blue", "random"), default="blue")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--orders", type=int, nargs="+", default=[2, 3, 4, 5, 6, 8, 10])
    parser.add_argument("--reference", type=int, default=12)
    parser.add_argument("--tolerance", type=float, default=1e-12, help="of the residuals")
    parser.add_argument("--csv", type=Path, help="write the errors there")
    parser.add_argument("--redraw", type=Path, help="measure nothing: take the errors from this file")
    parser.add_argument("--plot", type=Path, help="write a PNG of the errors")
    args = parser.parse_args()
    if args.redraw:
        draw(read_csv(args.redraw), args.reference, args.plot or args.redraw.with_suffix(".png"))
        return 0
    foams = (("sphere", 32), ("sphere", 200), ("torus", 200))
    curves = [
        converge(surface, bubbles, args.seeds, args.seed, args.orders, args.reference, args.tolerance)
        for surface, bubbles in foams
    ]
    print(f"difference from p = {args.reference}: energy (relative), pressures (γ/ℓ)")
    print("  p" + "".join(f"{curve.name:>24}" for curve in curves))
    for k, p in enumerate(args.orders):
        cells = (f"{curve.energy[k]:12.1e}{curve.pressure[k]:12.1e}" for curve in curves)
        print(f"{p:3d}" + "".join(cells))
    good = True
    for curve in curves:
        fine = curve.bubbles < 200 or curve.four_to_eight <= 1e-7
        good = good and fine and curve.converged
        print(f"{curve.name}: energies at p = 4 and p = 8 differ by {curve.four_to_eight:.1e}")
    if args.csv:
        write_csv(curves, args.csv)
    if args.plot:
        draw(curves, args.reference, args.plot)
        print(f"wrote {args.plot}")
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())
