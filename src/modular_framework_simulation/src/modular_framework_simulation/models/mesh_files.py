# SPDX-License-Identifier: BSD-3-Clause
"""Converts meshes for the physics engine: exact triangles, convex hulls or convex parts.

The engine computes contacts of convex bodies only, so CoACD decomposes every non-convex mesh. A decomposition takes
seconds; the parts are cached in a folder named by a hash of the mesh.
"""

from __future__ import annotations

import hashlib
import os
import shutil
import uuid
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from modular_framework_simulation.errors import DescriptionError
from modular_framework_simulation.models.sdf_specs import Mesh
from modular_framework_urdf.mesh_reader import MeshError, TriangleMesh, read_mesh

_CACHE_VERSION = "4"
_CONCAVITY_THRESHOLD = 0.03
"""CoACD's limit of the concavity of a part, relative to the size of the mesh."""

_FINE_TRIANGLES = 5000
"""Number of triangles above which a closed mesh is simplified before its decomposition."""
_SIMPLIFICATION_TOLERANCE = 0.003
"""Maximum deviation of a simplified mesh, as a fraction of the longest side: a tenth of the limit of the concavity."""

_MIN_CONVEX_VOLUME_RATIO = 0.985
"""Minimum ratio of a mesh's volume to its convex hull's volume for a mesh that is treated as convex."""


def load_mesh(mesh: Mesh) -> TriangleMesh:
    """Reads and scales a mesh file without other changes to the triangles.

    Raises:
        DescriptionError: The file cannot be read completely, or has no triangles.
    """
    try:
        return read_mesh(mesh.path, mesh.scale, mesh.submesh, mesh.center)
    except MeshError as error:
        raise DescriptionError(mesh.place, error.found, error.allowed) from error


def default_cache_folder() -> Path:
    """Returns the default cache folder of convex parts, below $ROS_HOME or ~/.ros."""
    home = os.environ.get("ROS_HOME") or str(Path.home() / ".ros")
    return Path(home) / "modular_framework" / "convex_parts"


def _ignore_log(_text: str) -> None:
    """Discards a message."""


class ConvexParts:
    """Converts meshes into .obj files of convex parts, and caches the files.

    Args:
        cache_folder: Folder of the cache, created when needed.
        log: Function that logs a message before a step that may take minutes.
    """

    def __init__(self, cache_folder: Path, log: Callable[[str], None] = _ignore_log) -> None:
        self._cache_folder = cache_folder
        self._log = log

    @property
    def cache_folder(self) -> Path:
        """Returns the folder of the cache."""
        return self._cache_folder

    def hull(self, mesh: Mesh) -> Path:
        """Returns the .obj file of the convex hull of a mesh.

        Raises:
            DescriptionError: The mesh cannot be read or has no volume.
        """
        return self._cached_files(mesh, "hull")[0]

    def parts(self, mesh: Mesh) -> tuple[Path, ...]:
        """Returns the .obj files of the convex parts of a mesh; a single file for a convex mesh.

        Raises:
            DescriptionError: The mesh cannot be read or has no volume.
        """
        return self._cached_files(mesh, "parts")

    def exact(self, mesh: Mesh) -> Path:
        """Returns the .obj file of a mesh with unchanged triangles, for static bodies."""
        return self._cached_files(mesh, "exact")[0]

    def _cached_files(self, mesh: Mesh, kind: str) -> tuple[Path, ...]:
        try:
            content = mesh.path.read_bytes()
        except OSError as error:
            raise DescriptionError(mesh.place, f"cannot be read ({error})", "give a readable mesh file") from error
        key = hashlib.sha256(content)
        key.update(f"{mesh.scale}|{mesh.submesh}|{mesh.center}|{kind}|{_CACHE_VERSION}|{_CONCAVITY_THRESHOLD}".encode())
        folder = self._cache_folder / f"{mesh.path.stem}-{kind}-{key.hexdigest()[:20]}"
        if not folder.is_dir():
            parts = enumerate(self._make(mesh, kind))
            write_folder(folder, {f"part_{index:03d}.obj": obj_text(part).encode("ascii") for index, part in parts})
        return tuple(sorted(folder.glob("*.obj")))

    def _make(self, mesh: Mesh, kind: str) -> list[TriangleMesh]:
        import trimesh

        loaded = load_mesh(mesh)
        if kind == "exact":
            return [loaded]
        try:
            solid = trimesh.Trimesh(loaded.vertices, loaded.triangles)
            hull = solid.convex_hull
        except Exception as error:  # qhull reports flat point sets by its own exceptions
            reason = str(error).strip().partition("\n")[0]
            advice = "expected a solid; export the mesh again, or correct its <scale>"
            raise DescriptionError(mesh.place, f"has no convex hull ({reason})", advice) from error
        volume_ratio = abs(solid.volume) / hull.volume if hull.volume > 0 else 1.0
        if kind == "hull" or volume_ratio > _MIN_CONVEX_VOLUME_RATIO:
            return [TriangleMesh(np.asarray(hull.vertices), np.asarray(hull.faces))]
        if not solid.is_volume:  # CoACD would decompose an open mesh as a shell, into many more parts
            repair: Any = trimesh.repair
            repair.fill_holes(solid)
            repair.fix_normals(solid)
        is_closed = solid.is_volume
        cut = _simplified(TriangleMesh(np.asarray(solid.vertices), np.asarray(solid.faces))) if is_closed else loaded
        simplified = f", simplified to {len(cut.triangles):,}," if len(cut.triangles) < len(solid.faces) else ""
        self._log(
            f"decomposing {mesh.path} with {len(loaded.triangles):,} triangles{simplified} into convex parts, "
            f"which may take minutes; the parts are cached in {self._cache_folder}"
        )
        return _decompose(cut) if is_closed else _clipped_to(_decompose(cut), hull)


def write_folder(folder: Path, files: dict[str, bytes]) -> None:
    """Creates a folder of the cache, completely or not at all.

    Args:
        folder: Path of the folder; missing parent folders are created.
        files: Contents by file name.

    Raises:
        DescriptionError: The disk is full or the folder is not writable.
    """
    folder.parent.mkdir(parents=True, exist_ok=True)
    scratch = folder.with_name(f".{uuid.uuid4().hex}")
    scratch.mkdir()
    try:
        for name, content in files.items():
            (scratch / name).write_bytes(content)
        scratch.rename(folder)
    except OSError as error:
        if not folder.is_dir():  # otherwise another process has created the same folder
            raise DescriptionError(
                str(folder),
                f"cannot be written ({error.strerror})",
                "free disk space, or set ROS_HOME to a folder on another disk",
            ) from error
    finally:
        shutil.rmtree(scratch, ignore_errors=True)  # missing after a success, which has renamed the folder


def _decompose(mesh: TriangleMesh) -> list[TriangleMesh]:
    import coacd  # slow to import, and most worlds do not need decomposition

    coacd.set_log_level("error")
    pieces = coacd.run_coacd(coacd.Mesh(mesh.vertices, mesh.triangles), threshold=_CONCAVITY_THRESHOLD, seed=1)
    return [TriangleMesh(np.asarray(vertices), np.asarray(faces)) for vertices, faces in pieces]


def _simplified(mesh: TriangleMesh) -> TriangleMesh:
    """Returns a closed mesh with the same shape and fewer triangles, which CoACD decomposes in less time.

    Args:
        mesh: Closed mesh; a mesh of at most _FINE_TRIANGLES triangles is returned unchanged.
    """
    if len(mesh.triangles) <= _FINE_TRIANGLES:
        return mesh
    import manifold3d

    solid = manifold3d.Manifold(
        manifold3d.Mesh64(vert_properties=mesh.vertices, tri_verts=mesh.triangles.astype(np.uint64))
    )
    simple = solid.simplify(_SIMPLIFICATION_TOLERANCE * float(np.ptp(mesh.vertices, axis=0).max())).to_mesh64()
    triangles = np.asarray(simple.tri_verts, dtype=np.int64)
    if solid.status() != manifold3d.Error.NoError or not len(triangles):  # for example, triangles that share an edge
        return mesh
    return TriangleMesh(np.asarray(simple.vert_properties)[:, :3], triangles)


def _clipped_to(parts: list[TriangleMesh], hull: Any) -> list[TriangleMesh]:
    """Clips convex parts to the hull of their mesh.

    CoACD closes an open mesh with a layer of voxels, which protrudes by about 1 % of the mesh's size.
    """
    import trimesh

    clipped = []
    for part in parts:
        solid = trimesh.Trimesh(part.vertices, part.triangles).convex_hull
        inside = trimesh.boolean.intersection([solid, hull], engine="manifold", check_volume=False)
        if len(inside.faces):
            inside = inside.convex_hull  # corrects rounding errors; the intersection of convex parts is convex
            clipped.append(TriangleMesh(np.asarray(inside.vertices), np.asarray(inside.faces)))
    return clipped


def obj_text(mesh: TriangleMesh) -> str:
    """Returns the text of an OBJ file with nine significant digits."""
    lines = [f"v {x:.9g} {y:.9g} {z:.9g}" for x, y, z in mesh.vertices]
    lines += [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in mesh.triangles]
    return "\n".join(lines) + "\n"
