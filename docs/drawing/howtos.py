"""Pictures of the how-tos (docs/pictures/howto_*.png): what the Python of each page itself saves."""

from __future__ import annotations

import contextlib
import io
import os
import re
import shutil
import tempfile
from pathlib import Path

#: The file that a page's code saves, and what is finer in the picture than in the text.
PICTURES = {
    "own_mesh": ("thing.png", ()),
    "polydisperse": ("sides.png", ()),
    "cluster_potential": ("cluster_potential.png", (("180.0, 3)", "180.0, 9)"),)),
}


def draw(name: str, docs: Path) -> None:
    """Run all blocks of a page in a folder of its own and keep the picture."""
    picture, finer = PICTURES[name]
    text = (docs / "howto" / f"{name}.md").read_text(encoding="utf-8")
    code = "\n".join(re.findall(r"^```python\n(.*?)^```$", text, re.MULTILINE | re.DOTALL))
    for old, new in finer:
        if old not in code:
            raise ValueError(f"{name}.md no longer says {old!r}")
        code = code.replace(old, new)
    here = Path.cwd()
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        try:
            with contextlib.redirect_stdout(io.StringIO()):
                exec(compile(code, f"{name}.md", "exec"), {"__name__": "__main__"})
        finally:
            os.chdir(here)
        shutil.copyfile(Path(folder) / picture, docs / "pictures" / f"howto_{name}.png")
