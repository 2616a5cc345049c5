"""Scars on spheres: how many 5-7 pairs does a disclination of a large foam gather round itself?

Points that repel each other (1/r³) are a good crystal; their Voronoi foams are relaxed and annealed by
gliding dislocations and pairs of T1s. Above R/a of about 5 (a is the lattice spacing) crystals of particles
on a sphere screen each of their twelve fivefold sites by a scar of about 0.41 R/a − 2 excess 5-7 pairs
(Bausch et al., Science 299, 1716 (2003)). Foams are softer: the line is a comparison, not a prediction.

    python examples/06_scars_on_spheres.py [SEEDS] [LARGEST] [FOLDER]
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import warpedfoam as wf

SIZES = (100, 200, 400, 700, 1000, 1400, 2000)
LEAST_STEPS, WORK = 10, 20_000


def scars_of(n: int, seed: int) -> dict[str, float]:
    """One annealed foam and its defects."""
    began = time.perf_counter()
    sphere = wf.Sphere(1.0)
    points = wf.thomson_points(sphere, n, seed=seed, tolerance=1e-3, max_iterations=300).points
    foam = wf.voronoi_foam(wf.HeleShawCell(sphere, gap=1e-6), seeds=points, order=3)
    steps = max(LEAST_STEPS, min(60, WORK // n))
    found = wf.anneal(foam, steps=steps, moves=("glide", "pair"), temperature=1e-3, seed=seed)
    report = wf.defects(found.foam)
    clusters = report.clusters
    one = (clusters.charge == 1) & (clusters.kind != "network")
    return {
        "n": n,
        "seed": seed,
        "steps": steps,
        "R/a": 1.0 / report.spacing,
        "excess pairs": report.summary["excess_pairs"],
        "per site": report.summary["excess_pairs"] / 12.0,
        "clusters of charge 1": int(one.sum()),
        "per cluster": float(clusters.pairs[one].sum() / max(one.sum(), 1)),
        "start energy": found.start_energy * 1e6,
        "energy": found.energy * 1e6,
        "seconds": time.perf_counter() - began,
    }


def drawn(rows: list[dict[str, float]]) -> Figure:
    """Pairs against R/a, with the line of crystals."""
    figure = Figure(figsize=(6.4, 4.4), layout="constrained")
    axes = figure.add_subplot()
    ratio = np.array([row["R/a"] for row in rows])
    line = np.linspace(2.0, max(12.0, ratio.max() + 0.5), 200)
    axes.plot(line, np.maximum(0.41 * line - 2.0, 0.0), color="0.5", label="crystals: 0.41 R/a − 2")
    for name, label, mark in (
        ("per site", "all excess pairs / 12", "o"),
        ("per cluster", "mean of connected clusters of charge 1", "x"),
    ):
        axes.plot(ratio, [row[name] for row in rows], mark, label=label)
    axes.set_xlabel("R/a, radius over lattice spacing")
    axes.set_ylabel("excess 5–7 pairs per scar")
    axes.legend(frameon=False)
    return figure


def main(n_seeds: int = 2, largest: int = 2000, folder: str | Path = "out") -> list[dict[str, float]]:
    """Return a row per foam."""
    out = Path(folder)
    out.mkdir(parents=True, exist_ok=True)
    rows = []
    print("    n  seed   R/a  pairs  per site  clusters of charge 1  pairs per cluster    energy    time")
    for seed in range(n_seeds):
        for n in (size for size in SIZES if size <= largest):
            row = scars_of(n, seed)
            rows.append(row)
            print(
                f"{n:5d} {seed:5d} {row['R/a']:5.2f} {row['excess pairs']:6.0f} {row['per site']:9.2f} "
                f"{row['clusters of charge 1']:21.0f} {row['per cluster']:18.2f} {row['energy']:9.4f} "
                f"{row['seconds']:6.1f} s",
                flush=True,
            )
        # after each seed: a run that is stopped has shown something
        columns = {name: np.array([row[name] for row in rows]) for name in rows[0]}
        wf.write_columns_csv(out / "scars.csv", columns)
        wf.save_figure(out / "scars.png", drawn(rows))
    return rows


if __name__ == "__main__":
    main(*map(int, sys.argv[1:3]), *sys.argv[3:4])
