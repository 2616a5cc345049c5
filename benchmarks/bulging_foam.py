"""Whole foams whose films bulge, against ruled ones.

    python benchmarks/bulging_foam.py

50 bubbles on a sphere and a torus: seconds and Newton steps from the relaxed ruled foam to films that slide
on the plates and bulge, what they save of the energy, and the largest deviation of a contact angle from 90°.
``saved`` is (E_ruled − E)/E_ruled. Ends with an error if a foam does not converge to a minimum.
"""

from __future__ import annotations

import os

os.environ.update(OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1", MKL_NUM_THREADS="1")

import argparse
import sys
import time

from common import one_core

import warpedfoam as wf

SURFACES = {"sphere": wf.Sphere(4.0), "torus": wf.Torus(6.0, 2.5)}


def main() -> int:
    """Print a line per foam, order and number of layers."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--bubbles", type=int, default=50)
    parser.add_argument("--gaps", type=float, nargs="+", default=[0.3])
    parser.add_argument("--orders", type=int, nargs="+", default=[4, 8])
    parser.add_argument("--layers", type=int, nargs="+", default=[2, 4])
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    one_core()
    failed = 0
    print("surface  gap order layers  steps  seconds        energy     saved  contact/rad  residual")
    for name, surface in SURFACES.items():
        for gap in options.gaps:
            cell = wf.HeleShawCell(surface, gap)
            foam = wf.relax(wf.voronoi_foam(cell, options.bubbles, seed=options.seed)).foam
            for order in options.orders:
                ruled = wf.relax(foam, order=order)
                for layers in options.layers:
                    start = time.perf_counter()
                    result = wf.relax(ruled.foam, layers=layers)
                    took = time.perf_counter() - start
                    if not (result.converged and isinstance(result, wf.LayeredRelaxation)):
                        print(f"# {name}, order {order}, {layers} layers: {result.message}")
                        failed += 1
                        continue
                    saved = (result.ruled_energy - result.energy) / result.ruled_energy
                    print(
                        f"{name:7s} {gap:4.2g} {order:5d} {layers:6d} {result.iterations:6d} {took:8.2f} "
                        f"{result.energy:13.9f} {saved:9.3e} {result.contact_error:12.2e} "
                        f"{result.residual:9.1e}",
                        flush=True,
                    )
    print(f"# not converged: {failed}")
    return int(failed > 0)


if __name__ == "__main__":
    sys.exit(main())
