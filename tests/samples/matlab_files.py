"""Parts of .mat files of version 5 that `scipy.io.savemat` does not write."""

import struct
from pathlib import Path


def element(kind: int, content: bytes) -> bytes:
    return struct.pack("<2I", kind, len(content)) + content + b"\0" * (-len(content) % 8)


def object_of(name: str, matlab_class: str = "ss") -> bytes:
    """An object of a class, as `sys = ss(A, B, C, D)`: it has no dimensions, and a table without a name behind it."""
    handle = element(6, struct.pack("<6I", 0xDD000000, 2, 1, 1, 1, 2))
    held = element(6, struct.pack("<2I", 13, 0)) + element(5, struct.pack("<2i", 6, 1)) + element(1, b"")
    names = element(1, name.encode()) + element(1, b"MCOS") + element(1, matlab_class.encode())
    table = element(6, struct.pack("<2I", 9, 0)) + element(5, struct.pack("<2i", 1, 8)) + element(1, b"")
    head = element(6, struct.pack("<2I", 17, 0))
    return element(14, head + names + element(14, held + handle)) + element(14, table + element(2, bytes(8)))


def append(path: Path, *elements: bytes) -> Path:
    with path.open("ab") as file:
        file.writelines(elements)
    return path
