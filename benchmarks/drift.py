"""A cluster of 19 drifts from the inside of the paper's torus to the outside, without help.

The cluster starts with its centre a few degrees off the inner equator, where its energy is greatest.

    PYTHONPATH=src OPENBLAS_NUM_THREADS=1 python benchmarks/drift.py [--bubbles N] [--off DEGREES] [--order P]
"""

from __future__ import annotations

import argparse
from time import perf_counter, process_time

import numpy as np

import warpedfoam as wf

TORUS = wf.Torus(major_radius=20.0, minor_radius=4.0)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--bubbles", type=int, default=19)
    parser.add_argument("--off", type=float, default=3.0, help="degrees off the inner equator")
    parser.add_argument("--order", type=int, default=6)
    parser.add_argument("--tolerance", type=float, default=1e-2)
    parser.add_argument("--duration", type=float, default=5e4)
    given = parser.parse_args()
    cell = wf.HeleShawCell(TORUS, gap=0.5)
    at = TORUS.points(np.radians([180.0 - given.off]), np.zeros(1))
    foam = wf.cluster_foam(cell, given.bubbles, volumes=0.5, centre=at, order=given.order)
    clock, cpu = perf_counter(), process_time()
    moved = wf.drift(foam, duration=given.duration, every=given.duration / 20, tolerance=given.tolerance)
    clock, cpu = perf_counter() - clock, process_time() - cpu
    middle = moved.centres[:, :-1].mean(axis=1)
    phi = np.degrees(TORUS.angles(middle)[0])
    for time, angle, energy in zip(moved.times, phi, moved.energies, strict=True):
        print(f"t = {time:9.1f}  phi = {angle:7.2f}  E = {energy:.9f}")
    rise = float(np.diff(moved.step_energies).max())
    print(moved.message)
    print(f"rejected {moved.n_rejected}, T1s {moved.n_t1}, largest rise of the energy {rise:.1e}")
    print(f"largest relative error of a volume in a frame {moved.volume_errors.max():.1e}")
    tried = moved.n_steps + moved.n_rejected
    print(f"total {clock:.1f} s, processor {cpu:.1f} s, {1e3 * cpu / tried:.0f} ms of it per step tried")
    rest = wf.relax(moved.foam)
    print(f"relax from there: {rest.message}; energy lower by {moved.energies[-1] - rest.energy:.1e}")


if __name__ == "__main__":
    main()
