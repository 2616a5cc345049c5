"""The cell network as a graph for other programs: GraphML and node-link JSON."""

from __future__ import annotations

import io
import json
from pathlib import Path
from typing import TYPE_CHECKING

from warpedfoam.arrays import as_choice, as_instance
from warpedfoam.foam import Foam
from warpedfoam.io.atomic import PathLike, atomic_binary, atomic_text, writable_path

if TYPE_CHECKING:
    import networkx as nx

GRAPHS = ("bubbles", "films")


def write_graphml(path: PathLike, foam: Foam, *, graph: str = "bubbles") -> Path:
    """Write a multigraph of the foam as GraphML (networkx, Gephi, igraph, Cytoscape).

    ``"bubbles"``: a node per bubble with ``bubble`` (its id), ``sides``, ``charge``, ``area``,
    ``volume``, ``x``, ``y``, ``z`` (its centre) and ``pressure``; an edge per film with ``film`` and
    ``length``.
    ``"films"``: a node per vertex with ``degree``, ``x``, ``y``, ``z``; an edge per film with ``film``,
    ``left``, ``right`` (places of the bubbles) and ``length``. Two nodes may share several edges.

    Parameters
    ----------
    path : str or path
        Ends in ``.graphml``.
    foam : Foam
    graph : {"bubbles", "films"}, optional

    Returns
    -------
    pathlib.Path
        The file written.

    Raises
    ------
    TypeError, ValueError
        Arguments of the wrong type or unknown, a name that does not end in ``.graphml``.
    FileNotFoundError, IsADirectoryError
        If the path cannot be written.
    """
    import networkx as nx

    target = writable_path(path, suffixes=(".graphml",))
    network = _graph(foam, graph)
    buffer = io.BytesIO()
    nx.write_graphml_xml(network, buffer)
    with atomic_binary(target) as stream:
        stream.write(buffer.getvalue())
    return target


def write_graph_json(path: PathLike, foam: Foam, *, graph: str = "bubbles") -> Path:
    """Write the multigraph of `write_graphml` as node-link JSON (networkx, D3).

    An object with ``nodes`` (``id`` is the place, ``bubble`` the bubble's id) and ``edges``
    (``source``, ``target``, ``key``: the film).

    Parameters
    ----------
    path : str or path
        Ends in ``.json``.
    foam : Foam
    graph : {"bubbles", "films"}, optional

    Returns
    -------
    pathlib.Path
        The file written.

    Raises
    ------
    TypeError, ValueError, OSError
        As `write_graphml`; a name that does not end in ``.json``.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> from warpedfoam import Foam, HeleShawCell, Sphere
    >>> points = [[1, 1, 1], [-1, -1, 1], [-1, 1, -1], [1, -1, -1]]
    >>> loops = [(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)]
    >>> foam = Foam.from_loops(HeleShawCell(Sphere(1.0), gap=0.01), points, loops)
    >>> folder = tempfile.TemporaryDirectory()
    >>> told = json.loads(write_graph_json(pathlib.Path(folder.name) / "net.json", foam).read_text())
    >>> len(told["nodes"]), len(told["edges"]), told["multigraph"]
    (4, 6, True)
    >>> folder.cleanup()
    """
    import networkx as nx

    target = writable_path(path, suffixes=(".json",))
    told = nx.node_link_data(_graph(foam, graph), edges="edges", nodes="nodes")
    with atomic_text(target) as stream:
        stream.write(json.dumps(told, allow_nan=False) + "\n")
    return target


def _graph(foam: Foam, graph: str) -> nx.MultiGraph:
    as_instance(foam, "foam", Foam)
    if as_choice(graph, "graph", GRAPHS) == "bubbles":
        return foam.to_networkx()
    out = foam.network.film_graph()
    for axis, values in zip("xyz", foam.vertex_points.T.tolist(), strict=True):
        for node, value in enumerate(values):
            out.nodes[node][axis] = value
    lengths = foam.film_lengths.tolist()
    for _, _, film, data in out.edges(keys=True, data=True):
        data["length"] = lengths[film]
    return out
