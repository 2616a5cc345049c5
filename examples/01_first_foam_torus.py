"""A first foam on a torus: build it, relax it, look at it.

More fives (charge +1) settle on the outer half, where the Gaussian curvature is positive, more sevens
(charge −1) on the inner half; all charges add up to 6 χ = 0. A lattice of hexagons needs less film.

    python examples/01_first_foam_torus.py [FOLDER]
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import numpy as np

import warpedfoam as wf
from warpedfoam.plot import save_picture


def main(folder: str | Path) -> tuple[float, float]:
    """Return the energies of the relaxed random foam and of the relaxed lattice."""
    torus = wf.Torus(major_radius=20.0, minor_radius=4.0)
    cell = wf.HeleShawCell(torus, gap=0.5)
    foam = wf.voronoi_foam(cell, n_bubbles=200, seed=0)
    relaxed = wf.relax(foam)
    if not relaxed.converged:
        raise SystemExit(f"not converged: {relaxed.message}")

    foam = relaxed.foam
    charges = foam.network.charges
    outer = torus.gaussian_curvature(foam.bubble_centres) > 0.0
    print(f"energy {foam.energy:.9f} after {relaxed.n_t1} T1s, residual {relaxed.residual:.1e}")
    print(f"charge outside {charges[outer].sum():+d}, inside {charges[~outer].sum():+d}")
    print(f"pressures between {foam.pressures.min():+.4f} and {foam.pressures.max():+.4f}")
    print(f"volumes held to {np.abs(foam.bubble_volumes / foam.target_volumes - 1.0).max():.0e}")

    lattice = wf.relax(wf.voronoi_foam(cell, n_bubbles=200, seeds="lattice"))
    if not lattice.converged:
        raise SystemExit(f"the lattice has not converged: {lattice.message}")
    hexagons = int((lattice.foam.network.sides == 6).sum())
    print(f"lattice of {hexagons} hexagons: energy {lattice.energy:.9f}")

    picture = Path(folder) / "torus.png"
    save_picture(picture, foam, color_by="charge")
    print(f"picture in {picture}")
    return foam.energy, lattice.energy


if __name__ == "__main__":
    if sys.argv[1:]:
        Path(sys.argv[1]).mkdir(parents=True, exist_ok=True)
    main(sys.argv[1] if sys.argv[1:] else tempfile.mkdtemp(prefix="warpedfoam-"))
