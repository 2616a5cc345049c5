"""Seconds to build Voronoi cells on large meshes, and how they grow with the mesh.

    python benchmarks/building.py --bubbles 1000 2500 5000 10000
    python benchmarks/building.py --bubbles 2500 10000 --mesh

Random seeds on the torus R = 20, r = 4, 50 mesh nodes a bubble, one core. With ``--mesh`` the surface is
reconstructed from the jittered nodes of that mesh; reconstruction is timed apart. Ends with an error if the
largest took longer than ``--limit`` seconds to build.
"""

from __future__ import annotations

import os

os.environ.update(OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1", MKL_NUM_THREADS="1")

import argparse
import sys
import time

import numpy as np
from common import exponent

import warpedfoam as wf

NODES_PER_BUBBLE, JITTER, GAP = 50, 0.2, 0.5


def main() -> int:
    """Print a line per size and the exponent of the growth."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--bubbles", type=int, nargs="+", default=[1000, 2500, 5000, 10_000])
    parser.add_argument("--mesh", action="store_true", help="reconstruct the surface from a jittered mesh")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--limit", type=float, default=60.0)
    options = parser.parse_args()
    torus = wf.Torus(20.0, 4.0)
    wf.voronoi_foam(wf.HeleShawCell(torus, GAP), 300)  # load every library before the clock starts
    print("bubbles    nodes  surface/s  build/s")
    sizes: list[int] = []
    times: list[float] = []
    for count in options.bubbles:
        n_nodes = NODES_PER_BUBBLE * count
        surface: wf.Surface = torus
        start = time.perf_counter()
        if options.mesh:
            mesh = torus.triangulate(n_nodes)
            push = np.random.default_rng(1).uniform(-JITTER, JITTER, mesh.nodes.shape)
            nodes = torus.project(mesh.nodes + mesh.mean_edge * push)
            start = time.perf_counter()
            surface = wf.MeshSurface(nodes, mesh.triangles)
        middle = time.perf_counter()
        cell = wf.HeleShawCell(surface, GAP)
        wf.voronoi_foam(cell, count, seed=options.seed, n_nodes=n_nodes)
        end = time.perf_counter()
        sizes.append(n_nodes)
        times.append(end - middle)
        print(f"{count:7d} {n_nodes:8d} {middle - start:10.1f} {end - middle:8.1f}", flush=True)
    if len(sizes) > 1:
        print(f"# building grows as nodes^{exponent(sizes, times):.2f}")
    late = times[-1] > options.limit
    print(f"# the largest took {times[-1]:.1f} s, limit {options.limit:g}: {'MISSED' if late else 'met'}")
    return int(late)


if __name__ == "__main__":
    sys.exit(main())
