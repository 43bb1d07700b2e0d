# SPDX-License-Identifier: BSD-3-Clause
"""Writes voxel maps as OctoMap's byte streams and files, and reads them: what octomap_msgs and .bt files hold.

Two streams exist, both pre-order walks of the octree in which eight equal children are pruned into their parent:
full: of each node its log odds (float32) and one bit a child that exists;
binary: of each inner node two bits a child: 1 free leaf, 2 occupied leaf, 3 inner node, 0 unknown.
"""

from __future__ import annotations

import uuid
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from modular_framework_planning.errors import GeometryError
from modular_framework_planning.octomap.compiled_voxels import read_binary, read_full
from modular_framework_planning.octomap.voxel_map import (
    HIGHEST,
    LEVELS,
    LOWEST,
    MAX_VOXELS,
    Keys,
    Values,
    VoxelMap,
    empty_map,
)

TREE_TYPE = "OcTree"
BINARY_HEADER, FULL_HEADER = b"# Octomap OcTree binary file", b"# Octomap OcTree file"
FULL_NODE = np.dtype([("value", "<f4"), ("children", "u1")])
MAX_HEADER_BYTES = 4096
MAX_FILE_BYTES = 500_000_000
FREE, OCCUPIED, INNER = 1, 2, 3


class _Nodes:
    """The nodes of the pruned octree over a map, in pre-order.

    Attributes:
        values: log odds; of an inner node the largest of its children's (n,).
        children: one bit a child that exists (n,); 0 for leaves.
        codes: two bits a child (n,), as in the binary stream.
    """

    def __init__(self, keys: Keys, values: Values) -> None:
        """Builds the layers from the voxels up; a layer holds numbers, values, child bits, codes, and who is a leaf."""
        layers: list[tuple[Any, ...]] = [
            (
                keys,
                values,
                np.zeros(len(keys), np.uint8),
                np.zeros(len(keys), np.uint16),
                np.ones(len(keys), dtype=bool),
            )
        ]
        kept = [np.ones(len(keys), dtype=bool)]
        for _ in range(LEVELS):
            numbers, values, bits, _, is_leaf = layers[-1]
            parents, first = np.unique(numbers >> 3, return_index=True)
            owner = np.repeat(np.arange(len(parents)), np.diff(np.append(first, len(numbers))))
            child = (numbers & 7).astype(np.int64)
            highest = np.maximum.reduceat(values, first)
            same = (np.bincount(owner) == 8) & np.logical_and.reduceat(is_leaf, first)
            same &= np.minimum.reduceat(values, first) == highest
            kinds = np.where(bits > 0, INNER, np.where(values > 0.0, OCCUPIED, FREE))
            mask = np.bincount(owner, 1 << child).astype(np.uint8)
            codes = np.bincount(owner, kinds << (2 * child)).astype(np.uint16)
            mask[same], codes[same] = 0, 0
            kept[-1] &= ~same[owner]
            layers.append((parents, highest, mask, codes, same))
            kept.append(np.ones(len(parents), dtype=bool))
        order, parts = [], []
        for level, ((numbers, *rest, _), keep) in enumerate(zip(layers, kept, strict=True)):
            order.append(((numbers[keep] << (3 * level)) << 5) | (LEVELS - level))  # a parent before its first child
            parts.append([part[keep] for part in rest])
        indices = np.argsort(np.concatenate(order), kind="stable")
        self.values, self.children, self.codes = (
            np.concatenate([part[i] for part in parts])[indices] for i in range(3)
        )


def write_full(voxels: VoxelMap) -> bytes:
    """Returns the full stream of a map; nothing for an empty map."""
    if not len(voxels.keys):
        return b""
    nodes = _Nodes(voxels.keys, voxels.values)
    stream = np.empty(len(nodes.values), FULL_NODE)
    stream["value"], stream["children"] = nodes.values, nodes.children
    return stream.tobytes()


def write_binary(voxels: VoxelMap) -> bytes:
    """Returns the binary stream of a map: free and occupied only; nothing for an empty map."""
    return _binary_nodes(voxels)[0]


def _binary_nodes(voxels: VoxelMap) -> tuple[bytes, int]:
    """The binary stream and how many nodes the tree has."""
    if not len(voxels.keys):
        return b"", 0
    nodes = _Nodes(voxels.keys, np.where(voxels.values > 0.0, HIGHEST, LOWEST).astype(np.float32))
    return nodes.codes[nodes.children > 0].astype("<u2").tobytes(), len(nodes.values)


def read_stream(data: bytes, resolution: float, binary: bool) -> VoxelMap:
    """Returns the map of a stream.

    Args:
        data: the stream.
        resolution: edge length of the smallest voxel [m].
        binary: which of the two streams it is.

    Raises:
        GeometryError: the stream is not a whole tree, or has too many voxels.
    """
    if not data:
        return empty_map(resolution)
    unit = 2 if binary else FULL_NODE.itemsize
    if len(data) % unit:
        raise _broken(f"{len(data)} bytes, which is no multiple of the {unit} bytes of a node")
    if binary:
        codes = np.frombuffer(data, "<u2").astype(np.uint16)
        read, starts, depths, occupied = read_binary(codes, LEVELS)
        values = np.where(occupied, HIGHEST, LOWEST).astype(np.float32)
    else:
        nodes = np.frombuffer(data, FULL_NODE)
        read, starts, depths, indices = read_full(nodes["children"].copy(), LEVELS)
        values = nodes["value"][indices].astype(np.float32)
    count = len(data) // unit
    if read != count:
        raise _broken(
            "a tree that ends early or is deeper than 16 levels"
            if read < 0
            else f"{count - read} nodes after the end of the tree"
        )
    if not np.isfinite(values).all():
        raise _broken("an occupancy that is not finite")
    return _expanded(resolution, starts, depths, np.clip(values, LOWEST, HIGHEST))


def _broken(got: str) -> GeometryError:
    return GeometryError(
        f"octomap data: got {got}; expected the pre-order stream of one OcTree; send the data as octomap writes it"
    )


def _expanded(resolution: float, starts: Keys, depths: NDArray[np.int64], values: Values) -> VoxelMap:
    """Splits leaves above the lowest level into voxels."""
    counts = np.int64(1) << (3 * (LEVELS - depths))
    total = float(counts.astype(float).sum())
    if total > MAX_VOXELS:
        raise GeometryError(
            f"octomap data: {total:.3g} voxels of {resolution} m; allowed are {MAX_VOXELS}; "
            "send a map with larger voxels, or leave out wide free space"
        )
    order = np.argsort(starts)
    starts, counts, values = starts[order], counts[order], values[order]
    within = np.arange(int(total)) - np.repeat(np.cumsum(counts) - counts, counts)
    return VoxelMap(resolution, np.repeat(starts, counts) + within, np.repeat(values, counts))


def write_file(path: Path, voxels: VoxelMap) -> None:
    """Writes a .bt file atomically: an existing file stays as it was if that fails.

    Raises:
        OSError: it cannot be written, or is there already and is no octomap.
    """
    if path.exists() and not (path.is_file() and _first_line(path) in (BINARY_HEADER, FULL_HEADER)):
        raise OSError("it is there already and is no octomap, which alone is overwritten; give the path of a new file")
    data, nodes = _binary_nodes(voxels)
    header = BINARY_HEADER + f"\nid {TREE_TYPE}\nsize {nodes}\nres {voxels.resolution!r}\ndata\n".encode()
    written = path.with_name(f".{uuid.uuid4().hex}.{path.name}")
    try:
        with written.open("xb") as file:
            file.write(header + data)
        written.replace(path)
    finally:
        written.unlink(missing_ok=True)


def _first_line(path: Path) -> bytes:
    with path.open("rb") as file:
        return file.readline(MAX_HEADER_BYTES).rstrip()


def read_file(path: Path) -> VoxelMap:
    """Reads a .bt or .ot file.

    Raises:
        GeometryError: it cannot be read, or is no map of type OcTree.
    """
    try:
        if not path.is_file() or path.stat().st_size > MAX_FILE_BYTES:
            raise OSError(f"no regular file of at most {MAX_FILE_BYTES} bytes")
        content = path.read_bytes()
    except OSError as error:
        raise GeometryError(
            f"octomap file {path}: cannot be read ({error}); give the path of a .bt or .ot file that this node may read"
        ) from error
    head, separator, data = content.partition(b"\ndata\n")
    first = head.split(b"\n", 1)[0].rstrip()
    if first not in (BINARY_HEADER, FULL_HEADER) or not separator or len(head) > MAX_HEADER_BYTES:
        raise GeometryError(
            f"octomap file {path}: begins with '{first[:40].decode(errors='replace')}'; expected "
            f"'{BINARY_HEADER.decode()}' or '{FULL_HEADER.decode()}', a header and a line 'data'"
        )
    words = [line.split() for line in head.decode(errors="replace").splitlines() if not line.startswith("#")]
    fields = {line[0]: line[1] for line in words if len(line) == 2}
    try:
        resolution, size = float(fields["res"]), int(fields.get("size", "1"))
    except (KeyError, ValueError) as error:
        raise GeometryError(f"octomap file {path}: header {fields}; expected numbers after 'res' and 'size'") from error
    if fields.get("id") != TREE_TYPE:
        raise GeometryError(f"octomap file {path}: tree of type '{fields.get('id')}'; allowed is '{TREE_TYPE}'")
    return read_stream(data if size else b"", resolution, first == BINARY_HEADER)
