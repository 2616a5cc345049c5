"""Charge against curvature on tori: do the outer halves carry twelve fives' worth of charge?

By Gauss–Bonnet the outer half of any torus has ∫ G dA = 4π, twelve disclinations' worth, and the inner
half −4π. Random foams are relaxed on tori of several aspect ratios; the charge of their halves and of six
bands is averaged and compared with (3/π) ∫ G dA.

    python examples/04_defects_on_tori.py [SEEDS] [BUBBLES] [FOLDER]
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

import warpedfoam as wf

ASPECTS = (1.5, 3.0, 6.0)


def main(n_seeds: int = 8, n_bubbles: int = 150, folder: str | Path = "out") -> tuple[float, float]:
    """Return the mean charge of the outer halves, and the mean square of (charge − curvature) / error."""
    out = Path(folder)
    out.mkdir(parents=True, exist_ok=True)
    print(f"{n_seeds} foams of {n_bubbles} bubbles for each ratio; charges of the bands from outside inwards")
    print("ratio  outer half       bands of 30 degrees, charge (curvature)")
    outer, pulls = [], []
    for aspect in ASPECTS:
        # equal areas: the same bubbles on every torus
        tube = np.sqrt(100.0 / aspect)
        torus = wf.Torus(major_radius=aspect * tube, minor_radius=tube)

        def tube_angle(x: np.ndarray, ring: float = aspect * tube) -> np.ndarray:
            return np.abs(np.arctan2(x[:, 2], np.hypot(x[:, 0], x[:, 1]) - ring))

        cell = wf.HeleShawCell(torus, gap=0.1)
        foams = []
        for seed in range(n_seeds):
            relaxed = wf.relax(wf.voronoi_foam(cell, n_bubbles, seed=seed))
            if not relaxed.converged:
                raise SystemExit(f"seed {seed} did not converge: {relaxed.message}")
            if wf.defects(relaxed.foam).total_charge != 0:
                raise SystemExit(f"seed {seed}: the charges do not add up to 0")
            foams.append(relaxed.foam)
        halves = wf.charge_profile(foams, tube_angle, [0.0, np.pi / 2, np.pi])
        bands = wf.charge_profile(foams, tube_angle, np.linspace(0.0, np.pi, 7))
        assert halves.charge_error is not None
        assert bands.charge_error is not None
        row = "  ".join(
            f"{q:5.1f} ({c:4.1f})" for q, c in zip(bands.charge, bands.region_curvature, strict=True)
        )
        print(f"{aspect:5.1f}  {halves.charge[0]:5.2f} ± {halves.charge_error[0]:4.2f}   {row}")
        outer.append(halves.charge[0])
        pulls += (((bands.charge - bands.region_curvature) / bands.charge_error) ** 2).tolist()
        wf.save_figure(
            out / f"charge_{aspect:g}.png",
            wf.plot_charge_profile(bands, coordinate="angle |φ| round the tube"),
        )
    wf.save_figure(out / "defects.png", wf.plot_defects(foams[-1]))
    print(f"mean outer charge {np.mean(outer):.2f} (12 in the limit of many bubbles)")
    print(f"mean square of (charge - curvature) / error {np.mean(pulls):.2f} (1 if only chance)")
    return float(np.mean(outer)), float(np.mean(pulls))


if __name__ == "__main__":
    main(*map(int, sys.argv[1:3]), *sys.argv[3:4])
