"""`defects`: disclinations, their clusters, dislocations with Burgers vectors, scars and pleats."""

from __future__ import annotations

import numpy as np

from warpedfoam.analysis.circuits import BASIS, STEPS, Circuits, circuits
from warpedfoam.analysis.defect_report import Clusters, DefectReport, Disclinations, Dislocations
from warpedfoam.analysis.frames import as_complex, oriented_frames, transported, unwrapped
from warpedfoam.analysis.pairing import pair_charges
from warpedfoam.arrays import Bools, Floats, Ints, as_instance, as_number, frozen
from warpedfoam.foam import Foam
from warpedfoam.network import CellNetwork


def defects(foam: Foam, *, tiny: float = 0.1) -> DefectReport:
    """Find the defects of a foam: charges, clusters, dislocations, scars, pleats.

    Charged bubbles that share a film belong to one cluster. A lattice frame is taken round every cluster
    of charge 0 that is a disk (holes without charges filled), by laying the films of its rim out in the
    honeycomb: the walk ends where it began but for a whole lattice vector. Walked counter-clockwise, seen
    from outside, its start minus its end is the Burgers vector b. Its square is exact; its direction
    follows from the one rotation that fits the lattice's directions best to the films of the rim,
    brought to the tangent plane at the cluster by parallel transport. b turns with the foam and a
    reflection M takes it to −M b, since it reverses the walk.

    Parameters
    ----------
    foam : Foam
        Relaxed or not; with rims or without.
    tiny : float, optional
        Films shorter than this many bubble sizes are flagged (a honeycomb's films have 0.62; relaxing
        turns films that shrink below 0.02).

    Returns
    -------
    DefectReport

    Raises
    ------
    TypeError, ValueError
        If ``foam`` is not a Foam, or ``tiny`` not a number from 0 to 1.

    Notes
    -----
    Whole-number counting on half-films, O(n log n) but for the matching of pairs. Definitions in
    ``docs/defects.md``.

    References
    ----------
    J. P. Hirth and J. Lothe, *Theory of Dislocations* (1982), section 1-4, for Burgers circuits; A. R.
    Bausch et al., Science 299, 1716 (2003) for scars; W. T. M. Irvine, V. Vitelli and P. M. Chaikin, Nature
    468, 947 (2010) for pleats.

    Examples
    --------
    >>> from warpedfoam import HeleShawCell, Sphere, voronoi_foam
    >>> foam = voronoi_foam(HeleShawCell(Sphere(1.0), gap=0.01), n_bubbles=100, seed=1)
    >>> found = defects(foam)
    >>> found.total_charge, int(found.clusters.charge.sum())
    (12, 12)
    """
    as_instance(foam, "foam", Foam)
    limit = as_number(tiny, "tiny", minimum=0.0, maximum=1.0)
    network = foam.network
    disk = network.bubble_euler == 1
    charges = np.where(disk, network.charges, 0)
    at_rim = rim_bubbles(network)
    spacing = lattice_spacing(foam)
    films = np.flatnonzero(foam.film_lengths < limit * foam.bubble_size)
    unsure = np.zeros(network.n_bubbles, dtype=bool)
    unsure[bubbles_round(network, films)] = True

    cluster_of, count = _connected(network, charges != 0)
    pair_films, multiplicity = pair_charges(network, charges, foam.film_lengths)
    bubble = np.flatnonzero(charges)
    rows = Disclinations(
        bubble=frozen(bubble),
        id=frozen(foam.bubble_ids[bubble]),
        sides=frozen(network.sides[bubble]),
        charge=frozen(charges[bubble]),
        cluster=frozen(cluster_of[bubble]),
        position=frozen(foam.bubble_centres[bubble]),
        rim=frozen(at_rim[bubble]),
        ambiguous=frozen(unsure[bubble]),
    )
    return DefectReport(
        network,
        spacing,
        rows,
        _clusters(foam, charges, cluster_of, count, at_rim, unsure, spacing),
        _dislocations(foam, charges, cluster_of, pair_films, multiplicity, at_rim, unsure),
        frozen(cluster_of),
        frozen(films),
        limit,
    )


def lattice_spacing(foam: Foam) -> float:
    """a = sqrt(2 A / (√3 N)), the distance of neighbours in a honeycomb of bubbles of the mean area."""
    return foam.bubble_size * float(np.sqrt(2.0 / np.sqrt(3.0)))


def rim_bubbles(network: CellNetwork) -> Bools:
    """True for bubbles that touch a wall (a film of theirs ends at one) or the exterior of a cluster."""
    out = np.zeros(network.n_bubbles, dtype=bool)
    ends = network.vertex_degrees[network.origin] == 1
    out[network.bubble[ends | ends.reshape(-1, 2)[:, ::-1].ravel()]] = True
    beyond = network.bubble_euler[network.bubble] != 1
    out[network.bubble[beyond.reshape(-1, 2)[:, ::-1].ravel()]] = True
    return out


def bubbles_round(network: CellNetwork, films: Ints) -> Ints:
    """The four bubbles whose sides a T1 on each of ``films`` changes, all together."""
    halves = np.concatenate([2 * films, 2 * films + 1])
    return np.unique(np.concatenate([network.bubble[halves], network.bubble[network.next[halves] ^ 1]]))


def _connected(network: CellNetwork, chosen: Bools) -> tuple[Ints, int]:
    """Number the connected sets of chosen bubbles by their first bubble; −1 for the others."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    n = network.n_bubbles
    inner = chosen[network.left] & chosen[network.right]
    ends = (network.left[inner], network.right[inner])
    _, found = connected_components(coo_array((np.ones(len(ends[0])), ends), shape=(n, n)), directed=False)
    names, first, place = np.unique(found[chosen], return_index=True, return_inverse=True)
    rank = np.empty(len(names), dtype=np.int64)
    rank[np.argsort(first)] = np.arange(len(names))
    out = np.full(n, -1, dtype=np.int64)
    out[chosen] = rank[place]
    return out, len(names)


def _filled(network: CellNetwork, cluster_of: Ints, count: int, charges: Ints) -> Ints:
    """The clusters with their holes: grains without charge that are disks and border one cluster only.

    The largest grain of the foam is never a hole: it is what surrounds the clusters.
    """
    grain, n_grains = _connected(network, (charges == 0) & (network.bubble_euler == 1))
    if not count or not n_grains:
        return cluster_of
    size = np.bincount(grain[grain >= 0], minlength=n_grains)
    open_ended = np.zeros(n_grains + 1, dtype=bool)
    open_ended[grain[rim_bubbles(network)]] = True
    open_ended[-1] = False
    walk = circuits(network, np.where(open_ended[grain], -1, grain), n_grains)
    beside = cluster_of[network.bubble[walk.halves ^ 1]]
    lowest = np.full(n_grains, np.iinfo(np.int64).max)
    highest = np.full(n_grains, -1, dtype=np.int64)
    np.minimum.at(lowest, walk.region, beside)
    np.maximum.at(highest, walk.region, beside)
    hole = walk.disk & (lowest == highest) & (highest >= 0) & (size < size.max())
    target = np.append(np.where(hole, highest, -1), -1)
    out: Ints = np.where(grain >= 0, target[grain], cluster_of)
    return out


def _clusters(
    foam: Foam, charges: Ints, cluster_of: Ints, count: int, at_rim: Bools, unsure: Bools, spacing: float
) -> Clusters:
    network = foam.network
    member = np.flatnonzero(cluster_of >= 0)
    owner = cluster_of[member]

    def total(values: Ints) -> Ints:
        return np.bincount(owner, values[member], minlength=count).astype(np.int64)

    size, charge = total(np.ones_like(charges)), total(charges)
    pairs = (total(np.abs(charges)) - np.abs(charge)) // 2
    rim, ambiguous = total(at_rim.astype(np.int64)) > 0, total(unsure.astype(np.int64)) > 0
    free = np.where((cluster_of >= 0) & ~np.append(rim, False)[cluster_of], cluster_of, -1)
    region = _filled(network, free, count, charges)
    walk = circuits(network, region, count)
    position, gyration = _places(foam, cluster_of, count, spacing)
    burgers, fit, squared = _burgers(foam, walk, position)
    inside = np.bincount(region[region >= 0], minlength=count)
    missing = np.where(walk.closed & (squared == 0), walk.hexagons - inside, 0)
    kind = np.select(
        [
            rim,
            size == 1,
            ~walk.disk,
            (charge == 0) & (squared > 0) & (pairs == 1),
            (charge == 0) & (squared > 0),
            (charge == 0) & (missing > 0),
            (charge == 0) & (missing < 0),
            charge == 0,
            np.abs(charge) == 1,
        ],
        [
            "rim",
            "disclination",
            "network",
            "dislocation",
            "pleat",
            "vacancy",
            "interstitial",
            "neutral",
            "scar",
        ],
        "aggregate",
    )
    return Clusters(
        kind=frozen(kind),
        size=frozen(size),
        charge=frozen(charge),
        pairs=frozen(pairs),
        has_burgers=frozen(walk.closed),
        burgers=frozen(burgers),
        burgers_squared=frozen(squared),
        frame_fit=frozen(fit),
        missing=frozen(missing),
        position=frozen(position),
        gyration=frozen(gyration),
        ambiguous=frozen(ambiguous),
    )


def _dislocations(
    foam: Foam, charges: Ints, cluster_of: Ints, films: Ints, multiplicity: Ints, at_rim: Bools, unsure: Bools
) -> Dislocations:
    network = foam.network
    one, two = network.left[films], network.right[films]
    positive, negative = np.where(charges[one] > 0, one, two), np.where(charges[one] > 0, two, one)
    position = foam.cell.surface.project(foam.film_curves_at(np.array([0.5]))[films, 0])
    # all charge of both bubbles is in this pair: a frame can be taken round it
    whole = (charges[positive] == multiplicity) & (charges[negative] == -multiplicity)
    whole &= ~(at_rim[positive] | at_rim[negative])
    labels = np.full(network.n_bubbles, -1, dtype=np.int64)
    labels[positive[whole]] = labels[negative[whole]] = np.flatnonzero(whole)
    walk = circuits(network, labels, len(films))
    burgers = _burgers(foam, walk, position)[0]

    # elsewhere along the film: the step from positive to negative, turned left
    tail, head = foam.film_ends
    normal = foam.cell.surface.normals(position)
    along = (head - tail)[films] * np.where(one == positive, 1.0, -1.0)[:, None]
    along -= np.einsum("kx,kx->k", along, normal)[:, None] * normal
    along *= (multiplicity / np.maximum(np.linalg.norm(along, axis=1), 1e-300))[:, None]
    burgers = np.where(walk.closed[:, None], burgers, along)
    return Dislocations(
        positive=frozen(positive),
        negative=frozen(negative),
        film=frozen(films),
        multiplicity=frozen(multiplicity),
        cluster=frozen(cluster_of[positive]),
        position=frozen(position),
        burgers=frozen(burgers),
        transported=frozen(walk.closed),
        ambiguous=frozen(unsure[positive] | unsure[negative]),
    )


def _places(foam: Foam, cluster_of: Ints, count: int, spacing: float) -> tuple[Floats, Floats]:
    """Middle of each cluster on the surface, and its radius of gyration in lattice spacings."""
    surface = foam.cell.surface
    member = np.flatnonzero(cluster_of >= 0)
    owner, points = cluster_of[member], unwrapped(foam, cluster_of)[member]
    size = np.bincount(owner, minlength=count)[:, None]
    if not count:
        return np.zeros((0, 3)), np.zeros(0)
    normals = surface.normals(foam.bubble_centres)[member]

    def mean(values: Floats) -> Floats:
        out: Floats = np.stack([np.bincount(owner, v, minlength=count) for v in values.T], axis=1) / size
        return out

    middle, facing = mean(points), np.linalg.norm(mean(normals), axis=1)
    away = np.linalg.norm(points - middle[owner], axis=1)
    gyration = np.sqrt(mean(away[:, None] ** 2)[:, 0]) / spacing
    # where a cluster bends round the surface its mean is far from it: the nearest member's centre instead
    order = np.lexsort((away, owner))
    nearest = points[order[np.searchsorted(owner[order], np.arange(count))]]
    bent = (facing < 0.5) | (gyration > 2.0)
    position = surface.project(np.where(bent[:, None], nearest, middle))
    return position, gyration


def _burgers(foam: Foam, walk: Circuits, position: Floats) -> tuple[Floats, Floats, Ints]:
    """Burgers vectors (k, 3) in lattice spacings, how well the frame fits (k,), and their squares (k,)."""
    surface, count = foam.cell.surface, len(position)
    p, q = np.where(walk.closed[:, None], -walk.advance, 0).T
    # films are 1/√3 of a lattice spacing long
    squared = (p * p + p * q + q * q) // 3
    if not count:
        return np.zeros((0, 3)), np.zeros(0), squared
    film, back = walk.halves >> 1, (walk.halves & 1).astype(bool)
    tail, head = foam.film_ends
    chord = (head - tail)[film] * np.where(back, -1.0, 1.0)[:, None]
    start = np.where(back[:, None], head[film], tail[film])
    here = surface.normals(surface.project(start + 0.5 * chord)) if len(film) else chord
    normals, frames = oriented_frames(foam, position)
    chord -= np.einsum("mx,mx->m", chord, here)[:, None] * here
    moved = transported(chord, here, normals[walk.region])
    real = as_complex(moved, frames[walk.region])
    ideal = (STEPS @ BASIS)[walk.direction]
    terms = real * ideal.conj()
    overlap = np.bincount(walk.region, terms.real, count) + 1j * np.bincount(walk.region, terms.imag, count)
    length = np.bincount(walk.region, np.abs(real), count)
    turn = overlap / np.maximum(np.abs(overlap), 1e-300)
    vector = turn * (p * BASIS[0] + q * BASIS[1]) / np.sqrt(3.0)
    # no −0.0 in tables
    burgers = vector.real[:, None] * frames[:, 0] + vector.imag[:, None] * frames[:, 1] + 0.0
    fit = np.where(walk.closed, np.abs(overlap) / np.maximum(length, 1e-300), 0.0)
    return burgers, fit, squared
