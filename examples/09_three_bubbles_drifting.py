"""Bubbles on a torus drift to its outer equator: the paper's last figure in motion, and a cluster of seven.

The paper's torus (R = 20, r = 4, gap 0.5) and bubbles of volume 0.5. Three bubbles start on the outer
equator, on top, and just off the inner equator; friction on the plates and the curvature do the rest. In
units of λ/γ times length squared a bubble finds its shape in one, and its place in tens of thousands.

    python examples/09_three_bubbles_drifting.py [FOLDER] [--full]
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

import warpedfoam as wf

TORUS = wf.Torus(major_radius=20.0, minor_radius=4.0)
CELL = wf.HeleShawCell(TORUS, gap=0.5)
#: Tube angles at the start, in degrees, and ring angles, so that nobody is in anybody's way.
STARTS = {"three bubbles": ([0.0, 90.0, 175.0], [-6.0, 0.0, 6.0]), "seven": ([170.0], [0.0])}


def placed(name: str, order: int) -> wf.Foam:
    """The clusters at their starts, not relaxed: that would move them."""
    phi, theta = (np.radians(angles) for angles in STARTS[name])
    counts = [1] * len(phi) if name == "three bubbles" else [7]
    return wf.cluster_foam(CELL, counts, volumes=0.5, centre=TORUS.points(phi, theta), order=order)


def main(folder: str | Path = "out", full: bool = False, duration: float = 2e5) -> tuple[float, float]:
    """Return the largest tube angle of a bubble at the end, in degrees, and the largest rise of an energy."""
    out = Path(folder)
    out.mkdir(parents=True, exist_ok=True)
    every, tolerance, order = (duration / 100, 1e-3, 8) if full else (duration / 8, 0.1, 5)
    farthest, rise = 0.0, -np.inf
    for name in STARTS:
        start = wf.drift(placed(name, order), duration=20.0, every=20.0, tolerance=tolerance).foam
        moved = wf.drift(start, friction=1.0, duration=duration, every=every, tolerance=tolerance)
        if not moved.completed:
            raise SystemExit(moved.message)
        # the middle of the seven counts
        places = moved.centres[:, :-1]
        places = places.mean(axis=1, keepdims=True) if name == "seven" else places
        phi = np.degrees(TORUS.angles(places.reshape(-1, 3))[0]).reshape(len(moved.times), -1)
        print(f"{name}: {moved.n_steps} steps, energy {moved.energies[0]:.6f} to {moved.energies[-1]:.6f}")
        for k in range(0, len(moved.times), max(1, len(moved.times) // 4)):
            print(f"  t = {moved.times[k]:8.0f}  phi = {np.round(phi[k], 1).tolist()}")
        stem = name.replace(" ", "_")
        wf.save_figure(out / f"{stem}.png", wf.plot_drift(moved, color_by="sides"))
        wf.write_columns_csv(out / f"{stem}.csv", {"time": moved.step_times, "energy": moved.step_energies})
        if full:
            wf.animate(moved, out / f"{stem}.gif", color_by="sides")
        farthest = max(farthest, float(np.abs(phi[-1]).max()))
        rise = max(rise, float(np.diff(moved.step_energies).max()))
    return farthest, rise


if __name__ == "__main__":
    words = [word for word in sys.argv[1:] if word != "--full"]
    main(*words[:1], full="--full" in sys.argv)
