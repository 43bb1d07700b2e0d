# SPDX-License-Identifier: BSD-3-Clause
"""Converts visible shapes into files for the physics engine's renderer: one .obj file per material.

The engine's own COLLADA reader ignores the unit and the textures. Converted files are cached in a folder named by a
hash of the mesh and its images.
"""

from __future__ import annotations

import hashlib
import io
import json
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np

from modular_framework_simulation.errors import DescriptionError
from modular_framework_simulation.models.drawn_bodies import (
    Array,
    DrawnBody,
    drawn_box,
    drawn_cylinder,
    drawn_plane,
    drawn_sphere,
)
from modular_framework_simulation.models.mesh_files import load_mesh, write_folder
from modular_framework_simulation.models.sdf_specs import Box, Colour, Cylinder, Mesh, Plane, Sphere, Visual
from modular_framework_urdf import collada

_CACHE_VERSION = "4"
_COLOURS_FILE = "parts.json"
_REFERENCED_FILE = re.compile(rb"<init_from>\s*([^<]+?)\s*</init_from>|^\s*(?:map_Kd|mtllib)\s+(.+?)\s*$", re.MULTILINE)
_WHITE: Colour = (1.0, 1.0, 1.0, 1.0)
_COLLADA_IMAGE = re.compile(rb"<image\b[^>]*>\s*<init_from>\s*([^<]+?)\s*</init_from>")
_MIN_ALPHA = 0.05
"""Minimum opacity; exporters disagree about the meaning of transparency, so an invisible part is drawn opaque."""
_MAX_IMAGE_SIZE_PX = 2048


@dataclass(frozen=True, slots=True)
class DrawnPart:
    """Part of a shape with one material.

    Attributes:
        file: The .obj file, in metres, with its texture in the same folder.
        colour: Plain colour, or the factor of the texture's colours.
    """

    file: Path
    colour: Colour


class VisualMeshes:
    """Converts visible shapes into files of their parts, and caches the files.

    Args:
        cache_folder: Folder of the cache, created when needed.
    """

    def __init__(self, cache_folder: Path) -> None:
        self._cache_folder = cache_folder

    def parts(self, visual: Visual) -> tuple[DrawnPart, ...]:
        """Returns the parts of a visual.

        Raises:
            DescriptionError: The mesh cannot be read.
        """
        folder = self._cache_folder / f"drawn-{self._key(visual)}"
        if not (folder / _COLOURS_FILE).is_file():
            files: dict[str, bytes] = {}
            colours = []
            for index, part in enumerate(drawn_bodies_of(visual)):
                name = f"part_{index:03d}"
                files |= _obj_files(name, part)
                colours.append(part.colour)
            files[_COLOURS_FILE] = json.dumps(colours).encode()
            write_folder(folder, files)
        colours = json.loads((folder / _COLOURS_FILE).read_text(encoding="ascii"))
        red_green_blue_alpha = [(float(r), float(g), float(b), float(a)) for r, g, b, a in colours]
        return tuple(
            DrawnPart(folder / f"part_{index:03d}.obj", colour) for index, colour in enumerate(red_green_blue_alpha)
        )

    @staticmethod
    def _key(visual: Visual) -> str:
        key = hashlib.sha256(f"{_CACHE_VERSION}|{visual.geometry}|{visual.colour}|{visual.own_materials}".encode())
        files = [visual.texture] if visual.texture is not None else []
        if isinstance(visual.geometry, Mesh):
            files += [visual.geometry.path, *referenced_files(visual.geometry.path)]
        for file in files:
            try:
                key.update(file.read_bytes())
            except OSError as error:
                raise DescriptionError(str(file), f"cannot be read ({error})", "give a readable file") from error
        return key.hexdigest()[:24]


def referenced_files(mesh: Path) -> list[Path]:
    """Returns the existing files that the text of a mesh refers to."""
    if mesh.suffix.lower() not in (".dae", ".obj"):
        return []
    try:
        names = [
            (first or second).decode(errors="replace") for first, second in _REFERENCED_FILE.findall(mesh.read_bytes())
        ]
    except OSError:
        return []
    found = [image for name in dict.fromkeys(names) if (image := find_image(mesh, name)) is not None]
    return found + [other for file in found if file.suffix == ".mtl" for other in _images_of_library(mesh, file)]


def _images_of_library(mesh: Path, library: Path) -> list[Path]:
    names = [second.decode(errors="replace") for _, second in _REFERENCED_FILE.findall(library.read_bytes()) if second]
    return [image for name in names if (image := find_image(mesh, name)) is not None]


def find_image(mesh: Path, name: str) -> Path | None:
    """Returns a file that a mesh refers to, in the mesh's folder or the textures of its model; None if missing."""
    plain = unquote(name.removeprefix("file://")).replace("\\", "/").strip()
    base = plain.rpartition("/")[2]
    textures = mesh.parent.parent / "materials" / "textures"
    for candidate in (mesh.parent / plain, mesh.parent / base, textures / base, mesh.parent.parent / "textures" / base):
        if base and candidate.is_file():
            return candidate
    return None


def image_faults(mesh: Path) -> dict[str, str]:
    """Returns the faults of the images and material libraries of a COLLADA or OBJ file, by the name in the file."""
    names, kind = [], mesh.suffix.lower()
    try:
        content = mesh.read_bytes() if kind in (".dae", ".obj") else b""
        if kind == ".dae":
            names = _COLLADA_IMAGE.findall(content)
        elif kind == ".obj":
            names = [second for _, second in _REFERENCED_FILE.findall(content) if second]
            libraries = [library for name in names if (library := find_image(mesh, name.decode(errors="replace")))]
            names += [second for each in libraries for _, second in _REFERENCED_FILE.findall(each.read_bytes())]
    except OSError:
        return {}
    found = {name: find_image(mesh, name) for name in dict.fromkeys(each.decode(errors="replace") for each in names)}
    faults = {name: image_fault(file) for name, file in found.items() if file is None or file.suffix != ".mtl"}
    return {name: fault for name, fault in faults.items() if fault}


def image_fault(file: Path | None) -> str:
    """Returns the fault of an image file, "" for a readable image; None stands for a missing file."""
    from PIL import Image

    if file is None:
        return "does not exist"
    try:
        with Image.open(file):
            return ""
    except (OSError, ValueError, SyntaxError, Image.DecompressionBombError) as error:
        return f"is not a readable image ({type(error).__name__})"


class _MeshFiles:
    """Opens the files that a mesh refers to, as a resolver for trimesh."""

    def __init__(self, mesh: Path) -> None:
        self._mesh = mesh

    def get(self, name: str) -> bytes:
        """Returns the content of a file of the mesh."""
        image = find_image(self._mesh, name)
        if image is None:
            raise FileNotFoundError(name)
        return image.read_bytes()

    def __getitem__(self, name: str) -> bytes:
        """Returns the content of a file; trimesh reads the materials of an .obj file with this method."""
        return self.get(name)


def drawn_bodies_of(visual: Visual) -> list[DrawnBody]:
    """Returns the triangles of a visual, one body per material.

    Raises:
        DescriptionError: The mesh cannot be read.
    """
    image = _open(visual.texture) if visual.texture is not None else None
    match visual.geometry:
        case Plane(normal=normal, size=size):
            return [drawn_plane(np.array(normal), size, visual.colour, image)]
        case Box(size=size):
            return [drawn_box(np.array(size), visual.colour, image)]
        case Cylinder(radius=radius, length=length):
            return [drawn_cylinder(radius, length, visual.colour, image)]
        case Sphere(radius=radius):
            return [drawn_sphere(radius, visual.colour, image)]
        case Mesh() as mesh:
            if not visual.own_materials and image is None:
                whole = load_mesh(mesh)
                return [DrawnBody(whole.vertices, whole.triangles, None, None, visual.colour, None)]
            parts = _own_parts(mesh)
            if visual.own_materials:
                return parts
            return [DrawnBody(p.vertices, p.triangles, p.normals, p.uv, visual.colour, image) for p in parts]
    raise TypeError(f"{type(visual.geometry).__name__} is no geometry")


def _open(path: Path) -> Any:
    from PIL import Image

    try:
        with Image.open(path) as image:
            return image.convert("RGB")
    except (OSError, ValueError, SyntaxError, Image.DecompressionBombError):
        return None


def _own_parts(mesh: Mesh) -> list[DrawnBody]:
    """Returns the parts of a mesh file with the materials of the file."""
    import trimesh

    load_mesh(mesh)  # reports a fault of the file in this package's terms
    kind = mesh.path.suffix.lower().removeprefix(".")
    content, unit = mesh.path.read_bytes(), 1.0
    if kind == "dae":
        root = collada.parse(content, mesh.path.name)
        unit = collada.unit(root)
        if mesh.submesh:
            collada.keep_part(root, mesh.submesh)
        content = collada.to_bytes(root)
    elif mesh.submesh or kind != "obj":
        whole = load_mesh(mesh)
        return [DrawnBody(whole.vertices, whole.triangles, None, None, (0.7, 0.7, 0.7, 1.0), None)]
    files: Any = _MeshFiles(mesh.path)
    loaded: Any = trimesh.load(io.BytesIO(content), file_type=kind, process=False, resolver=files)
    bodies: list[Any] = loaded.dump() if isinstance(loaded, trimesh.Scene) else [loaded]
    bodies = [body for body in bodies if isinstance(body, trimesh.Trimesh) and len(body.faces)]
    shift = np.zeros(3)
    if mesh.center:
        all_vertices = np.concatenate([body.vertices for body in bodies])
        shift = (all_vertices.min(axis=0) + all_vertices.max(axis=0)) / 2
    scale = np.array(mesh.scale)
    return [_part_of(body, unit, scale, shift) for body in bodies]


def _part_of(body: Any, unit: float, scale: Array, shift: Array) -> DrawnBody:
    colour, image = _look_of(body.visual)
    uv = getattr(body.visual, "uv", None)
    if uv is not None and len(uv) != len(body.vertices):
        uv = None
    triangles = np.asarray(body.faces, dtype=np.int64)
    normals = np.asarray(body.vertex_normals, dtype=np.float64) / scale
    if np.prod(scale) < 0:
        triangles = triangles[:, ::-1]
    vertices = (np.asarray(body.vertices, dtype=np.float64) - shift) * unit * scale
    return DrawnBody(vertices, triangles, normals, None if uv is None else np.asarray(uv), colour, image)


def _look_of(look: Any) -> tuple[Colour, Any]:
    """Returns the colour and the texture of a part loaded by trimesh."""
    material = getattr(look, "material", None)
    if material is None:
        return ((0.7, 0.7, 0.7, 1.0), None)
    image = getattr(material, "baseColorTexture", None) or getattr(material, "image", None)
    values = np.asarray(getattr(material, "main_color", (255, 255, 255, 255)), dtype=float) / 255.0
    red, green, blue, alpha = (float(value) for value in values[:4])
    if image is not None:
        return (_WHITE, image.convert("RGB"))
    return ((red, green, blue, alpha if alpha >= _MIN_ALPHA else 1.0), None)


def _obj_files(name: str, part: DrawnBody) -> dict[str, bytes]:
    """Returns the files of a part by name: .obj, and with a texture also .mtl and .png."""
    files: dict[str, bytes] = {}
    lines: list[str] = []
    textured = part.image is not None and part.uv is not None
    if textured:
        image = part.image.copy()
        image.thumbnail((_MAX_IMAGE_SIZE_PX, _MAX_IMAGE_SIZE_PX))
        stream = io.BytesIO()
        image.save(stream, "PNG")
        files[f"{name}.png"] = stream.getvalue()
        files[f"{name}.mtl"] = f"newmtl {name}\nKd 1 1 1\nmap_Kd {name}.png\n".encode()
        lines += [f"mtllib {name}.mtl", f"usemtl {name}"]
    lines += [f"v {x:.9g} {y:.9g} {z:.9g}" for x, y, z in part.vertices]
    if textured and part.uv is not None:
        lines += [f"vt {u:.6g} {v:.6g}" for u, v in part.uv[:, :2]]
    if part.normals is not None:
        lengths = np.linalg.norm(part.normals, axis=1, keepdims=True)
        lines += [f"vn {x:.6g} {y:.6g} {z:.6g}" for x, y, z in part.normals / np.where(lengths > 0, lengths, 1.0)]
    formats = {(True, True): "{0}/{0}/{0}", (True, False): "{0}/{0}", (False, True): "{0}//{0}", (False, False): "{0}"}
    corner = formats[textured, part.normals is not None]
    lines += ["f " + " ".join(corner.format(index + 1) for index in triangle) for triangle in part.triangles]
    files[f"{name}.obj"] = ("\n".join(lines) + "\n").encode("ascii")
    return files
