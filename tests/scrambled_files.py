"""Small mesh files in every format, written plainly, and ways to scramble them."""

from __future__ import annotations

import re
import struct
from collections.abc import Callable

import numpy as np


def _ply_text(nodes, tri):
    head = (
        f"ply\nformat ascii 1.0\nelement vertex {len(nodes)}\nproperty double x\nproperty double y\n"
        f"property double z\nelement face {len(tri)}\nproperty list uchar int vertex_indices\nend_header\n"
    )
    lines = [" ".join(f"{x:.17g}" for x in p) for p in nodes] + [f"3 {a} {b} {c}" for a, b, c in tri]
    return (head + "\n".join(lines) + "\n").encode()


def _ply_binary(nodes, tri):
    head, _ = _ply_text(nodes, tri).split(b"end_header\n")
    head = head.replace(b"ascii", b"binary_little_endian") + b"end_header\n"
    faces = np.zeros(len(tri), dtype=[("n", "u1"), ("v", "<i4", 3)])
    faces["n"], faces["v"] = 3, tri
    return head + nodes.astype("<f8").tobytes() + faces.tobytes()


def _obj(nodes, tri):
    lines = ["v " + " ".join(f"{x:.17g}" for x in p) for p in nodes]
    return ("\n".join(lines + [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in tri]) + "\n").encode()


def _off(nodes, tri):
    lines = ["OFF", f"{len(nodes)} {len(tri)} 0"] + [" ".join(f"{x:.17g}" for x in p) for p in nodes]
    return ("\n".join(lines + [f"3 {a} {b} {c}" for a, b, c in tri]) + "\n").encode()


def _stl_text(nodes, tri):
    out = ["solid thing"]
    for corners in nodes[np.minimum(tri, len(nodes) - 1)]:
        out += ["facet normal 0 0 0", "outer loop"]
        out += ["vertex " + " ".join(f"{x:.9g}" for x in p) for p in corners]
        out += ["endloop", "endfacet"]
    return ("\n".join([*out, "endsolid thing"]) + "\n").encode()


def _stl_binary(nodes, tri):
    body = np.zeros(len(tri), dtype=[("n", "<f4", 3), ("v", "<f4", (3, 3)), ("a", "<u2")])
    with np.errstate(over="ignore"):
        body["v"] = nodes[np.minimum(tri, len(nodes) - 1)]
    return b"thing".ljust(80) + struct.pack("<I", len(tri)) + body.tobytes()


FORMATS: dict[str, tuple[str, Callable[[np.ndarray, np.ndarray], bytes]]] = {
    "ply": (".ply", _ply_text),
    "plyb": (".ply", _ply_binary),
    "obj": (".obj", _obj),
    "off": (".off", _off),
    "stl": (".stl", _stl_text),
    "stlb": (".stl", _stl_binary),
}

Scramble = Callable[[bytes, np.random.Generator, str], bytes]


def _flip_bytes(data: bytes, rng: np.random.Generator, count: int) -> bytes:
    raw = np.frombuffer(data, dtype=np.uint8).copy()
    raw[rng.integers(len(raw), size=count)] ^= rng.integers(1, 256, size=count).astype(np.uint8)
    return raw.tobytes()


def _recount(data: bytes, new: bytes, kind: str) -> bytes:
    """Another number of triangles (of STL text, which counts nothing: of the solid's first vertex)."""
    if kind == "stlb":
        try:
            number = int(new) % 2**32
        except ValueError:
            number = 0
        return data[:80] + struct.pack("<I", number) + data[84:]
    pattern = {
        "off": rb"^(OFF\n\d+ )\d+", "obj": rb"(\nf )\d+", "stl": rb"(vertex )\S+",
    }.get(kind, rb"(element face )\d+")  # fmt: skip
    return re.sub(pattern, lambda m: m.group(1) + new, data, count=1)


def _recount_nodes(data: bytes, new: bytes, kind: str) -> bytes:
    pattern = {"off": rb"^(OFF\n)\d+", "obj": rb"(\nf \d+ )\d+"}.get(kind, rb"(element vertex )\d+")
    return re.sub(pattern, lambda m: m.group(1) + new, data, count=1)


def _text_number(data: bytes, rng: np.random.Generator, word: bytes) -> bytes:
    """Some number in the body replaced by a word."""
    places = [m.span() for m in re.finditer(rb"-?\d\.\d+(e-?\d+)?", data)]
    if not places:
        return data[:200] + word + data[200:]
    lo, hi = places[int(rng.integers(len(places)))]
    return data[:lo] + word + data[hi:]


SCRAMBLES: dict[str, tuple[Scramble, int]] = {
    "byte": (lambda data, rng, kind: _flip_bytes(data, rng, 1), 2),
    "bytes": (lambda data, rng, kind: _flip_bytes(data, rng, 20), 2),
    "many_bytes": (lambda data, rng, kind: _flip_bytes(data, rng, len(data) // 5), 1),
    "head_bytes": (lambda data, rng, kind: _flip_bytes(data[:150], rng, 3) + data[150:], 2),
    "cut": (lambda data, rng, kind: data[: int(rng.uniform(0.05, 0.98) * len(data))], 3),
    "cut_tail": (lambda data, rng, kind: data[:-7], 1),
    "cut_head": (lambda data, rng, kind: data[int(rng.integers(1, 60)) :], 1),
    "head_only": (lambda data, rng, kind: data[:60], 1),
    "more": (lambda data, rng, kind: data + bytes(rng.integers(256, size=500).astype(np.uint8)), 1),
    "fewer_faces": (lambda data, rng, kind: _recount(data, b"100", kind), 1),
    "more_faces": (lambda data, rng, kind: _recount(data, b"2000", kind), 1),
    "huge_faces": (lambda data, rng, kind: _recount(data, b"2000000000", kind), 1),
    "absurd_faces": (lambda data, rng, kind: _recount(data, b"99999999999999999999", kind), 1),
    "minus_faces": (lambda data, rng, kind: _recount(data, b"-5", kind), 1),
    "word_faces": (lambda data, rng, kind: _recount(data, b"many", kind), 1),
    "huge_nodes": (lambda data, rng, kind: _recount_nodes(data, b"2000000000", kind), 1),
    "zero_nodes": (lambda data, rng, kind: _recount_nodes(data, b"0", kind), 1),
    "nan": (lambda data, rng, kind: _text_number(data, rng, b"nan"), 1),
    "inf": (lambda data, rng, kind: _text_number(data, rng, b"-inf"), 1),
    "word": (lambda data, rng, kind: _text_number(data, rng, b"1.0.0"), 1),
    "overflow": (lambda data, rng, kind: _text_number(data, rng, b"1e999"), 1),
    "windows": (lambda data, rng, kind: data.replace(b"\n", b"\r\n"), 1),
    "nulls": (lambda data, rng, kind: data[:300] + bytes(300) + data[300:], 1),
    "doubled": (lambda data, rng, kind: data + data, 1),
    "one_line": (lambda data, rng, kind: data.replace(b"\n", b" "), 1),
}

#: Whole files of nonsense, under every ending.
JUNK: dict[str, Callable[[np.random.Generator], bytes]] = {
    "empty": lambda rng: b"",
    "noise": lambda rng: bytes(rng.integers(256, size=5000).astype(np.uint8)),
    "zeros": lambda rng: bytes(5000),
    "prose": lambda rng: b"It was a dark and stormy night; the foam fell in torrents.\n" * 20,
    "blank": lambda rng: b"\n" * 1000,
}
ENDINGS = (".ply", ".obj", ".stl", ".off", ".glb", ".gltf")
