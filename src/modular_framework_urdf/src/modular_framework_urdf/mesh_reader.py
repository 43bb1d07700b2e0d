# SPDX-License-Identifier: BSD-3-Clause
"""Reads collision meshes, with one reader for planning, simulation and clients, so that all use the same shapes."""

from __future__ import annotations

import io
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from modular_framework_urdf import collada
from modular_framework_urdf.declared_triangles import (
    FORMATS,
    STL_HEADER,
    declared_triangles,
    is_binary_stl,
    keep_obj_part,
    with_absolute_indices,
)
from modular_framework_urdf.lengths import MAX_LENGTH_M

ALLOWED = (*FORMATS, "dae")
BINARY_STL = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attributes", "<u2")])
Scale = tuple[float, float, float]


class MeshError(Exception):
    """A mesh file is invalid.

    Args:
        path: Path or URI of the file.
        found: Fault.
        allowed: Allowed content and remedy.
    """

    def __init__(self, path: Path | str, found: str, allowed: str) -> None:
        super().__init__(f"mesh file {path}: {found}; {allowed}")
        self.path, self.found, self.allowed = path, found, allowed


@dataclass(frozen=True, slots=True, eq=False)
class TriangleMesh:
    """Triangles in the shape frame.

    Attributes:
        vertices: Distinct vertices, shape (n, 3) [m].
        triangles: Vertex indices, shape (m, 3), counter-clockwise as seen from outside.
    """

    vertices: NDArray[np.float64]
    triangles: NDArray[np.int64]


def read_mesh(path: str | Path, scale: Scale = (1.0, 1.0, 1.0), part: str = "", centred: bool = False) -> TriangleMesh:
    """Reads all triangles of a mesh file or of a part of the file.

    Args:
        path: STL, OBJ, PLY or COLLADA file.
        scale: Scale factors along x, y and z; negative factors mirror the mesh.
        part: COLLADA node or OBJ group to read; "" for the whole file.
        centred: Whether to move the centre of the bounding box to the origin.

    Raises:
        MeshError: The file cannot be read, contains no triangle, or could not be read completely.
    """
    path = Path(path)
    factors = np.array(scale, dtype=float)
    if factors.shape != (3,) or not np.isfinite(factors).all() or not factors.all():
        raise MeshError(path, f"scale is {list(scale)}", "allowed: three finite numbers, none of them 0")
    declared, unit, (vertices, triangles) = _read(path, part)
    if len(triangles) != declared:
        raise MeshError(
            path,
            f"only {len(triangles)} of the {declared} declared triangles could be read",
            "all are required; export the mesh again as plain triangles",
        )
    if declared == 0:
        raise MeshError(path, "contains no triangle", "at least one is required; give a triangle mesh")
    if not np.isfinite(vertices).all():
        raise MeshError(path, "a vertex is not finite", "every coordinate must be a finite number; correct the file")
    if centred:
        vertices = vertices - (vertices.min(axis=0) + vertices.max(axis=0)) / 2
    vertices, triangles = _merge_vertices(vertices * (unit * factors), triangles)
    if np.abs(vertices).max() > MAX_LENGTH_M:
        raise MeshError(
            path,
            f"a vertex is {np.abs(vertices).max():.3g} m from the origin",
            f"allowed: at most {MAX_LENGTH_M:g} m; correct the file, its unit or the scale",
        )
    return TriangleMesh(vertices, triangles if np.prod(factors) > 0.0 else np.ascontiguousarray(triangles[:, ::-1]))


class _Content(NamedTuple):
    """Declared number of triangles, unit [m], and vertices with triangles of a file."""

    declared: int
    unit: float
    mesh: tuple[NDArray[np.float64], NDArray[np.int64]]


def _read(path: Path, part: str) -> _Content:
    kind = path.suffix.lower().removeprefix(".")
    if kind not in ALLOWED:
        raise MeshError(path, f"is a '{path.suffix}' file", f"allowed: {', '.join(ALLOWED)}; convert the mesh")
    try:
        content = path.read_bytes()
        if kind == "dae":
            root = collada.parse(content, path.name)
            if part:
                _require_part(path, part, collada.keep_part(root, part))
            return _Content(collada.triangles(root), collada.unit(root), _load("dae", collada.without_materials(root)))
        if part:
            if kind != "obj":
                raise MeshError(path, f"has no part '{part}'", "allowed: parts of dae and obj files")
            content, names = keep_obj_part(content, part)
            _require_part(path, part, names)
        declared = declared_triangles(kind, content)
        if kind == "stl" and is_binary_stl(content):  # the common case needs no trimesh, whose import takes 0.6 s
            corners = np.frombuffer(content, BINARY_STL, offset=STL_HEADER)["corners"]
            return _Content(declared, 1.0, _corners(corners))
        return _Content(declared, 1.0, _load(kind, with_absolute_indices(content) if kind == "obj" else content))
    except MeshError:
        raise
    except OSError as error:
        raise MeshError(path, f"cannot be read ({error})", "give an existing, readable mesh file") from error
    except Exception as error:  # noqa: BLE001 - the readers behind trimesh can raise anything for an invalid file
        raise MeshError(
            path,
            f"is not a complete {kind.upper()} file ({type(error).__name__}: {error})",
            f"allowed: well-formed {', '.join(ALLOWED)}; export the mesh again",
        ) from error


def _require_part(path: Path, part: str, names: list[str]) -> None:
    if part not in names:
        raise MeshError(path, f"has no part '{part}'", f"allowed: {', '.join(names) or 'none, it has no named parts'}")


def _load(kind: str, content: bytes) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Returns vertices and triangles of all parts, read by trimesh, in the unit of the file."""
    import trimesh  # slow import

    options: dict[str, Any] = {"skip_materials": True} if kind == "obj" else {}
    loaded: Any = trimesh.load(io.BytesIO(content), file_type=kind, process=False, **options)
    parts = loaded.dump() if isinstance(loaded, trimesh.Scene) else [loaded]
    corners = [
        np.asarray(part.vertices, dtype=np.float64)[np.asarray(part.faces, dtype=np.int64)]
        for part in parts
        if isinstance(part, trimesh.Trimesh) and len(part.faces)
    ]
    return _corners(np.concatenate([np.zeros((0, 3, 3)), *corners]))


def _corners(corners: NDArray[Any]) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Returns vertices and triangles from the corners of triangles, shape (m, 3, 3)."""
    vertices = corners.reshape(-1, 3).astype(np.float64)
    return vertices, np.arange(len(vertices)).reshape(-1, 3)


def _merge_vertices(
    vertices: NDArray[np.float64], triangles: NDArray[np.int64]
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Merges vertices at the same position."""
    unique, indices = np.unique(vertices + 0.0, axis=0, return_inverse=True)
    return np.ascontiguousarray(unique), np.asarray(indices.reshape(-1)[triangles], dtype=np.int64)
