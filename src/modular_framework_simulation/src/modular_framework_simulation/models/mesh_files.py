# SPDX-License-Identifier: BSD-3-Clause
"""Prepares the meshes of descriptions for the physics engine: exact, as hulls, or decomposed into convex parts.

The engine computes contacts of convex bodies only, so a mesh that is not convex is decomposed by CoACD. That takes
seconds, therefore the parts are kept in a cache folder under a name made of the mesh's own content.
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

_CACHE_VERSION = "3"
_CONCAVITY_THRESHOLD = 0.03
"""CoACD's measure of how much a part may differ from its hull, relative to the size of the mesh."""

_CONVEX_VOLUME_SHARE = 0.985
"""A mesh that fills this share of its convex hull is treated as convex."""


def load_mesh(mesh: Mesh) -> TriangleMesh:
    """Reads a mesh file, triangle for triangle, and scales it.

    Raises:
        DescriptionError: The file cannot be read whole or holds no triangles.
    """
    try:
        return read_mesh(mesh.path, mesh.scale, mesh.submesh, mesh.center)
    except MeshError as error:
        raise DescriptionError(f"mesh file {error.path}", error.found, error.allowed) from error


def default_cache_folder() -> Path:
    """Returns where convex parts are kept: below $ROS_HOME, or ~/.ros without it."""
    home = os.environ.get("ROS_HOME") or str(Path.home() / ".ros")
    return Path(home) / "modular_framework" / "convex_parts"


def _silent(_text: str) -> None:
    """Takes a line and drops it."""


class ConvexParts:
    """Gives the convex parts of meshes as .obj files, from the cache when they are there.

    Args:
        cache_folder: Made when first needed.
        log: Takes a line of text when something begins that may take minutes.
    """

    def __init__(self, cache_folder: Path, log: Callable[[str], None] = _silent) -> None:
        self._cache_folder = cache_folder
        self._log = log

    @property
    def cache_folder(self) -> Path:
        """Where the parts are kept."""
        return self._cache_folder

    def hull(self, mesh: Mesh) -> Path:
        """Returns an .obj file with the convex hull of a mesh.

        Raises:
            DescriptionError: The mesh cannot be read or has no volume.
        """
        return self._cached(mesh, "hull")[0]

    def parts(self, mesh: Mesh) -> tuple[Path, ...]:
        """Returns .obj files of convex parts that together make up the mesh; one if it is convex already.

        Raises:
            DescriptionError: The mesh cannot be read or has no volume.
        """
        return self._cached(mesh, "parts")

    def exact(self, mesh: Mesh) -> Path:
        """Returns an .obj file with the triangles as they are, for bodies that never move."""
        return self._cached(mesh, "exact")[0]

    def _cached(self, mesh: Mesh, kind: str) -> tuple[Path, ...]:
        try:
            content = mesh.path.read_bytes()
        except OSError as error:
            raise DescriptionError(str(mesh.path), f"cannot be read ({error})", "give a readable mesh file") from error
        key = hashlib.sha256(content)
        key.update(f"{mesh.scale}|{mesh.submesh}|{mesh.center}|{kind}|{_CACHE_VERSION}|{_CONCAVITY_THRESHOLD}".encode())
        folder = self._cache_folder / f"{mesh.path.stem}-{kind}-{key.hexdigest()[:20]}"
        if not folder.is_dir():
            parts = enumerate(self._make(mesh, kind))
            write_folder(folder, {f"part_{index:03d}.obj": _obj_text(part).encode("ascii") for index, part in parts})
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
            raise DescriptionError(str(mesh.path), f"has no convex hull ({error})", "expected a solid") from error
        filled = abs(solid.volume) / hull.volume if hull.volume > 0 else 1.0
        if kind == "hull" or filled > _CONVEX_VOLUME_SHARE:
            return [TriangleMesh(np.asarray(hull.vertices), np.asarray(hull.faces))]
        self._log(
            f"cutting {mesh.path} with {len(loaded.triangles):,} triangles into convex parts, which may take minutes; "
            f"they are kept in {self._cache_folder}"
        )
        if not solid.is_volume:  # a hole would make a shell of it, which is cut into many more parts
            repair: Any = trimesh.repair
            repair.fill_holes(solid)
            repair.fix_normals(solid)
        if not solid.is_volume:
            return _within(_decompose(loaded), hull)
        return _decompose(TriangleMesh(np.asarray(solid.vertices), np.asarray(solid.faces)))


def write_folder(folder: Path, files: dict[str, bytes]) -> None:
    """Makes a folder of the cache, whole or not at all.

    Args:
        folder: Its path; what is above it is made too.
        files: Contents by name.

    Raises:
        DescriptionError: There is no room or no permission for it.
    """
    folder.parent.mkdir(parents=True, exist_ok=True)
    scratch = folder.with_name(f".{uuid.uuid4().hex}")
    scratch.mkdir()
    try:
        for name, content in files.items():
            (scratch / name).write_bytes(content)
        scratch.rename(folder)
    except OSError as error:
        if not folder.is_dir():  # else another process finished the same mesh first; its result is as good as ours
            raise DescriptionError(
                str(folder),
                f"cannot be written ({error.strerror})",
                "free space, or set ROS_HOME to a folder that has some",
            ) from error
    finally:
        shutil.rmtree(scratch, ignore_errors=True)  # it is gone when all went well


def _decompose(mesh: TriangleMesh) -> list[TriangleMesh]:
    import coacd  # loading it takes long and most worlds never need it

    coacd.set_log_level("error")
    pieces = coacd.run_coacd(coacd.Mesh(mesh.vertices, mesh.triangles), threshold=_CONCAVITY_THRESHOLD, seed=1)
    return [TriangleMesh(np.asarray(vertices), np.asarray(faces)) for vertices, faces in pieces]


def _within(parts: list[TriangleMesh], hull: Any) -> list[TriangleMesh]:
    """Returns what of convex parts is inside the hull of their mesh.

    CoACD closes an open mesh with a skin of voxels, which stands out by a hundredth of the mesh's size.
    """
    import trimesh

    clipped = []
    for part in parts:
        solid = trimesh.Trimesh(part.vertices, part.triangles).convex_hull
        inside = trimesh.boolean.intersection([solid, hull], engine="manifold", check_volume=False)
        if len(inside.faces):
            inside = inside.convex_hull  # which it is already, but for rounding
            clipped.append(TriangleMesh(np.asarray(inside.vertices), np.asarray(inside.faces)))
    return clipped


def _obj_text(mesh: TriangleMesh) -> str:
    lines = [f"v {x:.9g} {y:.9g} {z:.9g}" for x, y, z in mesh.vertices]
    lines += [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in mesh.triangles]
    return "\n".join(lines) + "\n"
