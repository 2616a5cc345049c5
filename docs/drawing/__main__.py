"""Draw the pictures of the documentation anew: ``python3 run.py gallery [NAMES or GROUPS]``.

Groups are concepts, examples, howtos, guides and accuracy; names are those of the files. Without arguments
everything is drawn, which takes some minutes. The accuracy plots come from the tables in benchmarks/data,
which the benchmarks write; nothing is measured here.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

import accuracy
import concepts
import examples
import guides
import howtos
from PIL import Image

WIDEST = 1000
DOCS = Path(__file__).resolve().parents[1]


def jobs() -> dict[str, dict[str, Callable[[], None]]]:
    """What draws each picture, by group and name."""
    return {
        "concepts": {
            f"concept_{name}": partial(concepts.draw, DOCS / "pictures", [name]) for name in concepts.PICTURES
        },
        "examples": {f"example_{name}": draw for name, draw in examples.PICTURES.items()},
        "howtos": {f"howto_{name}": partial(howtos.draw, name, DOCS) for name in howtos.PICTURES},
        "guides": {name: partial(draw, DOCS / f"{name}.png") for name, draw in guides.PICTURES.items()},
        "accuracy": {name: partial(draw, DOCS / f"{name}.png") for name, draw in accuracy.PICTURES.items()},
    }


def lighten(since: float) -> None:
    """Pictures drawn since then, at most 1000 pixels wide and in 256 colours: a quarter of the size."""
    for path in [*DOCS.glob("*.png"), *DOCS.glob("pictures/*.png")]:
        if path.stat().st_mtime >= since:
            with Image.open(path) as found:
                picture = found.convert("RGB")
            if picture.width > WIDEST:
                height = round(picture.height * WIDEST / picture.width)
                picture = picture.resize((WIDEST, height), Image.Resampling.LANCZOS)
            # the way that keeps rare colours, such as those of charges, to a few parts in 255
            rare = Image.Quantize.MAXCOVERAGE
            few = picture.quantize(256, method=rare, kmeans=3, dither=Image.Dither.NONE)
            few.save(path, optimize=True)


def main(wanted: list[str]) -> int:
    """Draw; 2 if a name is unknown."""
    groups = jobs()
    every = {name: draw for group in groups.values() for name, draw in group.items()}
    unknown = [name for name in wanted if name not in groups and name not in every]
    if unknown or wanted[:1] in (["-h"], ["--help"]):
        print(__doc__)
        for group, names in groups.items():
            print(f"{group}: {', '.join(names)}")
        return 0 if wanted[:1] in (["-h"], ["--help"]) else 2
    chosen = {
        name
        for group, names in groups.items()
        for name in names
        if not wanted or group in wanted or name in wanted
    }
    for name in [n for n in every if n in chosen]:
        begin, now = time.perf_counter(), time.time()
        every[name]()
        lighten(now - 1.0)
        print(f"{name}: {time.perf_counter() - begin:.1f} s", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
