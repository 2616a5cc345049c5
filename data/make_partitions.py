"""Least partitions of the unit sphere into n equal areas: searches, and writes minimal_partitions.csv.

    python data/make_partitions.py [STATE_FOLDER] [STARTS] [N ...]

At most 60 starts for each of n = 2 … 32 and 72 by default; about half an hour on one core. States are kept
in the folder, so that a run that was stopped goes on, and a later one may make more starts; rows of other n
in the table stay. A search ends early once the known length is reached.
"""

from __future__ import annotations

import csv
import sys
import time
from pathlib import Path

import numpy as np

import warpedfoam as wf
from warpedfoam.io.atomic import atomic_text

TABLE = Path(__file__).parent / "minimal_partitions.csv"
#: Closed forms (proved least for 2, 3, 4, 12), and lengths found by two independent computations (to 1e-8).
KNOWN = {
    2: 2.0 * np.pi, 3: 3.0 * np.pi, 4: 6.0 * np.arccos(-1.0 / 3.0), 5: 13.4303787743,
    6: 12.0 * np.arccos(1.0 / 3.0), 7: 16.35196950, 8: 17.69270805, 9: 18.85041320, 10: 19.99976253,
    12: 21.89182969, 14: 23.95812912, 20: 28.99917241,
}  # fmt: skip
SEED, BATCH, HOPS = 6, 15, 20
COLUMNS = (
    "n", "length", "known", "difference", "check", "group", "group_order", "sides",
    "starts", "failed", "reached", "hops", "seed", "residual", "seconds",
)  # fmt: skip


def search(n: int, folder: Path, most: int, spent: float) -> dict[str, object]:
    """The row of n; ``spent`` are the seconds that earlier runs took."""
    began = time.perf_counter()
    known = KNOWN.get(n)
    for starts in range(BATCH, most + 1, BATCH):
        found = wf.minimal_partition(
            wf.Sphere(1.0), n, seed=SEED, starts=starts, hops=HOPS, folder=folder / f"n{n}"
        )
        if known is not None and found.length < known + 1e-8:
            break
    seconds = time.perf_counter() - began + spent
    # films of the highest order in use anywhere: tells whether order 10 was enough
    fine = wf.relax(found.foam, order=16)
    threefold = (found.foam.network.vertex_degrees == 3).all()
    group = wf.point_group(found.foam) if threefold else None
    sides, counts = np.unique(found.foam.network.sides, return_counts=True)
    return {
        "n": n,
        "length": f"{found.length:.10f}",
        "known": "" if known is None else f"{known:.10f}",
        "difference": "" if known is None else f"{found.length - known:.1e}",
        "check": f"{fine.foam.film_lengths.sum() - found.length:.1e}" if fine.converged else "not converged",
        # two hemispheres and three lunes have markers, which are no part of their shape
        "group": group.name if group else {2: "Dinfh", 3: "D3h"}[n],
        "group_order": group.order if group else {2: "infinite", 3: 12}[n],
        "sides": " ".join(f"{s}^{c}" for s, c in zip(sides, counts, strict=True)),
        "starts": len(found.tries),
        "failed": sum(t.length is None for t in found.tries),
        "reached": found.n_reached,
        "hops": HOPS,
        "seed": SEED,
        "residual": f"{found.residual:.0e}",
        "seconds": f"{seconds:.0f}",
    }


def main(folder: str = "out/partitions", most: str = "60", *numbers: str) -> None:
    state = Path(folder)
    state.mkdir(parents=True, exist_ok=True)
    rows: dict[int, dict[str, object]] = {}
    if TABLE.exists():
        with TABLE.open(encoding="utf-8", newline="") as stream:
            rows = {int(row["n"]): dict(row) for row in csv.DictReader(stream)}
    for n in map(int, numbers) if numbers else (*range(2, 33), 72):
        spent = float(str(rows[n]["seconds"])) if n in rows and (state / f"n{n}").exists() else 0.0
        rows[n] = search(n, state, int(most), spent)
        print("  ".join(f"{k} {rows[n][k]}" for k in COLUMNS), flush=True)
        with atomic_text(TABLE) as stream:
            writer = csv.DictWriter(stream, COLUMNS, lineterminator="\n")
            writer.writeheader()
            writer.writerows(rows[k] for k in sorted(rows))


if __name__ == "__main__":
    main(*sys.argv[1:])
