"""Progress on a terminal: one bar per stage, with the time left; nothing in a pipe."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager

Progress = Callable[[str, float], None]


def silent(stage: str, fraction: float) -> None:
    """Report nothing."""


@contextmanager
def progress_bars(*, quiet: bool = False) -> Iterator[Progress]:
    """Give a callback ``(stage, fraction)`` that draws on stderr while the block runs.

    Parameters
    ----------
    quiet : bool, optional
        Draw nothing even on a terminal.

    Yields
    ------
    callable
        To be called with the stage's name and the fraction done, 0 … 1, as often as wanted.

    Examples
    --------
    >>> with progress_bars(quiet=True) as report:
    ...     report("relax", 0.5)
    """
    if quiet or not sys.stderr.isatty():
        yield silent
        return
    from rich.console import Console
    from rich.progress import BarColumn, TaskID, TextColumn, TimeElapsedColumn, TimeRemainingColumn
    from rich.progress import Progress as Bars

    columns = (
        TextColumn("{task.description:<12}"),
        BarColumn(),
        TextColumn("{task.percentage:>3.0f} %"),
        TimeElapsedColumn(),
        TextColumn("left"),
        TimeRemainingColumn(),
    )
    with Bars(*columns, console=Console(stderr=True), transient=True) as bars:
        tasks: dict[str, TaskID] = {}
        furthest: dict[str, float] = {}

        def report(stage: str, fraction: float) -> None:
            if stage not in tasks:
                for earlier in tasks.values():
                    bars.update(earlier, completed=1.0)
                tasks[stage] = bars.add_task(stage, total=1.0)
            # a relaxation may lose ground for a while; a bar that runs back helps nobody
            furthest[stage] = max(furthest.get(stage, 0.0), min(fraction, 1.0))
            bars.update(tasks[stage], completed=furthest[stage])

        yield report
