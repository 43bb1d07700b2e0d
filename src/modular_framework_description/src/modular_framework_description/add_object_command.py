# SPDX-License-Identifier: BSD-3-Clause
"""Adds an object of your lab: makes a model from a mesh file, which tasks and experiments take by name.

The model is a folder with model.sdf, model.config, meshes, a scene for the planner, object.yaml and check.html. The
command checks the mesh and never changes an existing model without --force.
"""

from __future__ import annotations

import argparse
import math
import re
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

import yaml

from modular_framework_core.files.default_folders import MODEL_PATH_VARIABLE, model_search_path, models_folder
from modular_framework_description.gripper_openings import installed_grippers
from modular_framework_description.model_writer import write_mesh_body
from modular_framework_description.object_mesh import (
    ObjectError,
    ObjectMesh,
    read_object_mesh,
    solid_properties,
    write_shapes,
)
from modular_framework_description.object_page import check_page
from modular_framework_description.object_record import ObjectRecord
from modular_framework_description.object_warnings import object_warnings
from modular_framework_description.solids import MeshBody
from modular_framework_description.stable_poses import stable_poses
from modular_framework_simulation.errors import DescriptionError
from modular_framework_simulation.models.mesh_files import ConvexParts
from modular_framework_urdf.mesh_reader import MeshError, read_mesh

_NAME = re.compile(r"[a-z][a-z0-9_]*")
RECORD_FILE, PAGE_FILE = "object.yaml", "check.html"
MAX_MASS_KG, MAX_DENSITY, MAX_FRICTION = 100.0, 1e5, 10.0
DEFAULT_FRICTION, DEFAULT_COLOUR = 0.8, (0.7, 0.7, 0.7)


def main(arguments: Sequence[str] | None = None) -> int:
    """Adds an object and returns the exit code."""
    parser = argparse.ArgumentParser(prog="add_object", description=__doc__)
    _add_arguments(parser)
    args = parser.parse_args(arguments)
    try:
        _add_object(args)
    except (ObjectError, MeshError, DescriptionError, OSError) as error:
        print(f"add_object: {error}", file=sys.stderr)
        return 1
    return 0


def _add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("mesh", type=Path, help="STL, OBJ, DAE or PLY file")
    parser.add_argument("--name", help="name of the model; default: the name of the file")
    parser.add_argument("--mass", type=float, metavar="KG", help="mass of the object")
    parser.add_argument("--density", type=float, metavar="KG/M3", help="density, if the mass is not known")
    parser.add_argument("--scale", type=float, default=1.0, help="factor to metres; 0.001 for a file in millimetres")
    parser.add_argument(
        "--friction", type=float, default=DEFAULT_FRICTION, help=f"Coulomb coefficient; default: {DEFAULT_FRICTION}"
    )
    parser.add_argument(
        "--colour", type=float, nargs=3, default=DEFAULT_COLOUR, metavar=("R", "G", "B"), help="each from 0 to 1"
    )
    parser.add_argument("--description", default="", help="sentence for model.config")
    parser.add_argument(
        "--directory", type=Path, help=f"folder of models; default: the first of {MODEL_PATH_VARIABLE}, or ./models"
    )
    parser.add_argument("--force", action="store_true", help="replace the model of this name in the folder")


def _add_object(args: argparse.Namespace) -> None:
    name = _checked_name(args)
    _check_numbers(args)
    directory = (args.directory or _default_directory()).expanduser().resolve()
    _check_free(name, directory, args.force)
    item = read_object_mesh(args.mesh, args.scale)
    if not item.is_closed and args.mass is None:
        raise ObjectError(
            f"{args.mesh}: the mesh is not watertight, so a density gives no mass; weigh the object and give --mass, "
            "or close the mesh"
        )
    directory.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix=".add_object_", dir=directory) as scratch:
        folder = Path(scratch) / name
        record = _write_model(args, item, folder)
        (folder / PAGE_FILE).write_text(check_page(record, "\n".join(_use_lines(record, directory))), encoding="utf-8")
        if (directory / name).exists():
            (directory / name).rename(Path(scratch) / "replaced")
        folder.rename(directory / name)
    _report(record, directory)


def _write_model(args: argparse.Namespace, item: ObjectMesh, folder: Path) -> ObjectRecord:
    """Writes the files of a model except the check page into a new folder, and returns the properties of the object."""
    name, meshes = folder.name, folder / "meshes"
    meshes.mkdir(parents=True)
    visual, parts = write_shapes(item, meshes, ConvexParts(folder.parent / "parts", _note))
    files = [meshes / file for file in ((visual,) if item.is_closed else parts)]
    solid = solid_properties(files, args.mass, args.density)
    grippers = installed_grippers()
    poses = stable_poses(item.mesh.vertices, solid.properties.centre)
    record = ObjectRecord(
        name, args.mesh.name, args.scale, args.friction, item, solid,
        tuple(read_mesh(meshes / part) for part in parts),
        poses, grippers, tuple(object_warnings(item, solid, len(parts), poses, grippers)),
    )  # fmt: skip
    description = args.description or f"Made from {args.mesh.name} by add_object."
    colour = (args.colour[0], args.colour[1], args.colour[2])
    write_mesh_body(MeshBody(name, description, solid.properties, args.friction, colour, visual, parts), folder)
    (folder / f"{name}.scene").write_text(record.scene(), encoding="utf-8")
    (folder / RECORD_FILE).write_text(yaml.safe_dump(record.summary(), sort_keys=False), encoding="utf-8")
    return record


def _note(text: str) -> None:
    print(f"note: {text.partition(';')[0]}", file=sys.stderr)


def _checked_name(args: argparse.Namespace) -> str:
    name = args.name or re.sub(r"^[^a-z]+|_+$", "", re.sub(r"[^a-z0-9]+", "_", args.mesh.stem.lower()))
    if not _NAME.fullmatch(name):
        raise ObjectError(f"--name is '{name}'; allowed: lower-case letters, digits and '_', a letter first")
    return str(name)


def _check_numbers(args: argparse.Namespace) -> None:
    if args.mass is None and args.density is None:
        raise ObjectError(
            "neither --mass nor --density is given; weigh the object and give --mass [kg], or give --density [kg/m^3], "
            "such as 1240 for PLA or 700 for beech"
        )
    if args.mass is not None and args.density is not None:
        raise ObjectError("--mass and --density are given; give only one of them")
    ranges = (("mass", MAX_MASS_KG, "kg"), ("density", MAX_DENSITY, "kg/m^3"), ("friction", MAX_FRICTION, ""))
    for key, greatest, unit in ranges:
        value = getattr(args, key)
        if value is not None and not 0.0 < value <= greatest:
            raise ObjectError(f"--{key} is {value:g}; allowed: more than 0, up to {greatest:g} {unit}".rstrip())
    if not all(0.0 <= value <= 1.0 and math.isfinite(value) for value in args.colour):
        raise ObjectError(f"--colour is {' '.join(f'{value:g}' for value in args.colour)}; allowed: 0 to 1 each")


def _environment_folders() -> tuple[Path, ...]:
    return model_search_path(Path())[1:]


def _default_directory() -> Path:
    folders = _environment_folders()
    return folders[0] if folders else Path("models")


def _check_free(name: str, directory: Path, force: bool) -> None:
    """Raises ObjectError if another model has the name."""
    own, shipped = directory / name, models_folder()
    folders = ([shipped] if shipped else []) + list(_environment_folders())
    for folder in folders:
        if (folder / name).exists() and (folder / name).resolve() != own.resolve():
            raise ObjectError(f"the name '{name}' is taken by the model {folder / name}; give another --name")
    if not own.exists():
        return
    if not (own / RECORD_FILE).is_file():
        raise ObjectError(f"{own} exists and is no model of add_object; give another --name or --directory")
    if not force:
        raise ObjectError(f"the model {own} exists; give another --name, or --force to replace it")


def _use_lines(record: ObjectRecord, directory: Path) -> list[str]:
    lines = []
    if directory not in [folder.expanduser().resolve() for folder in _environment_folders()]:
        lines.append(f"export {MODEL_PATH_VARIABLE}={directory}:${MODEL_PATH_VARIABLE}")
    best = record.poses[0] if record.poses else None
    pose = f", roll: {best.roll:.4f}, pitch: {best.pitch:.4f}" if best and (best.roll or best.pitch) else ""
    lines.append(f"objects: [{{model: {record.name}, x: [-0.2, 0.2], y: 0.5{pose}, rests_at: 0.84}}]")
    return lines


def _report(record: ObjectRecord, directory: Path) -> None:
    item, properties = record.item, record.solid.properties
    x, y, z = item.sides
    print(f"{record.name}: {x:.4f} x {y:.4f} x {z:.4f} m, {properties.mass:.4g} kg, {len(record.parts)} convex parts")
    for pose in record.listed_poses[:6]:
        print(f"stable: {100 * pose.probability:5.1f} %  roll {pose.roll:.4f}, pitch {pose.pitch:.4f} rad")
    for text in record.warnings:
        print(f"warning: {text}")
    print(
        f"created {directory / record.name}; check the page {directory / record.name / PAGE_FILE}; use the object with"
    )
    for line in _use_lines(record, directory):
        print(f"    {line}")
