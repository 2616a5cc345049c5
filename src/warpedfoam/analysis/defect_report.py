"""What `warpedfoam.defects` returns: tables of disclinations, clusters and dislocations, and their graph."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from warpedfoam.arrays import Bools, Floats, Ints
from warpedfoam.network import CellNetwork

if TYPE_CHECKING:
    import networkx as nx

#: What a cluster of charged bubbles can be; see `Clusters`.
KINDS = (
    "disclination",
    "dislocation",
    "scar",
    "pleat",
    "vacancy",
    "interstitial",
    "neutral",
    "aggregate",
    "network",
    "rim",
)


@dataclass(frozen=True, eq=False)
class Disclinations:
    """Every charged bubble, in the order of the bubbles; arrays of k rows.

    Attributes
    ----------
    bubble, id : (k,) integer arrays
        Its place in the foam and its persistent id.
    sides, charge : (k,) integer arrays
        n, and q = 6 − n (at a wall: 6 − films − 2 per wall).
    cluster : (k,) integer array
        Row of `Clusters`.
    position : (k, 3) array
        The bubble's centre.
    rim : (k,) array of bool
        It touches a wall or the exterior of a cluster: order ends there.
    ambiguous : (k,) array of bool
        A film round it is tiny, and a T1 on that film would change its charge.
    """

    bubble: Ints
    id: Ints
    sides: Ints
    charge: Ints
    cluster: Ints
    position: Floats
    rim: Bools
    ambiguous: Bools


@dataclass(frozen=True, eq=False)
class Clusters:
    """Connected sets of charged bubbles, by their first bubble; arrays of k rows.

    Attributes
    ----------
    kind : (k,) array of str
        ``disclination``: one bubble. ``dislocation``: a disk of charge 0 with a Burgers vector and one
        5–7 pair. ``pleat``: the same with more pairs. ``scar``: charge ±1 and at least one pair.
        ``vacancy``, ``interstitial``: charge 0, no Burgers vector, and bubbles are missing or to spare.
        ``neutral``: nothing of that remains. ``aggregate``: any other disk. ``network``: no disk (it
        winds round the surface, encloses other defects, or covers all). ``rim``: it touches a rim.
    size, charge, pairs : (k,) integer arrays
        Number of bubbles, net charge Q, and 5–7 pairs beyond it, (Σ|q| − |Q|)/2.
    has_burgers : (k,) array of bool
        True for disks of charge 0 off the rims; the next four are 0 elsewhere.
    burgers : (k, 3) array
        Burgers vector in the tangent plane at ``position``, in lattice spacings.
    burgers_squared : (k,) integer array
        Its square, exactly: 1, 3, 4, 7, …
    frame_fit : (k,) array
        How well films round the cluster run along the lattice's directions: 1 perfectly.
    missing : (k,) integer array
        Bubbles that a perfect lattice would have more in the cluster's place; 0 where the Burgers vector
        is not.
    position : (k, 3) array
        Middle of the cluster, on the surface.
    gyration : (k,) array
        Root mean square distance of its centres from their mean, in lattice spacings.
    ambiguous : (k,) array of bool
        One of its bubbles is.
    """

    kind: NDArray[np.str_]
    size: Ints
    charge: Ints
    pairs: Ints
    has_burgers: Bools
    burgers: Floats
    burgers_squared: Ints
    frame_fit: Floats
    missing: Ints
    position: Floats
    gyration: Floats
    ambiguous: Bools


@dataclass(frozen=True, eq=False)
class Dislocations:
    """Charges of opposite sign that pair across a film; arrays of k rows.

    Attributes
    ----------
    positive, negative : (k,) integer arrays
        The two bubbles.
    film : (k,) integer array
        The longest film between them.
    multiplicity : (k,) integer array
        Unit charges that pair: 1 for a five and a seven.
    cluster : (k,) integer array
        Row of `Clusters`.
    position : (k, 3) array
        Middle of the film.
    burgers : (k, 3) array
        In the tangent plane at ``position``, in lattice spacings.
    transported : (k,) array of bool
        True if a lattice frame was taken round the two bubbles, which their charges must allow (they
        add up to 0); else the Burgers vector is the normal times the step from positive to negative.
    ambiguous : (k,) array of bool
        One of the two bubbles is.
    """

    positive: Ints
    negative: Ints
    film: Ints
    multiplicity: Ints
    cluster: Ints
    position: Floats
    burgers: Floats
    transported: Bools
    ambiguous: Bools


@dataclass(frozen=True, eq=False)
class DefectReport:
    """What `defects` finds.

    Attributes
    ----------
    network : CellNetwork
    spacing : float
        a = sqrt(2 A / (√3 N)), the distance of neighbours in a honeycomb of bubbles of the mean area.
    disclinations : Disclinations
    clusters : Clusters
    dislocations : Dislocations
    cluster_of : (n_bubbles,) integer array
        Row of ``clusters``, −1 for bubbles without charge.
    tiny_films : (k,) integer array
        Films shorter than ``tiny`` bubble sizes.
    tiny : float
        That threshold.
    """

    network: CellNetwork
    spacing: float
    disclinations: Disclinations
    clusters: Clusters
    dislocations: Dislocations
    cluster_of: Ints
    tiny_films: Ints
    tiny: float

    @property
    def total_charge(self) -> int:
        """Σ q over all bubbles; 6 χ on a closed surface."""
        return int(self.disclinations.charge.sum())

    @property
    def kinds(self) -> dict[str, int]:
        """Number of clusters of each kind, all of `KINDS`."""
        return {name: int((self.clusters.kind == name).sum()) for name in KINDS}

    @property
    def summary(self) -> dict[str, Any]:
        """The counts, as plain numbers."""
        charge = self.disclinations.charge
        values, counts = np.unique(charge, return_counts=True)
        return {
            "bubbles": self.network.n_bubbles,
            "total_charge": self.total_charge,
            "charged_bubbles": len(charge),
            "charges": dict(zip(map(str, values.tolist()), counts.tolist(), strict=True)),
            "excess_pairs": (int(np.abs(charge).sum()) - abs(self.total_charge)) // 2,
            "paired": int(self.dislocations.multiplicity.sum()),
            "clusters": self.kinds,
            "largest_cluster": int(self.clusters.size.max(initial=0)),
            "rim_charges": int(self.disclinations.rim.sum()),
            "tiny_films": len(self.tiny_films),
            "tiny": self.tiny,
            "ambiguous_charges": int(self.disclinations.ambiguous.sum()),
            "spacing": self.spacing,
        }

    def columns(self, table: str) -> dict[str, NDArray[Any]]:
        """Columns of ``"disclinations"``, ``"clusters"`` or ``"dislocations"``; vectors by component.

        Raises
        ------
        ValueError
            If there is no such table.
        """
        if table not in ("disclinations", "clusters", "dislocations"):
            raise ValueError(f"table must be disclinations, clusters or dislocations, got {table!r}")
        rows: Mapping[str, NDArray[Any]] = vars(getattr(self, table))
        count = len(next(iter(rows.values())))
        out: dict[str, NDArray[Any]] = {table[:-1]: np.arange(count)}
        for name, values in rows.items():
            if values.ndim == 1:
                out[name] = values
            else:
                stem = "" if name == "position" else f"{name}_"
                out |= {f"{stem}{axis}": values[:, k] for k, axis in enumerate("xyz")}
        return out

    @cached_property
    def graph(self) -> nx.MultiGraph:
        """Charged bubbles as nodes (charge, cluster, kind, position); shared films as edges, keyed by film.

        Edges have ``paired``: the unit charges that pair across the film.
        """
        import networkx as nx

        out = nx.MultiGraph()
        rows = self.disclinations
        kinds = self.clusters.kind[rows.cluster].tolist()
        for k, (bubble, place) in enumerate(zip(rows.bubble.tolist(), rows.position.tolist(), strict=True)):
            out.add_node(
                bubble,
                id=int(rows.id[k]),
                sides=int(rows.sides[k]),
                charge=int(rows.charge[k]),
                cluster=int(rows.cluster[k]),
                kind=kinds[k],
                ambiguous=bool(rows.ambiguous[k]),
                **dict(zip("xyz", place, strict=True)),
            )
        paired = dict(
            zip(self.dislocations.film.tolist(), self.dislocations.multiplicity.tolist(), strict=True)
        )
        one, two = self.network.left, self.network.right
        inner = np.flatnonzero((self.cluster_of[one] >= 0) & (self.cluster_of[two] >= 0))
        for film in inner.tolist():
            out.add_edge(int(one[film]), int(two[film]), film, film=film, paired=paired.get(film, 0))
        return out
