"""Pages of the reference: every public name with its docstring, grouped by what it is for.

The groups follow the modules where things are defined, so that a new name finds its page by itself.
The pages are written to ``docs/reference`` before each build and are not kept in git.
"""

from __future__ import annotations

import inspect
import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from sphinx.application import Sphinx

#: Page, title, what it says first, and the modules that it covers; the first that fits takes a name.
TOPICS = (
    ("surfaces", "Surfaces and meshes", "What foams live on.", ("surfaces",)),
    ("foam", "Cells, networks, foams", "The types that everything else takes and gives.",
     ("cell", "network", "foam")),
    ("build", "Building foams", "From seeds to bubbles: Voronoi cells, distances on surfaces.",
     ("tessellate",)),
    ("relax", "Relaxing and moving", "To a minimum at fixed volumes, with T1s on the way.",
     ("relax", "moves", "energy")),
    ("one_bubble", "One bubble", "Films in three dimensions, potentials, geodesic circles.",
     ("studies.bubble", "studies.potential", "studies.geodesic_circle", "studies.drift")),
    ("clusters", "Open clusters", "A few bubbles in an otherwise empty cell.", ("studies.cluster",)),
    ("analysis", "Defects, order, statistics", "What a foam is like.", ("analysis",)),
    ("search", "Low energies", "Annealing, least partitions, repelling points.",
     ("studies.annealing", "studies.partition", "studies.thomson")),
    ("ensembles", "Ensembles", "Thousands of foams, one table.", ("studies.ensemble", "studies.study")),
    ("motion", "Motion", "Against friction on the plates: the viscous froth.", ("motion",)),
    ("studies", "More studies", "Everything else that is made of the parts above.", ("studies",)),
    ("files", "Files", "Written whole or not at all.", ("io",)),
    ("pictures", "Pictures and the viewer", "Matplotlib figures, and one HTML file with the foam in 3D.",
     ("plot", "view")),
    ("errors", "Errors", "What is raised when something is wrong.", ("errors",)),
    ("theory", "Formulas", "Pure functions of numbers or arrays, derived in {doc}`/theory`.", ("theory",)),
    ("other", "Everything else", "", ("",)),
)  # fmt: skip

#: Names that are no part of the front door, for pictures of the paper and for surfaces of one's own.
BESIDE = {
    "pictures": ("warpedfoam.plot", ()),
    "surfaces": ("warpedfoam.surfaces", ("Layer", "ArcTerms")),
}


def topic_of(item: object, name: str) -> str:
    """The page of a public thing."""
    module = name if inspect.ismodule(item) else getattr(item, "__module__", "")
    inner = module.removeprefix("warpedfoam.")
    for page, _, _, parts in TOPICS:
        if any(inner.startswith(part) for part in parts):
            return page
    raise AssertionError(f"no page takes {name}")


def grouped() -> dict[str, list[tuple[str, Any]]]:
    """Full names and things by page, in alphabetical order."""
    import warpedfoam

    found: dict[str, list[tuple[str, Any]]] = {page: [] for page, *_ in TOPICS}
    public = {f"warpedfoam.{name}": getattr(warpedfoam, name) for name in warpedfoam.__all__}
    for name, item in public.items():
        if inspect.ismodule(item):
            inside = getattr(item, "__all__", None) or [n for n in vars(item) if not n.startswith("_")]
            page = topic_of(item, name.removeprefix("warpedfoam."))
            found[page] += [(f"{name}.{part}", getattr(item, part)) for part in inside]
        else:
            found[topic_of(item, name)].append((name, item))
    known = {id(item) for items in found.values() for _, item in items}
    for page, (module_name, chosen) in BESIDE.items():
        module = __import__(module_name, fromlist=["x"])
        for name in chosen or module.__all__:
            if id(getattr(module, name)) not in known:
                found[page].append((f"{module_name}.{name}", getattr(module, name)))
    return {page: sorted(items, key=lambda pair: pair[0].lower()) for page, items in found.items() if items}


def entry(name: str, item: Any, seen: str) -> list[str]:
    """The directive for one thing, and where to see it at work."""
    if inspect.isclass(item):
        return [f".. autoclass:: {name}", "   :members:", "", seen, ""]
    if callable(item):
        return [f".. autofunction:: {name}", "", seen, ""]
    return [f".. autodata:: {name}", ""]


def uses(docs: Path) -> dict[str, list[str]]:
    """Public names, and pages and examples whose Python, which the tests run, has them as ``wf.name``."""
    texts = {}
    for page in [*docs.glob("*.md"), *docs.glob("begin/*.md"), *docs.glob("howto/*.md")]:
        text = page.read_text(encoding="utf-8")
        code = re.findall(r"^```python\n(.*?)^```$", text, re.MULTILINE | re.DOTALL)
        texts[f"/{page.relative_to(docs).with_suffix('').as_posix()}"] = "\n".join(code)
    for example in [*(docs.parent / "examples").glob("*.py"), *(docs.parent / "examples").glob("*.ipynb")]:
        texts[f"/gallery/{example.stem}"] = example.read_text(encoding="utf-8")
    found: dict[str, list[str]] = {}
    # how-tos first, then the guides and the gallery, the front page last
    for page in sorted(texts, key=lambda page: (page == "/index", "/howto/" not in page, page)):
        for name in sorted(set(re.findall(r"\bwf\.(\w+)", texts[page]))):
            found.setdefault(name, []).append(page)
    return found


def makers(public: dict[str, Any]) -> dict[str, list[str]]:
    """Types and the public functions that return them."""
    found: dict[str, list[str]] = {}
    for name, item in public.items():
        given = inspect.signature(item).return_annotation if inspect.isfunction(item) else None
        for kind in re.findall(r"\w+", given if isinstance(given, str) else ""):
            found.setdefault(kind, []).append(name)
    return found


def seen_at(name: str, item: Any, used: dict[str, list[str]], made: dict[str, list[str]]) -> str:
    """A line that leads to an example; empty if there is none."""
    said = []
    if inspect.isclass(item) and made.get(name):
        said.append("Made by " + ", ".join(f":py:obj:`{maker}`" for maker in made[name][:4]) + ".")
    if used.get(name):
        said.append("Used in " + ", ".join(f":doc:`{page}`" for page in used[name][:4]) + ".")
    return " ".join(said)


def pages(docs: Path) -> dict[str, str]:
    """File names and texts."""
    import warpedfoam

    titles = {page: (title, intro) for page, title, intro, _ in TOPICS}
    groups = grouped()
    used = uses(docs)
    made = makers({name: getattr(warpedfoam, name) for name in warpedfoam.__all__})
    out = {}
    for page, items in groups.items():
        title, intro = titles[page]
        intro = re.sub(r"{doc}`([^`]+)`", r":doc:`\1`", intro)
        lines = [title, "=" * len(title), "", intro, "", ".. autosummary::", "   :nosignatures:", ""]
        lines += [f"   {name}" for name, _ in items] + [""]
        for name, item in items:
            lines += entry(name, item, seen_at(name.rpartition(".")[2], item, used, made))
        out[f"{page}.rst"] = "\n".join(lines)
    index = [
        "Reference",
        "=========",
        "",
        "Every public name, by topic. ``import warpedfoam as wf`` has them",
    ]
    index += ["all but for those whose full name says where else they live.", "", ".. toctree::"]
    index += ["   :maxdepth: 1", "   :hidden:", "", *(f"   {page}" for page in groups), ""]
    for page, items in groups.items():
        names = ", ".join(f":py:obj:`~{name}`" for name, _ in items)
        index += [f":doc:`{page}`", f"   {names}", ""]
    out["index.rst"] = "\n".join([*index, ""])
    return out


def write_if_changed(path: Path, text: str) -> None:
    """Leave unchanged pages alone, so that a second build is quick."""
    if not path.exists() or path.read_text(encoding="utf-8") != text:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")


def write_pages(app: Sphinx) -> None:
    """Write the reference where Sphinx will look for it."""
    folder = Path(app.srcdir) / "reference"
    texts = pages(Path(app.srcdir))
    for path in folder.glob("*.rst"):
        if path.name not in texts:
            path.unlink()
    for name, text in texts.items():
        write_if_changed(folder / name, text)


def bars_are_bars(
    _app: Sphinx, _what: str, _name: str, _obj: object, _options: object, lines: list[str]
) -> None:
    """|x| means a norm, never a substitution of reStructuredText; literals stay as they are."""
    for k, line in enumerate(lines):
        if "|" in line and not line.lstrip().startswith((">>>", "...", "| ")):
            parts = re.split(r"(``.*?``|:\w+:`.*?`)", line)
            lines[k] = "".join(p if j % 2 else p.replace("|", r"\|") for j, p in enumerate(parts))


def setup(app: Sphinx) -> dict[str, bool]:
    """Connect to Sphinx."""
    app.connect("builder-inited", write_pages)
    # after numpydoc, whose priority is 500
    app.connect("autodoc-process-docstring", bars_are_bars, priority=600)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
