"""Pictures of the accuracy page, from the tables that benchmarks left in benchmarks/data."""

from __future__ import annotations

import csv
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import warpedfoam as wf

ROOT = Path(__file__).resolve().parents[2]
STORED = ROOT / "benchmarks" / "data"


def redrawn(script: str, table: str) -> Callable[[Path], None]:
    """The picture that a benchmark draws itself."""

    def drawn(path: Path) -> None:
        command = [sys.executable, str(ROOT / "benchmarks" / script), "--redraw", str(STORED / table)]
        subprocess.run([*command, "--plot", str(path)], check=True)

    return drawn


def columns(name: str) -> dict[str, np.ndarray]:
    """A table by columns; numbers where they are."""
    with (STORED / name).open(newline="", encoding="utf-8") as stream:
        rows = list(csv.DictReader(stream))
    out = {}
    for key in rows[0]:
        texts = [row[key] for row in rows]
        try:
            out[key] = np.array([float(text or "nan") for text in texts])
        except ValueError:
            out[key] = np.array(texts)
    return out


def layers(path: Path) -> None:
    """One bubble's energy against the layers of its film."""
    table = columns("layers.csv")
    figure = Figure(figsize=(5.6, 4.0), layout="constrained")
    axes = figure.add_subplot()
    for k, phi in enumerate(np.unique(table["phi_degrees"])):
        chosen = table["phi_degrees"] == phi
        error = np.abs(table["difference"][chosen])
        axes.semilogy(table["layers"][chosen], error, "os^"[k] + "-", color=f"C{k}", label=f"φ = {phi:g}°")
    line = {"arrowstyle": "-", "lw": 0.8, "color": "0.4"}
    note = "ruled film: the distance\nof the model, not an error"
    axes.annotate(note, (1.05, 6e-5), (1.6, 6e-4), fontsize=9, arrowprops=line)
    axes.set(xlabel="layers of the film", ylabel="|E/E0 − E/E0 with 9 layers|", ylim=(3e-15, 1e-2))
    axes.grid(True, which="major", color="0.92")
    axes.legend(frameon=False)
    wf.save_figure(path, figure, dpi=130)


def circles(path: Path) -> None:
    """Geodesic circles: errors of three methods, and where the curvature term stands."""
    table = columns("circles.csv")
    figure = Figure(figsize=(8.6, 4.0), layout="constrained")
    by_mesh, by_radius = figure.subplots(1, 2)
    exact = table["method"] == "exact"
    heat = table["method"] == "heat"
    relative = np.abs(table["perimeter_fault"]) / table["perimeter"]
    share = table["spacing"] / table["radius"]
    estimate = table["error"] / table["perimeter"]
    for chosen, mark, colour, name in ((heat, "s", "C0", "heat"), (exact, "o", "C1", "exact on facets")):
        by_mesh.loglog(share[chosen], relative[chosen], mark, mfc="none", color=colour, label=name)
        by_mesh.loglog(
            share[chosen], estimate[chosen], "_", color=colour, ms=9, label=f"{name}: its estimate"
        )
    at = np.array([0.07, 0.35])
    by_mesh.loglog(at, 0.05 * at, "--", color="0.5", lw=1.0, label="slope 1")
    by_mesh.loglog(at, 1e-3 * at**4, ":", color="0.5", lw=1.2, label="slope 4")
    by_mesh.set(xlabel="mesh spacing h over radius ρ", ylabel="relative error of the perimeter C")
    ticks = (0.08, 0.1, 0.15, 0.2, 0.3)
    by_mesh.set_xticks(ticks, [f"{x:g}" for x in ticks])
    by_mesh.set_xticks([], minor=True)
    by_mesh.set_ylim(1e-13, 1.0)
    by_mesh.legend(frameon=False, fontsize=8, loc="lower right", ncols=2)
    by_mesh.grid(True, which="major", color="0.92")

    radii = np.unique(table["radius"])
    ways = (
        ("heat", "C0", "s", "heat, h ≈ ρ/10"),
        ("exact", "C1", "o", "exact, h ≈ ρ/10"),
        ("jacobi", "C2", "^", "traced"),
    )
    for method, colour, mark, label in ways:
        worst = []
        for radius in radii:
            finest = [
                np.flatnonzero(
                    (table["method"] == method) & (table["radius"] == radius) & (table["phi_degrees"] == phi)
                )[-1]
                for phi in np.unique(table["phi_degrees"])
            ]
            worst.append(max(float(relative[finest].max()), 1e-17))
        by_radius.loglog(radii, worst, mark + "-", color=colour, label=label)
    # the term that curvature adds to 2πρ at φ = 0, where G = 1/96
    by_radius.loglog(radii, radii**2 / 6.0 / 96.0, "k--", lw=1.2, label="curvature term, ρ² G/6 at φ = 0")
    by_radius.set(xlabel="radius ρ", ylabel="relative error of C, worst of three places", ylim=(1e-17, 1.0))
    by_radius.set_xticks(radii, [f"{x:g}" for x in radii])
    by_radius.set_xticks([], minor=True)
    by_radius.grid(True, which="major", color="0.92")
    by_radius.legend(frameon=False, fontsize=8.5, loc=(0.03, 0.22))
    wf.save_figure(path, figure, dpi=130)


PICTURES: dict[str, Callable[[Path], None]] = {
    "mesh_accuracy": redrawn("mesh_accuracy.py", "mesh_accuracy.csv"),
    "film_order": redrawn("convergence.py", "film_order.csv"),
    "layers_accuracy": layers,
    "circles_accuracy": circles,
}
