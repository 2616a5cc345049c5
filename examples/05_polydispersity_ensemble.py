"""Polydispersity against defects: an ensemble of foams on a torus, its table and a picture.

Random foams of bubbles whose volumes are log-normal of several widths; how many 5-7 pairs beyond what the
surface asks for, and how far above the flat honeycomb's energy? The same as a file:
examples/polydispersity.toml, run by ``warpedfoam ensemble``. Stop it and start it again: it goes on.

    python examples/05_polydispersity_ensemble.py [REPEATS] [BUBBLES] [FOLDER]
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import warpedfoam as wf

WIDTHS = [0.0, 0.2, 0.4, 0.6]


def main(
    repeats: int = 8, n_bubbles: int = 150, folder: str | Path = "out", workers: int | None = None
) -> tuple[list[float], int]:
    """Return the mean number of excess pairs per bubble at each width, and how many runs failed."""
    study = wf.Study(
        seed=1,
        repeats=repeats,
        surface={"kind": "torus", "area": 400.0, "aspect_ratio": 3.0},
        cell={"gap": 0.1},
        foam={"n_bubbles": n_bubbles, "seeds": "blue", "cells": "power"},
        grid={"foam.volumes": WIDTHS},
        observables=("energy_over_honeycomb", "mu2", "defects.excess_pairs", "sum_of_charges"),
    )
    out = Path(folder)
    ensemble = wf.run_ensemble(study, out / "polydispersity", workers=workers)
    print(f"{ensemble.n_runs} runs: {ensemble.counts}; the table is {ensemble.folder / 'ensemble.csv'}")
    good = {"status": "converged"}
    if ensemble.column("sum_of_charges", good).any():
        raise SystemExit("the charges do not add up to 0")

    print("width   excess pairs per bubble    mu2            energy over honeycomb")
    rows = []
    for width in WIDTHS:
        where = {**good, "foam.volumes": width}
        pairs = ensemble.column("defects.excess_pairs", where) / n_bubbles
        parts = [pairs, ensemble.column("mu2", where), ensemble.column("energy_over_honeycomb", where)]
        means = [(float(p.mean()), float(p.std(ddof=1)) / np.sqrt(len(p))) for p in parts]
        print(f"{width:5.2f}   " + "    ".join(f"{mean:7.4f} ± {error:6.4f}" for mean, error in means))
        rows.append(means)

    figure = Figure(figsize=(9.0, 4.0), layout="constrained")
    values = np.array(rows)
    labels = ("5–7 pairs beyond charge 0, per bubble", "μ₂, variance of the number of sides")
    for k, (axes, label) in enumerate(zip(figure.subplots(1, 2), labels, strict=True)):
        scatter = ensemble.column(("defects.excess_pairs", "mu2")[k], good) / (n_bubbles, 1)[k]
        axes.plot(ensemble.column("foam.volumes", good), scatter, ".", color="0.75", label="single foams")
        axes.errorbar(WIDTHS, values[:, k, 0], values[:, k, 1], fmt="o-", capsize=3, label="mean")
        axes.set(xlabel="width of the volumes, standard deviation of ln V", ylabel=label)
        axes.set_ylim(bottom=0.0)
        axes.legend()
    wf.save_figure(out / "polydispersity.png", figure)
    bad = ensemble.n_runs - ensemble.counts["converged"]
    return values[:, 0, 0].tolist(), bad


if __name__ == "__main__":
    main(*map(int, sys.argv[1:3]), *sys.argv[3:4])
