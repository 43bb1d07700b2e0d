# SPDX-License-Identifier: BSD-3-Clause
"""Counts the triangles that a mesh file declares, independently of the mesh reader, to check the reader."""

from __future__ import annotations

import re
import struct

FORMATS = ("stl", "obj", "ply")
STL_HEADER = 84
"""Length of the header of a binary STL file [bytes]."""
_STL_TRIANGLE = 50  # [bytes]
_FACE = re.compile(rb"^[ \t]*f[ \t]+(.*)$", re.MULTILINE)
_OBJ_LINE = re.compile(rb"^[ \t]*(v|f)[ \t]+(.*)$", re.MULTILINE)
_PLY_SIZES = {
    "char": "b",
    "int8": "b",
    "uchar": "B",
    "uint8": "B",
    "short": "h",
    "int16": "h",
    "ushort": "H",
    "uint16": "H",
    "int": "i",
    "int32": "i",
    "uint": "I",
    "uint32": "I",
    "float": "f",
    "float32": "f",
    "double": "d",
    "float64": "d",
}


def declared_triangles(kind: str, content: bytes) -> int:
    """Returns the number of triangles declared in an STL, OBJ or PLY file; a polygon of n corners counts as n - 2.

    Raises:
        ValueError, IndexError, KeyError, struct.error: The structure of the file is invalid.
    """
    match kind:
        case "stl":
            return _stl(content)
        case "obj":
            return sum(len(face.split()) - 2 for face in _FACE.findall(_joined_lines(content)))
        case "ply":
            return _ply(content)
    raise ValueError(f"'{kind}' is not one of {', '.join(FORMATS)}")


def is_binary_stl(content: bytes) -> bool:
    """Returns whether the length of an STL file matches its binary header, because text files may begin alike."""
    if len(content) < STL_HEADER:
        return False
    return len(content) == STL_HEADER + int(struct.unpack_from("<I", content, 80)[0]) * _STL_TRIANGLE


def _stl(content: bytes) -> int:
    if is_binary_stl(content):
        return (len(content) - STL_HEADER) // _STL_TRIANGLE
    if not content.lstrip()[:5].lower() == b"solid":
        raise ValueError(f"{len(content)} bytes contain neither the triangles of a binary header nor text")
    return len(re.findall(rb"\bfacet\s+normal\b", content, re.IGNORECASE))


def _joined_lines(content: bytes) -> bytes:
    """Joins lines continued by a backslash and removes comments."""
    return re.sub(rb"#[^\n]*", b"", content.replace(b"\r\n", b"\n").replace(b"\\\n", b" "))


def with_absolute_indices(content: bytes) -> bytes:
    """Returns an OBJ file whose faces use absolute vertex indices.

    A negative index counts back from the vertices read so far, but trimesh counts back from the end of the file.
    """
    if not re.search(rb"^[ \t]*f[^\n]*-", content, re.MULTILINE):
        return content
    content, vertex_count = _joined_lines(content), 0
    lines = []
    for keyword, rest in _OBJ_LINE.findall(content):
        if keyword == b"v":
            vertex_count += 1
            lines.append(b"v " + rest)
        else:
            corners = (int(corner.split(b"/")[0]) for corner in rest.split())
            lines.append(
                b"f " + b" ".join(b"%d" % (index if index > 0 else vertex_count + 1 + index) for index in corners)
            )
    return b"\n".join(lines) + b"\n"


def _ply(content: bytes) -> int:
    """Counts the triangles of a PLY file from the list lengths of its faces."""
    end = content.index(b"end_header")
    body = content.index(b"\n", end) + 1
    lines = [line.split() for line in content[:end].decode("ascii").splitlines()]
    style = next(line[1] for line in lines if line[:1] == ["format"])
    elements: list[tuple[str, int, list[list[str]]]] = []
    for line in lines:
        if line[:1] == ["element"]:
            elements.append((line[1], int(line[2]), []))
        elif line[:1] == ["property"]:
            elements[-1][2].append(line[1:])
    if style == "ascii":
        return _ply_text(content[body:].split(), elements)
    return _ply_binary(content, body, elements, "<" if style == "binary_little_endian" else ">")


def _ply_text(words: list[bytes], elements: list[tuple[str, int, list[list[str]]]]) -> int:
    offset = triangles = 0
    for name, count, properties in elements:
        if all(item[0] != "list" for item in properties):  # the declared count may be arbitrarily large
            offset += count * len(properties)
            continue
        for _ in range(count):
            for item in properties:
                length = _length(int(words[offset])) if item[0] == "list" else 0
                triangles += length - 2 if name == "face" and item[-1].startswith("vert") else 0
                offset += 1 + length
    if offset > len(words):
        raise ValueError(f"{len(words)} values where the header declares {offset}")
    return triangles


def _length(length: int) -> int:
    if length < 0:
        raise ValueError(f"a list has {length} entries")
    return length


def _ply_binary(content: bytes, offset: int, elements: list[tuple[str, int, list[list[str]]]], order: str) -> int:
    triangles = 0
    for name, count, properties in elements:
        if all(item[0] != "list" for item in properties):
            offset += count * struct.calcsize(order + "".join(_PLY_SIZES[item[0]] for item in properties))
            continue
        for _ in range(count):
            for item in properties:
                if item[0] != "list":
                    offset += struct.calcsize(_PLY_SIZES[item[0]])
                    continue
                length = _length(struct.unpack_from(order + _PLY_SIZES[item[1]], content, offset)[0])
                triangles += length - 2 if name == "face" and item[-1].startswith("vert") else 0
                offset += struct.calcsize(_PLY_SIZES[item[1]]) + length * struct.calcsize(_PLY_SIZES[item[2]])
    if offset > len(content):
        raise ValueError(f"{len(content)} bytes where the header declares {offset}")
    return triangles


def keep_obj_part(content: bytes, name: str) -> tuple[bytes, list[str]]:
    """Returns an OBJ file with the faces of one object or group only, and the names of all parts with faces."""
    names: dict[str, None] = {}
    kept: list[bytes] = []
    current_name = ""
    for line in content.splitlines():
        words = line.split(maxsplit=1)
        if words and words[0] in (b"o", b"g"):
            current_name = words[1].decode(errors="replace").strip() if len(words) > 1 else ""
        if words and words[0] == b"f":
            names[current_name] = None
            if current_name != name:
                continue
        kept.append(line)
    return b"\n".join(kept) + b"\n", list(names)
