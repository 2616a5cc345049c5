"""``warpedfoam ensemble``: the runs of a study, and a few lines about how they went."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from warpedfoam.cli.progress import Progress
from warpedfoam.studies import read_study, run_ensemble


def run_file(
    file: str,
    out: str,
    sets: Iterable[str],
    *,
    workers: int | None,
    scheduler: str | None,
    progress: Progress,
) -> dict[str, Any]:
    """Run the study of a TOML file into a folder and return its record, without versions.

    Raises
    ------
    ValueError, OSError, ModuleNotFoundError
        As `warpedfoam.read_study` and `warpedfoam.run_ensemble`.
    """
    study = read_study(file, sets)
    done = run_ensemble(study, out, workers=workers, scheduler=scheduler, progress=progress)
    record = {k: v for k, v in done.record.items() if k not in ("versions", "environments")}
    reasons = [reason for reason in done.columns["reason"] if reason]
    return {
        **record,
        "environments": len(done.record["environments"]),
        "columns": len(done.columns),
        "first_reason": reasons[0] if reasons else None,
    }


def ensemble_text(facts: Mapping[str, Any]) -> str:
    """A few lines for a reader."""
    counts = ", ".join(f"{n} {state.replace('_', ' ')}" for state, n in facts["counts"].items() if n)
    seconds = facts["processor_seconds"]
    each = seconds / max(facts["runs"] - facts["counts"]["lost"], 1)
    lines = [
        f"runs      {facts['runs']}: {counts}; {facts['computed_now']} of them computed now",
        f"time      {facts['clock_seconds']:.1f} s now; processors {seconds:.1f} s, {each:.2f} s a run",
        f"table     {facts['columns']} columns",
        f"written   {', '.join(facts['outputs'])}",
    ]
    if facts["environments"] > 1:
        lines.append(f"note      {facts['environments']} kinds of machine took part: last digits may differ")
    return "\n".join(lines)
