"""Seconds to build Voronoi cells on large meshes, and how they grow with the mesh.

    python benchmarks/building.py --bubbles 1200 2500 5000 10000
    python benchmarks/building.py --bubbles 1200 2500 5000 10000 --mesh

Random seeds on the torus R = 20, r = 4, 50 mesh nodes a bubble. Seconds are the processor's, of one thread;
the clock's are printed beside them. What else runs on the machine still counts, through memory and caches.
With ``--mesh`` the surface is reconstructed from the jittered nodes of that mesh; reconstruction is timed
apart, and numba, if it is installed, has compiled its loops before. Prints the exponents of the growth.
Ends with an error if the largest took longer than ``--limit`` seconds, reconstruction included, or a total
grows faster than ``--growth``.
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
    """Print a line per size and the exponents of the growth."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--bubbles", type=int, nargs="+", default=[1200, 2500, 5000, 10_000])
    parser.add_argument("--mesh", action="store_true", help="reconstruct the surface from a jittered mesh")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--limit", type=float, default=60.0)
    parser.add_argument("--growth", type=float, default=1.2, help="largest exponent of the growth")
    options = parser.parse_args()
    torus = wf.Torus(20.0, 4.0)
    # load and compile everything before the clock starts
    wf.voronoi_foam(wf.HeleShawCell(torus, GAP), 300)
    if options.mesh:
        mesh = jittered(torus, 21_000)
        wf.voronoi_foam(wf.HeleShawCell(wf.MeshSurface(mesh.nodes, mesh.triangles), GAP), 300)
    print("bubbles    nodes  surface/s  build/s  total/s  clock/s")
    sizes: list[int] = []
    times: list[tuple[float, float, float]] = []
    for count in options.bubbles:
        n_nodes = NODES_PER_BUBBLE * count
        surface: wf.Surface = torus
        mesh = jittered(torus, n_nodes) if options.mesh else None
        clock, start = time.perf_counter(), time.process_time()
        if mesh is not None:
            surface = wf.MeshSurface(mesh.nodes, mesh.triangles)
        middle = time.process_time()
        wf.voronoi_foam(wf.HeleShawCell(surface, GAP), count, seed=options.seed, n_nodes=n_nodes)
        end = time.process_time()
        sizes.append(n_nodes)
        times.append((middle - start, end - middle, end - start))
        shown = "".join(f"{t:9.1f}" for t in (*times[-1], time.perf_counter() - clock))
        print(f"{count:7d} {n_nodes:8d}  {shown}", flush=True)
    growth = 0.0
    if len(sizes) > 1:
        parts = [exponent(sizes, list(column)) for column in zip(*times, strict=True)]
        growth = parts[2]
        told = f"reconstruction as nodes^{parts[0]:.2f}, building as nodes^{parts[1]:.2f}, " * options.mesh
        print(f"# {told}the total grows as nodes^{growth:.2f}, limit {options.growth:g}")
    late = times[-1][2] > options.limit or growth > options.growth
    print(f"# the largest took {times[-1][2]:.1f} s, limit {options.limit:g}: {'MISSED' if late else 'met'}")
    return int(late)


def jittered(torus: wf.Torus, n_nodes: int) -> wf.TriangleMesh:
    """A mesh of the torus whose nodes were pushed about on it."""
    mesh = torus.triangulate(n_nodes)
    push = np.random.default_rng(1).uniform(-JITTER, JITTER, mesh.nodes.shape)
    return wf.TriangleMesh(torus.project(mesh.nodes + mesh.mean_edge * push), mesh.triangles)


if __name__ == "__main__":
    sys.exit(main())
