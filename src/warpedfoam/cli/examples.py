"""Examples of every command, shown at the end of its help."""

from __future__ import annotations

from collections.abc import Mapping

#: By command: what one would type.
EXAMPLES: Mapping[str, tuple[str, ...]] = {
    "": (
        "warpedfoam foam sphere -n 500 --radius 10 --gap 0.5 --seed 1 -o out/",
        "warpedfoam view out/foam.npz",
    ),
    "run": (
        "warpedfoam run examples/foam.toml -o out/",
        "warpedfoam run examples/foam.toml --set foam.n_bubbles=500 --seed 7 --json",
    ),
    "foam": (
        "warpedfoam foam torus -n 200 -o out/",
        "warpedfoam foam data/double_torus.ply -n 300 --gap 0.3 -o out/",
    ),
    "potential": (
        "warpedfoam potential torus --volume 0.5 --method theory -o out/",
        "warpedfoam potential torus --volume 0.5 --method theory,ruled --along 19 -o out/",
    ),
    "relax": (
        "warpedfoam relax out/foam.npz --order 8 -o relaxed/",
        "warpedfoam relax out/foam.npz --layers 4 --no-t1 -o bulging/",
    ),
    "cluster": (
        "warpedfoam cluster torus -n 7 --volume 0.5 -o cluster/",
        "warpedfoam cluster torus -n 19 --potential --places 13 -o potential/",
    ),
    "drift": (
        "warpedfoam drift out/foam.npz --duration 10 -o drift/",
        "warpedfoam drift drift/drift.h5 --frame 0 --duration 20 --yield-friction 0.01 --animation -o slow/",
    ),
    "coarsen": (
        "warpedfoam coarsen out/foam.npz --until 100 -o coarse/",
        "warpedfoam coarsen out/foam.npz --duration 5 --every 0.1 --vanish 0.001 -o coarse/",
    ),
    "plot": (
        "warpedfoam plot out/foam.npz --color-by pressure -o foam.pdf --width 86",
        "warpedfoam plot out/foam.npz --kind map --projection hammer --outline -o map.svg",
        "warpedfoam plot out/foam.npz --kind histogram --of film_length -o lengths.png",
    ),
    "figures": ("warpedfoam figures paper -o figs/", "warpedfoam figures paper --only torus --layers 3"),
    "check": (
        "warpedfoam check data/double_torus.ply --gap 0.3 -n 300",
        "warpedfoam check scan.stl --repair mended.ply",
        "warpedfoam check scan.stl --repair mended.ply --close-holes 20",
    ),
    "defects": ("warpedfoam defects out/foam.npz", "warpedfoam defects out/foam.npz --json --no-picture"),
    "convert": (
        "warpedfoam convert out/foam.npz foam.vtp foam.glb",
        "warpedfoam convert run.h5 last.npz --frame -1",
    ),
    "info": ("warpedfoam info out/foam.npz", "warpedfoam info run.h5 --frame 0 --json"),
    "view": (
        "warpedfoam view out/foam.npz",
        "warpedfoam view a.npz b.npz -o film.html --color-by pressure",
    ),
    "ensemble": (
        "warpedfoam ensemble examples/tori.toml -o tori/",
        "warpedfoam ensemble examples/tori.toml --workers 4 --set repeats=10 --quiet",
    ),
    "partition": ("warpedfoam partition sphere -n 12 --size radius=1 --seed 3 -o out/",),
}


def epilog(name: str, *more: str) -> str:
    """The end of the help of a command; ``more`` lines instead of those of the table.

    Examples
    --------
    >>> epilog("info").splitlines()[2]
    'warpedfoam info out/foam.npz'
    """
    return "\n\n".join(["Examples:", *(more or EXAMPLES[name])])
