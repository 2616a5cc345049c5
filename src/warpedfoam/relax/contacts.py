"""Contacts of clusters: outlines that meet are joined, bubbles that hang on by nothing are parted."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from warpedfoam.arrays import Floats, Ints
from warpedfoam.cell import HeleShawCell
from warpedfoam.errors import TopologyError
from warpedfoam.foam import Foam
from warpedfoam.kernels.periodic import nearest_image
from warpedfoam.moves.join import FRESH, ContactEvent, join_from
from warpedfoam.moves.markers import Layout, layout_of
from warpedfoam.moves.part import may_part, part
from warpedfoam.moves.t1 import outward_tangents, pulls, t1_sites
from warpedfoam.network import CellNetwork
from warpedfoam.relax.marking import with_markers
from warpedfoam.relax.outlines import Facing, Outlines, facing, met, outlines, safe_share

#: Gaps, in sizes of the smaller bubble, at which outlines have met.
WINDOW = (-0.03, 0.006)
#: A film that holds a bubble to another is lost when it is shorter than the first, in sizes of the smaller
#: bubble, and its neighbours do not pull it open, with less than the second: 2 is what holds it at rest.
LOOSE, HOLDS = 0.02, 2.02
#: Contacts made in all, times the number of films: more are made and lost without end.
MOST = 1


@dataclass(frozen=True, eq=False)
class Contacts:
    """A foam after contacts, what happened, and where its films come from (−1: new).

    ``refused`` says why outlines that have met could not be joined, if there are any.
    """

    foam: Foam
    events: tuple[ContactEvent, ...]
    source: Ints
    refused: str


def with_contacts(
    foam: Foam, *, iteration: int = 0, markers: bool = True
) -> tuple[Foam, tuple[ContactEvent, ...]]:
    """The foam with contacts made, bridges ruptured, and markers where its outlines need them.

    For use between time steps or minimisations; nothing is moved but where the topology changes.

    1. Two films that face each other across the exterior and have come within 0.006 bubble sizes, or
       crossed by no more than 0.03, are joined (`join`), the closest pair first.
    2. A film with the exterior at both ends that is shorter than 0.02 bubble sizes, and that its
       neighbours do not pull open, is parted (`part`).
    3. Markers beside films shorter than 0.12 bubble sizes are taken off where the joined film is flat
       enough, and outer films that bend by more than 66° from their segment get one in the middle.

    Parameters
    ----------
    foam : Foam
        Returned as it is where it has no exterior or nothing is to be done. Otherwise the new one has no
        pressures, and perhaps other films and vertices; an enclosed region is a new bubble, the last.
    iteration : int, optional
        For the events.
    markers : bool, optional
        Whether to do the third.

    Returns
    -------
    foam : Foam
    events : tuple of ContactEvent

    Raises
    ------
    TopologyError
        If outlines meet in a way that is not handled: see `join`.

    Examples
    --------
    >>> from warpedfoam import HeleShawCell, Torus, cluster_foam
    >>> foam = cluster_foam(HeleShawCell(Torus(20.0, 4.0), gap=0.5), 7, volumes=0.5)
    >>> with_contacts(foam) == (foam, ())
    True
    """
    if not isinstance(foam, Foam):
        raise TypeError(f"foam must be a Foam, got {type(foam).__name__}")
    if foam.exterior is None:
        return foam, ()
    found = make_contacts(foam, iteration)
    if found.refused:
        raise TopologyError(found.refused)
    if not markers:
        return found.foam, found.events
    layout = layout_of(found.foam)
    marked = with_markers(foam.cell, layout, foam.exterior, foam.bubble_size, shares_of(found.foam))
    if marked is layout:
        return found.foam, found.events
    out = replace(
        found.foam,
        network=marked.network,
        vertex_points=marked.points,
        film_offsets=marked.offsets,
        pressures=None,
    )
    return out, found.events


def outline_gap(foam: Foam) -> float:
    """Least distance at which two outlines face each other across the exterior, in bubble sizes.

    Negative where they have crossed; infinite where none come nearer than 0.6 bubble sizes. At 0.006
    `with_contacts` joins them.

    Raises
    ------
    TypeError, ValueError
        If ``foam`` is not a Foam or has no exterior.
    """
    if not isinstance(foam, Foam):
        raise TypeError(f"foam must be a Foam, got {type(foam).__name__}")
    if foam.exterior is None:
        raise ValueError("foam must have an exterior; see cluster_foam")
    lines, pairs = _pairs(foam, 0.6)
    wide = met(
        foam.cell,
        foam.network,
        foam.vertex_points,
        lines,
        pairs,
        foam.bubble_size,
        (WINDOW[0], np.inf),
    )
    return float(pairs.gap[wide].min(initial=np.inf))


def shares_of(foam: Foam) -> Floats:
    """Volumes to hold over their mean, the exterior left out of it."""
    assert foam.exterior is not None
    out: Floats = foam.target_volumes / np.delete(foam.target_volumes, foam.exterior).mean()
    return out


def waiting(
    cell: HeleShawCell,
    network: CellNetwork,
    points: Floats,
    offsets: Floats,
    exterior: int,
    length: float,
    shares: Floats,
) -> bool:
    """Whether some outlines have met or some film has let go: a quick look before `make_contacts`."""
    if _loose(cell, network, points, offsets, exterior, length, shares).size:
        return True
    lines = outlines(cell, network, points, offsets, exterior, length)
    pairs = facing(cell, lines, shares, length, 0.05, 0.06)
    return bool(met(cell, network, points, lines, pairs, length, WINDOW).any())


def make_contacts(foam: Foam, iteration: int = 0) -> Contacts:
    """Joins, closest first, then partings, one after the other."""
    events: list[ContactEvent] = []
    source = np.arange(foam.network.n_films)
    exterior = foam.exterior
    assert exterior is not None
    limit, refused = MOST * foam.network.n_films, ""
    while len(events) < limit:
        lines, pairs = _pairs(foam, 0.05)
        near = np.flatnonzero(
            met(foam.cell, foam.network, foam.vertex_points, lines, pairs, foam.bubble_size, WINDOW)
        )
        refused = ""
        made = None
        # one pair stands for all those of its two films
        owner = np.stack([pairs.one[near], pairs.other[near]]) // lines.points.shape[1]
        order = np.argsort(pairs.gap[near] / pairs.scale[near], kind="stable")
        kinds = np.unique(owner[:, order], axis=1, return_index=True)[1]
        for best in near[order[np.sort(kinds)]].tolist():
            try:
                made = _joined(foam, lines, pairs, best, iteration, source)
                break
            except TopologyError as error:
                refused = str(error)
        if made is not None:
            foam, event, source = made
            events.append(event)
            continue
        loose = _loose(
            foam.cell,
            foam.network,
            foam.vertex_points,
            foam.film_offsets,
            exterior,
            foam.bubble_size,
            shares_of(foam),
        )
        if not loose.size:
            break
        foam, event, source = _parted(foam, int(loose[0]), iteration, source)
        events.append(event)
    return Contacts(foam, tuple(events), source, refused)


def restrained(
    cell: HeleShawCell,
    before: Layout,
    after: tuple[Floats, Floats],
    exterior: int,
    length: float,
    shares: Floats,
) -> float:
    """Share of a step from ``before`` to points and offsets ``after`` at which outlines meet."""
    one = outlines(cell, before.network, before.points, before.offsets, exterior, length)
    two = outlines(cell, before.network, *after, exterior, length)
    if one.points.shape != two.points.shape:
        # a film that stretched has more points: look at both with as many
        count = max(one.points.shape[1], two.points.shape[1])
        one = outlines(cell, before.network, before.points, before.offsets, exterior, length, count)
        two = outlines(cell, before.network, *after, exterior, length, count)
    return safe_share(cell, before.network, before.points, one, two, shares, length)


def _pairs(foam: Foam, reach: float) -> tuple[Outlines, Facing]:
    assert foam.exterior is not None
    arrays = foam.vertex_points, foam.film_offsets
    lines = outlines(foam.cell, foam.network, *arrays, foam.exterior, foam.bubble_size)
    return lines, facing(foam.cell, lines, shares_of(foam), foam.bubble_size, reach, 0.06)


def _joined(
    foam: Foam, lines: Outlines, pairs: Facing, best: int, iteration: int, source: Ints
) -> tuple[Foam, ContactEvent, Ints]:
    count = lines.points.shape[1]
    rows = np.array([pairs.one[best], pairs.other[best]])
    films, at = lines.films[rows // count], (rows % count) / (count - 1.0)
    ids = foam.bubble_ids[lines.bubbles[rows // count]].tolist()
    x = lines.points.reshape(-1, 3)[rows]
    middle = x[0] + 0.5 * nearest_image(x[1] - x[0], foam.cell.surface.period)
    if films[0] == films[1]:
        raise TopologyError(
            f"bubble {ids[0]} has come round the surface and meets itself along one film; divide it first "
            "(add_markers)"
        )
    span = FRESH * foam.bubble_size * float(pairs.scale[best])
    after, kept = join_from(foam, films, at=at, length=span)
    name = int(after.bubble_ids[-1]) if after.n_bubbles > foam.n_bubbles else None
    event = ContactEvent(
        iteration,
        "join",
        (ids[0], ids[1]),
        (float(middle[0]), float(middle[1]), float(middle[2])),
        foam.energy,
        after.energy,
        name,
    )
    return after, event, np.where(kept >= 0, source[np.maximum(kept, 0)], -1)


def _parted(foam: Foam, film: int, iteration: int, source: Ints) -> tuple[Foam, ContactEvent, Ints]:
    network = foam.network
    one, other = foam.bubble_ids[[network.left[film], network.right[film]]].tolist()
    middle = foam.film_curves(3)[film, 1].tolist()
    after = part(foam, film)
    event = ContactEvent(
        iteration,
        "part",
        (one, other),
        (middle[0], middle[1], middle[2]),
        foam.energy,
        after.energy,
    )
    added = after.network.n_films + 1 - network.n_films
    kept = np.delete(np.append(source, np.full(added, -1)), film)
    return after, event, kept


def _loose(
    cell: HeleShawCell,
    network: CellNetwork,
    points: Floats,
    offsets: Floats,
    exterior: int,
    length: float,
    shares: Floats,
) -> Ints:
    """Films with the exterior at both ends that have all but vanished."""
    tail, head = points[network.tails], points[network.heads]
    chord = np.linalg.norm(nearest_image(head - tail, cell.surface.period), axis=1)
    beside = np.minimum(shares[network.left], shares[network.right])
    films: Ints = np.flatnonzero(chord < LOOSE * length * np.sqrt(np.minimum(1.0, beside)))
    films = np.asarray(films[may_part(network, films, exterior)])
    if not films.size:
        return films
    sites = t1_sites(network, films)
    tangents = outward_tangents(cell.surface, network, points, offsets, sites.outer)
    open_ = np.linalg.norm(pulls(tangents)[0], axis=1)
    out: Ints = films[open_ < HOLDS]
    return out
