"""Scars on spheres: how many 5-7 pairs does a disclination of a large foam gather round itself?

Points that repel each other (1/r³) are cooled slowly to nearly perfect crystals; their Voronoi foams are
relaxed and annealed by dislocations that glide and wander, many at once. Above R/a of about 5 (a is the
lattice spacing) crystals of particles on a sphere screen each of their twelve fivefold sites by a scar of
about 0.41 R/a − 2 excess 5-7 pairs (Bausch et al., Science 299, 1716 (2003)). Foams are softer: the line
is a comparison, not a prediction.

    python examples/06_scars_on_spheres.py [SEEDS] [LARGEST] [FOLDER]

One seed of all sizes up to 2000 takes about five minutes of one core. Foams that `scars.csv` in the folder
has are not made again, so a run that was stopped goes on.
"""

from __future__ import annotations

import csv
import sys
import time
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import warpedfoam as wf

SIZES = (100, 150, 200, 300, 400, 500, 700, 1000, 1400, 2000)
#: Of the points: at least, and per point, since larger crystals need slower cooling; of the foam.
LEAST_COOLING, COOLING, STEPS = 4000, 8, 8


def scars_of(n: int, seed: int) -> dict[str, float]:
    """One annealed foam and its defects."""
    began = time.process_time()
    sphere = wf.Sphere(1.0)
    cooling = max(LEAST_COOLING, COOLING * n)
    points = wf.anneal_points(sphere, n, seed=seed, steps=cooling).points
    foam = wf.voronoi_foam(wf.HeleShawCell(sphere, gap=1e-6), seeds=points, order=3)
    found = wf.anneal(
        foam, steps=STEPS, moves=("glide", "wander"), sites=n, temperature=3e-3, cooling=0.1, seed=seed
    )
    report = wf.defects(found.foam)
    clusters = report.clusters
    one = (clusters.charge == 1) & (clusters.kind != "network")
    return {
        "n": n,
        "seed": seed,
        "R/a": 1.0 / report.spacing,
        "excess pairs": report.summary["excess_pairs"],
        "per site": report.summary["excess_pairs"] / 12.0,
        "clusters of charge 1": int(one.sum()),
        "of these scars": int((clusters.kind == "scar").sum()),
        "per cluster": float(clusters.pairs[one].sum() / max(one.sum(), 1)),
        "length": found.energy * 1e6,
        "gained by annealing": (found.start_energy - found.energy) * 1e6 / found.foam.bubble_size,
        "moves tried": int(found.history.tried.sum()),
        "moves taken": int(found.history.taken.sum()),
        "seconds": time.process_time() - began,
    }


def means(rows: list[dict[str, float]], name: str) -> np.ndarray:
    """R/a, the mean over the seeds and its standard error for each size, (n_sizes, 3)."""
    out = []
    for n in sorted({row["n"] for row in rows}):
        same = [row for row in rows if row["n"] == n]
        values = np.array([row[name] for row in same])
        error = values.std(ddof=1) / np.sqrt(len(values)) if len(values) > 1 else np.nan
        out.append((same[0]["R/a"], values.mean(), error))
    return np.array(out)


def drawn(rows: list[dict[str, float]]) -> Figure:
    """Pairs against R/a, with the line of crystals."""
    figure = Figure(figsize=(6.4, 4.4), layout="constrained")
    axes = figure.add_subplot()
    line = np.linspace(2.0, max(12.0, max(row["R/a"] for row in rows) + 0.5), 200)
    axes.plot(line, np.maximum(0.41 * line - 2.0, 0.0), color="0.5", label="crystals: 0.41 R/a − 2")
    for name, label, mark, colour in (
        ("per site", "all excess pairs / 12", "o", "C0"),
        ("per cluster", "connected clusters of charge +1", "s", "C1"),
    ):
        ratio, mean, error = means(rows, name).T
        axes.errorbar(ratio, mean, error, fmt=mark, color=colour, capsize=3, label=label)
        axes.plot([row["R/a"] for row in rows], [row[name] for row in rows], ".", color=colour, alpha=0.3)
    axes.set_xlabel("R/a, radius over lattice spacing")
    axes.set_ylabel("excess 5–7 pairs per scar")
    axes.legend(frameon=False, title="means and standard errors; dots: single foams")
    return figure


def kept(path: Path) -> list[dict[str, float]]:
    """Rows of a run before this one."""
    if not path.exists():
        return []
    with path.open(encoding="utf-8", newline="") as stream:
        return [{name: float(value) for name, value in row.items()} for row in csv.DictReader(stream)]


def main(n_seeds: int = 2, largest: int = 2000, folder: str | Path = "out") -> list[dict[str, float]]:
    """Return a row per foam."""
    out = Path(folder)
    out.mkdir(parents=True, exist_ok=True)
    rows = kept(out / "scars.csv")
    done = {(row["n"], row["seed"]) for row in rows}
    print("    n  seed   R/a  pairs  per site  scars  pairs per cluster    length    time")
    for seed in range(n_seeds):
        for n in (size for size in SIZES if size <= largest):
            if (n, seed) in done:
                continue
            row = scars_of(n, seed)
            rows.append(row)
            print(
                f"{n:5d} {seed:5d} {row['R/a']:5.2f} {row['excess pairs']:6.0f} {row['per site']:9.2f} "
                f"{row['of these scars']:6.0f} {row['per cluster']:18.2f} {row['length']:9.4f} "
                f"{row['seconds']:6.1f} s",
                flush=True,
            )
            # after each foam: a run that is stopped has shown something
            ordered = sorted(rows, key=lambda r: (r["n"], r["seed"]))
            columns = {name: np.array([r[name] for r in ordered]) for name in row}
            wf.write_columns_csv(out / "scars.csv", columns)
    wf.save_figure(out / "scars.png", drawn(rows))
    return rows


if __name__ == "__main__":
    main(*map(int, sys.argv[1:3]), *sys.argv[3:4])
