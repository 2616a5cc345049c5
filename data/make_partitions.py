"""Least partitions of the unit sphere into n equal areas: searches, and writes minimal_partitions.csv.

    python data/make_partitions.py [STATE_FOLDER] [STARTS] [N ...]

60 starts for each of n = 2 … 32 and 72 by default, whether or not a known length is met on the way; one to
two hours on one core. The state is kept in the folder after every start: a run that was stopped goes on, and
a later one may make more starts. Rows are gathered in the folder's `rows.csv`; the table is written from it
once all n are there, so that all its rows come from one run.
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
SEED, HOPS = 6, 20
NUMBERS = (*range(2, 33), 72)
COLUMNS = (
    "n", "length", "known", "difference", "check", "group", "group_order", "sides",
    "starts", "failed", "reached", "hops", "seed", "residual", "seconds",
)  # fmt: skip


def search(n: int, folder: Path, starts: int) -> dict[str, object]:
    """The row of n; seconds are those of the processor, earlier runs of this search included."""
    state = folder / f"n{n}"
    clock = state / "seconds.txt"
    spent = float(clock.read_text(encoding="utf-8")) if clock.exists() else 0.0
    began = time.process_time()

    def keep(stage: str, fraction: float) -> None:
        clock.write_text(f"{spent + time.process_time() - began:.1f}", encoding="utf-8")

    known = KNOWN.get(n)
    found = wf.minimal_partition(
        wf.Sphere(1.0), n, seed=SEED, starts=starts, hops=HOPS, folder=state, progress=keep
    )
    seconds = spent + time.process_time() - began
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


def read(path: Path) -> dict[int, dict[str, object]]:
    """Rows by n."""
    if not path.exists():
        return {}
    with path.open(encoding="utf-8", newline="") as stream:
        return {int(row["n"]): dict(row) for row in csv.DictReader(stream)}


def write(path: Path, rows: dict[int, dict[str, object]]) -> None:
    with atomic_text(path) as stream:
        writer = csv.DictWriter(stream, COLUMNS, lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows[k] for k in sorted(rows))


def main(folder: str = "out/partitions", starts: str = "60", *numbers: str) -> None:
    state = Path(folder)
    state.mkdir(parents=True, exist_ok=True)
    for n in map(int, numbers) if numbers else NUMBERS:
        row = search(n, state, int(starts))
        print("  ".join(f"{k} {row[k]}" for k in COLUMNS), flush=True)
        rows = {**read(state / "rows.csv"), n: row}
        write(state / "rows.csv", rows)
        if {*NUMBERS} <= {*rows}:
            write(TABLE, rows)


if __name__ == "__main__":
    main(*sys.argv[1:])
