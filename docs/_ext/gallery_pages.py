"""Pages of the gallery: one for each file of examples/, with its source, output and picture.

Nothing is run here. Pictures and output are in ``docs/pictures``, drawn by ``python3 run.py gallery``; the
tests run every example and check its numbers. The pages are written to ``docs/gallery`` before each build
and are not kept in git.
"""

from __future__ import annotations

import ast
import json
import re
from pathlib import Path
from typing import TYPE_CHECKING

from reference_pages import write_if_changed

if TYPE_CHECKING:
    from sphinx.application import Sphinx

ROOT = Path(__file__).resolve().parents[2]
EXAMPLES, PICTURES = ROOT / "examples", ROOT / "docs" / "pictures"


def title_and_text(path: Path) -> tuple[str, str]:
    """What an example says of itself: the first line, and the rest."""
    if path.suffix == ".py":
        said = ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))) or path.stem
        first, _, rest = said.partition("\n")
        title = re.split(r":\s", first, maxsplit=1)[0].rstrip(".")
        text = first[len(title) :].lstrip(": ").strip()
        return title, (text[:1].upper() + text[1:] + "\n" if text else "") + rest
    if path.suffix == ".ipynb":
        first = "".join(json.loads(path.read_text(encoding="utf-8"))["cells"][0]["source"])
        title, _, rest = first.partition("\n")
        return title.lstrip("# "), rest
    head = []
    for line in path.read_text(encoding="utf-8").splitlines():
        if not line.startswith("#"):
            break
        head.append(line.lstrip("# "))
    command, text = head[0], " ".join(head[1:])
    study = path.stem.replace("schwarz_p", "Schwarz's P").replace("_", " ")
    title = "Every option of the main job" if path.stem == "foam" else f"Study: {study}"
    return title, f"{text}\n\n    {command}\n"


def prose(text: str) -> str:
    """A docstring's text as Markdown: its indented blocks are code, its double backticks single."""
    return re.sub(r"``([^`]+)``", r"`\1`", text.strip())


def page_of(path: Path) -> str:
    """One page."""
    title, text = title_and_text(path)
    lines = [f"# {title}", ""]
    picture = PICTURES / f"example_{path.stem}.png"
    if path.suffix == ".ipynb":
        lines += [f"The notebook {{download}}`{path.name} <../../examples/{path.name}>`.", ""]
        cells = json.loads(path.read_text(encoding="utf-8"))["cells"]
        for k, cell in enumerate(cells):
            source = "".join(cell["source"])
            if cell["cell_type"] == "markdown":
                lines += [source.partition("\n")[2] if k == 0 else source, ""]
                continue
            lines += ["```python", source, "```", ""]
            shown = PICTURES / f"example_{path.stem}_{k}.png"
            if shown.exists():
                lines += [f"![What the cell shows](../pictures/{shown.name})", ""]
        return "\n".join(lines)
    lines += [prose(text), ""]
    if picture.exists():  # a test asks for it
        lines += [f"![{title}](../pictures/{picture.name})", ""]
    said = picture.with_suffix(".txt")
    if said.exists():
        lines += ["It prints", "", "```text", said.read_text(encoding="utf-8").rstrip(), "```", ""]
    language = "python" if path.suffix == ".py" else "toml"
    lines += [f"## {path.name}", "", f"{{download}}`Download <../../examples/{path.name}>`", ""]
    lines += [f"```{{literalinclude}} ../../examples/{path.name}", f":language: {language}", "```", ""]
    return "\n".join(lines)


def thumbnail(path: Path) -> str | None:
    """The picture of an example's card: its own, or the first of a notebook."""
    found = sorted(PICTURES.glob(f"example_{path.stem}.png")) or sorted(
        PICTURES.glob(f"example_{path.stem}_*.png"), key=lambda p: int(p.stem.rsplit("_", 1)[1])
    )
    return found[0].name if found else None


def examples() -> list[Path]:
    """The files of examples/ in the gallery's order: the notebook, scripts by number, TOML files."""
    order = {".ipynb": 0, ".py": 1, ".toml": 2}
    files = [p for p in EXAMPLES.iterdir() if p.suffix in order]
    return sorted(files, key=lambda p: (order[p.suffix], p.name))


def page_name(path: Path) -> str:
    """Name of an example's page; a script and a study may have the same stem."""
    return path.stem + ("_study" if path.suffix == ".toml" else "")


def pages() -> dict[str, str]:
    """File names and texts."""
    out = {f"{page_name(path)}.md": page_of(path) for path in examples()}
    cards = [
        "# Gallery",
        "",
        "The files of `examples/`: each runs as it is, and the tests check its numbers.",
    ]
    cards += ["", "::::{grid} 1 2 3 3", ":gutter: 3", ""]
    for path in examples():
        cards += [f":::{{grid-item-card}} {title_and_text(path)[0]}"]
        cards += [f":link: {page_name(path)}", ":link-type: doc"]
        if thumbnail(path):
            cards.append(f":img-bottom: ../pictures/{thumbnail(path)}")
        cards += [":::", ""]
    cards += ["::::", "", "```{toctree}", ":hidden:", ""]
    cards += [page_name(path) for path in examples()]
    out["index.md"] = "\n".join([*cards, "```", ""])
    return out


def write_pages(app: Sphinx) -> None:
    """Write the gallery where Sphinx will look for it."""
    folder = Path(app.srcdir) / "gallery"
    texts = pages()
    for path in folder.glob("*.md"):
        if path.name not in texts:
            path.unlink()
    for name, text in texts.items():
        write_if_changed(folder / name, text)


def setup(app: Sphinx) -> dict[str, bool]:
    """Connect to Sphinx."""
    app.connect("builder-inited", write_pages)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
