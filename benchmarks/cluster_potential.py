"""Clusters on the paper's torus: E(φ), the difference inside minus outside, its scaling, convergence in p.

Writes ``cluster_potential.csv`` (every energy) and ``cluster_scaling.csv`` (differences), prints the fits.

    PYTHONPATH=src python benchmarks/cluster_potential.py [FOLDER]
"""

from __future__ import annotations

import csv
import sys
from pathlib import Path
from time import perf_counter

import numpy as np

import warpedfoam as wf

TORUS = wf.Torus(major_radius=20.0, minor_radius=4.0)
SIZES = (1, 7, 19, 37)
GAPS = (0.05, 0.2, 0.5)
FIELDS = ["study", "bubbles", "gap", "volume", "order", "phi", "orientation", "energy", "force", "torque"]


def energies(study: str, n: int, gap: float, volume: float, phi: np.ndarray, **options: object) -> list[dict]:
    """One table row per tube angle (degrees); the force is along increasing φ."""
    cell = wf.HeleShawCell(TORUS, gap=gap)
    at = np.radians(phi)
    points = TORUS.points(at, np.zeros_like(at))
    order = int(options.pop("order", 8))  # type: ignore[call-overload]
    found = wf.cluster_potential(cell, n, volumes=volume, points=points, order=order, **options)
    up = np.einsum("nx,nx->n", found.forces, TORUS.vertex_frames(points)[:, 0])
    assert found.minima.all() or options.get("hold") == "both"
    columns = zip(phi, found.orientations, found.energies, up, found.torques, strict=True)
    return [
        dict(zip(FIELDS, (study, n, gap, volume, order, *map(float, row)), strict=True)) for row in columns
    ]


def difference(rows: list[dict]) -> float:
    """E(180°) − E(0°)."""
    by = {row["phi"]: row["energy"] for row in rows}
    return by[180.0] - by[0.0]


def fit(columns: dict[str, np.ndarray], value: np.ndarray) -> tuple[dict[str, float], float]:
    """Exponents of value = c Π column^k by least squares on logarithms, and the largest relative misfit."""
    matrix = np.stack([np.log(c) for c in columns.values()] + [np.ones(len(value))], axis=1)
    solution = np.linalg.lstsq(matrix, np.log(value), rcond=None)[0]
    misfit = np.abs(np.exp(matrix @ solution - np.log(value)) - 1.0).max()
    powers = dict(zip([*columns, "log c"], solution.tolist(), strict=True))
    return powers, float(misfit)


def orders(ends: np.ndarray) -> list[dict]:
    """The same differences by films of growing order."""
    table = []
    for n in SIZES:
        for order in (4, 6, 8, 10):
            rows = energies("order", n, 0.5, 0.5, ends, order=order)
            table += rows
            least, change = rows[0]["energy"], difference(rows)
            print(f"{n:3d} bubbles, p = {order:2d}: E(0) = {least:.12f}  E(180) − E(0) = {change:.12f}")
    return table


def scales(table: list[dict], ends: np.ndarray) -> list[dict]:
    """Differences against gap, number and area of the bubbles, and the laws fitted to them."""
    scaling = []
    for gap in GAPS:
        for n in SIZES:
            for area in (0.5, 1.0):
                # the patches' orientation changes energies by parts in a million
                rows = energies("scaling", n, gap, area * gap, ends, hold="centre" if n == 1 else "both")
                table += rows
                scaling.append({"bubbles": n, "gap": gap, "area": area, "difference": difference(rows)})
    value = {k: np.array([float(row[k]) for row in scaling]) for k in scaling[0]}
    total = value["bubbles"] * value["area"]
    for name, chosen in (("one bubble", value["bubbles"] == 1), ("patches", value["bubbles"] >= 7)):
        columns = {"gap": value["gap"][chosen], "area": value["area"][chosen]}
        if name == "patches":
            columns["bubbles"] = value["bubbles"][chosen]
        print(name, fit(columns, value["difference"][chosen]))
    chosen = value["gap"] == GAPS[0]
    curvature = np.diff(TORUS.gaussian_curvature(TORUS.points(np.array([np.pi, 0.0]), np.zeros(2))))[0]
    law = value["difference"] / (value["gap"] * total**1.5 * curvature)
    print("difference / (d A^{3/2} ΔG), thinnest gap, A the cluster's area:")
    for n, a, ratio in zip(value["bubbles"][chosen], value["area"][chosen], law[chosen], strict=True):
        print(f"  {n:4.0f} bubbles of area {a:4.2f}: {ratio:.6f}")
    print(f"  a disk's isoperimetric law: {1.0 / (4.0 * np.sqrt(np.pi)):.6f}")
    return scaling


def main(folder: str | Path = "data") -> None:
    out = Path(folder)
    table: list[dict] = []
    ends = np.array([0.0, 180.0])
    start = perf_counter()
    scaling = scales(table, ends)
    for n in SIZES:
        rows = energies("phi", n, 0.5, 0.5, np.arange(0.0, 181.0, 30.0))
        table += rows
        print(f"{n:3d} bubbles: E(180) − E(0) = {difference(rows):.9f}   ({perf_counter() - start:.0f} s)")
    table += orders(ends)
    for angle in np.arange(0.0, 91.0, 15.0):
        for n in (2, 7):
            options = {"hold": "both", "orientation": float(np.radians(angle))}
            table += energies("orientation", n, 0.5, 0.5, np.array([90.0]), **options)
    print(f"{perf_counter() - start:.0f} s in all")
    for name, rows in (("cluster_potential", table), ("cluster_scaling", scaling)):
        with (out / f"{name}.csv").open("w", newline="", encoding="utf-8") as stream:
            writer = csv.DictWriter(stream, list(rows[0]))
            writer.writeheader()
            writer.writerows(rows)


if __name__ == "__main__":
    main(*sys.argv[1:])
