"""The commands ``drift`` and ``coarsen``; they hand their arguments to modules of their own."""

from __future__ import annotations

from typing import Annotated

import typer

from warpedfoam.cli.ending import NOT_CONVERGED, answer, ending_well, say, signals
from warpedfoam.cli.examples import epilog
from warpedfoam.cli.flags import Color, Debug, FoamFile, Folder, Frame, Json, Picture, Quiet
from warpedfoam.cli.progress import progress_bars

motion_verbs = typer.Typer()


@motion_verbs.command(epilog=epilog("drift"))
def drift(
    file: FoamFile,
    duration: Annotated[float, typer.Option("--duration", help="Time to cover.")],
    friction: Annotated[
        float, typer.Option("--friction", help="Friction of the films, force per area and velocity.")
    ] = 1.0,
    yield_friction: Annotated[
        float, typer.Option("--yield-friction", help="Force per area below which films stay where they are.")
    ] = 0.0,
    every: Annotated[
        float | None, typer.Option("--every", help="Time between frames; a fiftieth if left out.")
    ] = None,
    hold_volumes: Annotated[
        bool, typer.Option("--hold-volumes/--no-pressure", help="Or grain growth, without any pressure.")
    ] = True,
    tolerance: Annotated[
        float, typer.Option("--tolerance", help="Error of a time step, in bubble sizes.")
    ] = 1e-3,
    step: Annotated[
        float | None, typer.Option("--step", help="A fixed time step in place of adaptive ones.")
    ] = None,
    order: Annotated[
        int | None, typer.Option("--order", help="Polynomial order of the films; the foam's if left out.")
    ] = None,
    t1: Annotated[bool, typer.Option("--t1/--no-t1", help="Let films turn (T1) on the way.")] = True,
    frame: Frame = -1,
    resume: Annotated[bool, typer.Option("--resume", help="Go on where an earlier run was stopped.")] = False,
    out: Folder = "out",
    picture: Picture = True,
    animation: Annotated[bool, typer.Option("--animation", help="Write an animation too (GIF).")] = False,
    color_by: Color = "charge",
    as_json: Json = False,
    quiet: Quiet = False,
    debug: Debug = False,
) -> None:
    """Let a foam drift against friction: its films move, bubbles and clusters follow the curvature."""
    with ending_well(debug), signals():
        from warpedfoam.cli import drifting as job

        options = {
            "friction": friction,
            "duration": duration,
            "every": every,
            "yield_friction": yield_friction,
            "hold_volumes": hold_volumes,
            "tolerance": tolerance,
            "step": step,
            "order": order,
            "t1": t1,
        }
        with progress_bars(quiet=quiet) as report:
            facts = job.drift_file(
                file,
                frame=frame,
                out=out,
                options=options,
                resume=resume,
                picture=picture,
                animation=animation,
                color_by=color_by,
                progress=report,
            )
        answer(facts, lambda: job.summary_text(facts), as_json=as_json, quiet=quiet)
    if not facts["completed"]:
        say(f"did not get to the end: {facts['message']}; the results are marked as such")
        raise typer.Exit(NOT_CONVERGED)


@motion_verbs.command(epilog=epilog("coarsen"))
def coarsen(
    file: FoamFile,
    duration: Annotated[float | None, typer.Option("--duration", help="Time to cover.")] = None,
    until: Annotated[
        int | None, typer.Option("--until", help="End when no more bubbles than this are left.")
    ] = None,
    permeability: Annotated[
        float,
        typer.Option("--permeability", help="Of the films: volume of gas per time, area and pressure."),
    ] = 1.0,
    every: Annotated[
        float | None,
        typer.Option("--every", help="Time between frames; a fiftieth of the duration if left out."),
    ] = None,
    tolerance: Annotated[
        float, typer.Option("--tolerance", help="Error of a time step, in mean volumes.")
    ] = 0.01,
    step: Annotated[
        float | None, typer.Option("--step", help="A fixed time step in place of adaptive ones.")
    ] = None,
    vanish: Annotated[
        float, typer.Option("--vanish", help="Bubbles below this many mean volumes vanish.")
    ] = 0.003,
    order: Annotated[
        int | None, typer.Option("--order", help="Polynomial order of the films; the foam's if left out.")
    ] = None,
    frame: Frame = -1,
    resume: Annotated[bool, typer.Option("--resume", help="Go on where an earlier run was stopped.")] = False,
    out: Folder = "out",
    picture: Picture = True,
    as_json: Json = False,
    quiet: Quiet = False,
    debug: Debug = False,
) -> None:
    """Let a foam coarsen: gas passes through its films, large bubbles grow, small ones vanish."""
    with ending_well(debug), signals():
        from warpedfoam.cli import coarsening as job

        options = {
            "duration": duration,
            "until": until,
            "permeability": permeability,
            "every": every,
            "tolerance": tolerance,
            "step": step,
            "vanish": vanish,
            "order": order,
        }
        with progress_bars(quiet=quiet) as report:
            facts = job.coarsen_file(
                file,
                frame=frame,
                out=out,
                options=options,
                resume=resume,
                picture=picture,
                progress=report,
            )
        answer(facts, lambda: job.summary_text(facts), as_json=as_json, quiet=quiet)
    if not facts["completed"]:
        say(f"did not get to the end: {facts['message']}; the results are marked as such")
        raise typer.Exit(NOT_CONVERGED)
