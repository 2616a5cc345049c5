"""Defect statistics on a sphere: how many fives and sevens do random foams relax to?

A sphere needs a total charge of 6 χ = 12. Twelve fives would do; a random foam has many more charges,
in pairs of opposite sign: the excess. For comparison a foam that starts from an even lattice of seeds.

    python examples/02_defects_on_a_sphere.py [SEEDS] [BUBBLES]
"""

from __future__ import annotations

import sys

import warpedfoam as wf


def main(n_seeds: int = 5, n_bubbles: int = 100) -> tuple[float, float]:
    """Return the mean number of excess pairs, and the energy of the foam from a lattice."""
    cell = wf.HeleShawCell(wf.Sphere(radius=10.0), gap=0.5)
    print(f"{n_bubbles} bubbles on a sphere, random starts")
    print("seed   T1s   fours  fives  sixes  sevens  eights  excess  charge      energy")
    total = 0
    for seed in (*range(n_seeds), "even"):
        start = (
            wf.voronoi_foam(cell, n_bubbles, seeds="lattice")
            if seed == "even"
            else wf.voronoi_foam(cell, n_bubbles, seed=seed)
        )
        relaxed = wf.relax(start)
        if not relaxed.converged:
            raise SystemExit(f"seed {seed} did not converge: {relaxed.message}")
        network = relaxed.foam.network
        count = {n: int((network.sides == n).sum()) for n in range(4, 9)}
        charge = int(network.charges.sum())
        excess = (int(abs(network.charges).sum()) - charge) // 2  # pairs beyond the twelve fives
        print(
            f"{seed:>4} {relaxed.n_t1:5d}   {count[4]:5d}  {count[5]:5d}  {count[6]:5d}  {count[7]:6d}  "
            f"{count[8]:6d}  {excess:6d}  {charge:6d}  {relaxed.energy:10.6f}"
        )
        if charge != 12:
            raise SystemExit(f"seed {seed}: the charges add up to {charge}, not to 12")
        total += excess if seed != "even" else 0
    print(f"mean excess of the random starts {total / n_seeds:.2f} pairs")
    return total / n_seeds, relaxed.energy


if __name__ == "__main__":
    main(*map(int, sys.argv[1:3]))
