"""The first bytes of an HDF5 file, which say whether a writer holds it.

A writer that is killed leaves its mark, and HDF5 then refuses the file, sound as it is. Superblock of
version 3: signature (8 bytes), version, sizes of offsets and lengths, flags, base address, extension, end of
file, root (8 bytes each), checksum (4). Source: The HDF Group, HDF5 File Format Specification 3.0, II.A.
"""

from __future__ import annotations

import os
import zlib
from pathlib import Path
from typing import BinaryIO

from warpedfoam.errors import FileFormatError

#: Bytes before the superblock that HDF5 leaves to us: a line of text, the rest zeros.
USER_BLOCK = 512
#: Bytes of a superblock of version 3.
SUPERBLOCK = 48

_SIGNATURE = b"\x89HDF\r\n\x1a\n"
_FLAGS, _END, _SUM = 11, 28, 44
_WORD = 0xFFFFFFFF
_MARK = b"warpedfoam trajectory "


def seal(path: Path) -> None:
    """Write the checksum of all that follows the user block into it.

    HDF5 may crash or hang on damaged files: they must be known before it sees them.
    """
    with path.open("r+b") as stream:
        total = _sum(stream)
        stream.seek(0)
        stream.write(_block(f"closed {total:08x}"))
        stream.flush()
        os.fsync(stream.fileno())


def mark_open(path: Path) -> None:
    """Say in the user block that the file is being written."""
    with path.open("r+b") as stream:
        stream.write(_block("open"))


def is_open(path: Path) -> bool:
    """Whether a writer holds the file, or was killed.

    Raises
    ------
    FileFormatError
        If the user block is not ours, or what follows does not have its checksum.
    """
    with path.open("rb") as stream:
        block = stream.read(USER_BLOCK)
        if block == _block("open"):
            return True
        if not block.startswith(_MARK):
            raise FileFormatError("it is no trajectory of warpedfoam")
        if block != _block(f"closed {_sum(stream):08x}"):
            raise FileFormatError("its checksum is wrong: it is damaged or cut off")
    return False


def _block(state: str) -> bytes:
    return (_MARK + state.encode("ascii") + b"\n").ljust(USER_BLOCK, b"\0")


def _sum(stream: BinaryIO) -> int:
    """CRC-32 of what follows the user block."""
    stream.seek(USER_BLOCK)
    total = 0
    while part := stream.read(1 << 22):
        total = zlib.crc32(part, total)
    return total


def in_use(start: bytes) -> bool:
    """Whether the file's first bytes are a superblock that a writer has marked.

    Examples
    --------
    >>> in_use(b"no HDF5")
    False
    """
    return (
        len(start) >= SUPERBLOCK
        and start.startswith(_SIGNATURE)
        and start[8] == 3
        and start[9:11] == bytes([8, 8])
        and bool(start[_FLAGS])
        and checksum(start[:_SUM]) == int.from_bytes(start[_SUM:SUPERBLOCK], "little")
    )


def released(start: bytes, size: int) -> bytes:
    """The superblock of a file of ``size`` bytes without its writer's mark."""
    block = bytearray(start[:SUPERBLOCK])
    block[_FLAGS] = 0
    block[_END : _END + 8] = size.to_bytes(8, "little")
    block[_SUM:] = checksum(bytes(block[:_SUM])).to_bytes(4, "little")
    return bytes(block)


def checksum(data: bytes) -> int:
    """Bob Jenkins' lookup3 hash (2006), as HDF5 uses it for its metadata.

    Examples
    --------
    The author's test vectors:

    >>> hex(checksum(b"Four score and seven years ago"))
    '0x17770551'
    >>> hex(checksum(b""))
    '0xdeadbeef'
    """
    a = b = c = (0xDEADBEEF + len(data)) & _WORD
    at = 0
    while len(data) - at > 12:
        x, y, z = (int.from_bytes(data[at + k : at + k + 4], "little") for k in (0, 4, 8))
        a, b, c = (a + x) & _WORD, (b + y) & _WORD, (c + z) & _WORD
        # six rounds in which each word is changed by the next two
        for turn in (4, 6, 8, 16, 19, 4):
            a = (a - c) & _WORD ^ _rotated(c, turn)
            c = (c + b) & _WORD
            a, b, c = b, c, a
        at += 12
    if at == len(data):
        return c
    rest = data[at:] + bytes(12)
    x, y, z = (int.from_bytes(rest[k : k + 4], "little") for k in (0, 4, 8))
    a, b, c = (a + x) & _WORD, (b + y) & _WORD, (c + z) & _WORD
    for turn in (14, 11, 25, 16, 4, 14, 24):
        c = ((c ^ b) - _rotated(b, turn)) & _WORD
        a, b, c = b, c, a
    # seven turns leave the word that was changed last in the middle
    return b


def _rotated(word: int, by: int) -> int:
    return (word << by | word >> (32 - by)) & _WORD
