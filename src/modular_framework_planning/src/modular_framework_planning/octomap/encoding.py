# SPDX-License-Identifier: BSD-3-Clause
"""Encoding of voxel maps as OctoMap's byte streams (octomap_msgs) and files (.bt, .ot).

Both streams list the nodes of the octree in pre-order; eight equal children are pruned into their parent.
A full stream has for each node its log odds (float32) and one bit per existing child.
A binary stream has for each inner node two bits per child: 1 free leaf, 2 occupied leaf, 3 inner node, 0 unknown.
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
        values: Log odds, for an inner node the maximum over its children; shape (n,).
        children: One bit per existing child, 0 for leaves; shape (n,).
        codes: Two bits per child as in the binary stream, shape (n,).
    """

    def __init__(self, keys: Keys, values: Values) -> None:
        """Builds layers of keys, values, child bits, codes and leaf flags from the voxels upwards."""
        layers: list[tuple[Any, ...]] = [
            (
                keys,
                values,
                np.zeros(len(keys), np.uint8),
                np.zeros(len(keys), np.uint16),
                np.ones(len(keys), dtype=bool),
            )
        ]
        is_kept = [np.ones(len(keys), dtype=bool)]
        for _ in range(LEVELS):
            layer_keys, values, bits, _, is_leaf = layers[-1]
            parents, first = np.unique(layer_keys >> 3, return_index=True)
            parent_index = np.repeat(np.arange(len(parents)), np.diff(np.append(first, len(layer_keys))))
            child = (layer_keys & 7).astype(np.int64)
            highest = np.maximum.reduceat(values, first)
            is_pruned = (np.bincount(parent_index) == 8) & np.logical_and.reduceat(is_leaf, first)
            is_pruned &= np.minimum.reduceat(values, first) == highest
            kinds = np.where(bits > 0, INNER, np.where(values > 0.0, OCCUPIED, FREE))
            mask = np.bincount(parent_index, 1 << child).astype(np.uint8)
            codes = np.bincount(parent_index, kinds << (2 * child)).astype(np.uint16)
            mask[is_pruned], codes[is_pruned] = 0, 0
            is_kept[-1] &= ~is_pruned[parent_index]
            layers.append((parents, highest, mask, codes, is_pruned))
            is_kept.append(np.ones(len(parents), dtype=bool))
        order, parts = [], []
        for level, ((layer_keys, *rest, _), keep) in enumerate(zip(layers, is_kept, strict=True)):
            order.append(((layer_keys[keep] << (3 * level)) << 5) | (LEVELS - level))  # a parent before its first child
            parts.append([part[keep] for part in rest])
        indices = np.argsort(np.concatenate(order), kind="stable")
        self.values, self.children, self.codes = (
            np.concatenate([part[i] for part in parts])[indices] for i in range(3)
        )


def write_full(voxels: VoxelMap) -> bytes:
    """Returns the full stream of a map; empty for an empty map."""
    if not len(voxels.keys):
        return b""
    nodes = _Nodes(voxels.keys, voxels.values)
    stream = np.empty(len(nodes.values), FULL_NODE)
    stream["value"], stream["children"] = nodes.values, nodes.children
    return stream.tobytes()


def write_binary(voxels: VoxelMap) -> bytes:
    """Returns the binary stream of a map, without probabilities; empty for an empty map."""
    return _binary_nodes(voxels)[0]


def _binary_nodes(voxels: VoxelMap) -> tuple[bytes, int]:
    """Returns the binary stream and the number of nodes in the tree."""
    if not len(voxels.keys):
        return b"", 0
    nodes = _Nodes(voxels.keys, np.where(voxels.values > 0.0, HIGHEST, LOWEST).astype(np.float32))
    return nodes.codes[nodes.children > 0].astype("<u2").tobytes(), len(nodes.values)


def read_stream(data: bytes, resolution: float, binary: bool) -> VoxelMap:
    """Decodes a stream into a map.

    Args:
        data: Byte stream.
        resolution: Edge length of the smallest voxel [m].
        binary: Whether the stream is binary instead of full.

    Raises:
        GeometryError: The stream is not a complete tree, or has too many voxels.
    """
    if not data:
        return empty_map(resolution)
    node_bytes = 2 if binary else FULL_NODE.itemsize
    if len(data) % node_bytes:
        raise _broken_stream_error(f"{len(data)} bytes, which is not a multiple of the {node_bytes} bytes of a node")
    if binary:
        codes = np.frombuffer(data, "<u2").astype(np.uint16)
        read, starts, depths, occupied = read_binary(codes, LEVELS)
        values = np.where(occupied, HIGHEST, LOWEST).astype(np.float32)
    else:
        nodes = np.frombuffer(data, FULL_NODE)
        read, starts, depths, indices = read_full(nodes["children"].copy(), LEVELS)
        values = nodes["value"][indices].astype(np.float32)
    count = len(data) // node_bytes
    if read != count:
        raise _broken_stream_error(
            "a tree that is truncated or deeper than 16 levels"
            if read < 0
            else f"{count - read} nodes after the end of the tree"
        )
    if not np.isfinite(values).all():
        raise _broken_stream_error("an occupancy that is not finite")
    return _expanded_map(resolution, starts, depths, np.clip(values, LOWEST, HIGHEST))


def _broken_stream_error(content: str) -> GeometryError:
    return GeometryError(
        f"octomap data: got {content}; expected the pre-order stream of one OcTree; send data written by octomap"
    )


def _expanded_map(resolution: float, starts: Keys, depths: NDArray[np.int64], values: Values) -> VoxelMap:
    """Splits leaves above the lowest level into voxels."""
    counts = np.int64(1) << (3 * (LEVELS - depths))
    total = float(counts.astype(float).sum())
    if total > MAX_VOXELS:
        raise GeometryError(
            f"octomap data: {total:.3g} voxels of {resolution} m; at most {MAX_VOXELS} are allowed; "
            "send a map with larger voxels or less free space"
        )
    order = np.argsort(starts)
    starts, counts, values = starts[order], counts[order], values[order]
    within = np.arange(int(total)) - np.repeat(np.cumsum(counts) - counts, counts)
    return VoxelMap(resolution, np.repeat(starts, counts) + within, np.repeat(values, counts))


def write_file(path: Path, voxels: VoxelMap) -> None:
    """Writes a .bt file atomically; a failure leaves an existing file unchanged.

    Raises:
        OSError: The file cannot be written, or exists and is not an octomap.
    """
    if path.exists() and not (path.is_file() and _first_line(path) in (BINARY_HEADER, FULL_HEADER)):
        raise OSError("the file exists and is not an octomap; only octomaps are overwritten, so give a new path")
    data, nodes = _binary_nodes(voxels)
    header = BINARY_HEADER + f"\nid {TREE_TYPE}\nsize {nodes}\nres {voxels.resolution!r}\ndata\n".encode()
    temporary = path.with_name(f".{uuid.uuid4().hex}.{path.name}")
    try:
        with temporary.open("xb") as file:
            file.write(header + data)
        temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)


def _first_line(path: Path) -> bytes:
    with path.open("rb") as file:
        return file.readline(MAX_HEADER_BYTES).rstrip()


def read_file(path: Path) -> VoxelMap:
    """Reads a .bt or .ot file.

    Raises:
        GeometryError: The file cannot be read, or is not a map of type OcTree.
    """
    try:
        if not path.is_file() or path.stat().st_size > MAX_FILE_BYTES:
            raise OSError(f"not a regular file of at most {MAX_FILE_BYTES} bytes")
        content = path.read_bytes()
    except OSError as error:
        raise GeometryError(
            f"octomap file {path}: cannot be read ({error}); give the path of a readable .bt or .ot file"
        ) from error
    head, separator, data = content.partition(b"\ndata\n")
    first = head.split(b"\n", 1)[0].rstrip()
    if first not in (BINARY_HEADER, FULL_HEADER) or not separator or len(head) > MAX_HEADER_BYTES:
        raise GeometryError(
            f"octomap file {path}: starts with '{first[:40].decode(errors='replace')}'; expected "
            f"'{BINARY_HEADER.decode()}' or '{FULL_HEADER.decode()}', a header and a line 'data'"
        )
    words = [line.split() for line in head.decode(errors="replace").splitlines() if not line.startswith("#")]
    fields = {line[0]: line[1] for line in words if len(line) == 2}
    try:
        resolution, size = float(fields["res"]), int(fields.get("size", "1"))
    except (KeyError, ValueError) as error:
        raise GeometryError(f"octomap file {path}: header {fields}; expected numbers after 'res' and 'size'") from error
    if fields.get("id") != TREE_TYPE:
        raise GeometryError(f"octomap file {path}: tree of type '{fields.get('id')}'; the type must be '{TREE_TYPE}'")
    return read_stream(data if size else b"", resolution, first == BINARY_HEADER)
