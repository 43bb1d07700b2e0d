# SPDX-License-Identifier: BSD-3-Clause
"""Parses the command line that spawns or deletes a simulated object."""

from __future__ import annotations

import argparse
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from modular_framework_core.files.model_files import MODEL_FILE, model_file

_NUMBERS = re.compile(r"[-+0-9.eE,\s]+")


class ObjectRequestError(ValueError):
    """A request to spawn or delete an object is invalid."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ObjectRequest:
    """A request to spawn or delete an object.

    Attributes:
        delete: Whether to delete the object instead of spawning it.
        name: Name of the object in the simulation.
        object_type: Folder of the model, or path of the SDF file.
        sdf_file: SDF file to spawn; None to delete.
        position_m: Position x, y, z in the reference frame [m].
        rpy_rad: Roll, pitch, yaw in the reference frame [rad].
        reference_frame: Reference frame of the pose.
    """

    delete: bool
    name: str
    object_type: str
    sdf_file: Path | None
    position_m: tuple[float, float, float]
    rpy_rad: tuple[float, float, float]
    reference_frame: str


def parse_request(arguments: Sequence[str], model_path: str) -> ObjectRequest:
    """Returns the request in command-line arguments.

    Args:
        arguments: Arguments without the program name; triplets may be separated by spaces or commas.
        model_path: Folders of the models, separated by colons; required to spawn by type.

    Raises:
        ObjectRequestError: An argument is missing or invalid.
    """
    options = _parser().parse_args(_split_triplets(arguments))
    delete = options.delete.lower() == "true"
    file = Path(options.file).expanduser() if options.file else None
    name = options.name or (options.type if not file else options.type or file.resolve().parent.name)
    if not name:
        raise ObjectRequestError(
            "neither a name (-n), a type (-t) nor a file (-f) is given; "
            f"{'give the name of the object to delete' if delete else 'give a type or a file'}"
        )
    sdf_file = None
    if not delete:
        sdf_file = file or _model_file(options.type, model_path)
        if not sdf_file.is_file():
            raise ObjectRequestError(
                f"there is no file '{sdf_file}'; give the path of an SDF file (-f) or a type (-t) "
                f"that is a folder of '{model_path or 'gazebo_model_path'}' with a {MODEL_FILE}"
            )
    return ObjectRequest(
        delete=delete,
        name=name,
        object_type=str(file) if file else options.type or name,
        sdf_file=sdf_file,
        position_m=_triplet("position", options.position),
        rpy_rad=_triplet("orientation", options.orientation),
        reference_frame=options.reference,
    )


def request_to_spawn(
    name: str,
    object_type: str,
    *,
    position_m: Sequence[float],
    rpy_rad: Sequence[float],
    reference_frame: str,
    model_path: str,
) -> ObjectRequest:
    """Returns a request to spawn an object by type.

    Args:
        name: Name of the object.
        object_type: Folder of the model.
        position_m: Position x, y, z in the reference frame [m].
        rpy_rad: Roll, pitch, yaw in the reference frame [rad].
        reference_frame: Reference frame of the pose.
        model_path: Folders of the models, separated by colons.

    Raises:
        ObjectRequestError: The model does not exist, or the pose is not three finite numbers each.
    """
    file = _model_file(object_type, model_path)
    if not file.is_file():
        raise ObjectRequestError(
            f"there is no file '{file}'; the type must be a folder of '{model_path}' with a {MODEL_FILE}"
        )
    return ObjectRequest(
        delete=False,
        name=name,
        object_type=object_type,
        sdf_file=file,
        position_m=_triplet("position", position_m),
        rpy_rad=_triplet("orientation", rpy_rad),
        reference_frame=reference_frame,
    )


def request_to_delete(name: str) -> ObjectRequest:
    """Returns a request to delete an object."""
    return ObjectRequest(
        delete=True,
        name=name,
        object_type=name,
        sdf_file=None,
        position_m=(0.0, 0.0, 0.0),
        rpy_rad=(0.0, 0.0, 0.0),
        reference_frame="world",
    )


def _model_file(object_type: str, model_path: str) -> Path:
    if not object_type:
        raise ObjectRequestError("neither a type (-t) nor a file (-f) is given; give one of them")
    if not model_path:
        raise ObjectRequestError(
            "parameter 'gazebo_model_path' is not set, so the type cannot be found; set it to the "
            "folder of the models, or give a file (-f)"
        )
    return model_file(object_type, model_path)


def _split_triplets(arguments: Sequence[str]) -> list[str]:
    """Splits arguments with several numbers into one argument per number."""
    result: list[str] = []
    for argument in arguments:
        if argument and _NUMBERS.fullmatch(argument):
            result.extend(part for part in re.split(r"[,\s]+", argument) if part)
        else:
            result.append(argument)
    return result


def _triplet(noun: str, values: Sequence[str] | Sequence[float]) -> tuple[float, float, float]:
    try:
        numbers = [float(value) for value in values]
    except ValueError as error:
        raise ObjectRequestError(f"the {noun} is {list(values)}, expected three numbers: {error}") from error
    if len(numbers) != 3 or not all(map(math.isfinite, numbers)):
        raise ObjectRequestError(
            f"the {noun} has the values {numbers}, expected three finite numbers separated by spaces or commas"
        )
    return (numbers[0], numbers[1], numbers[2])


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="manage_object", description="Spawns or deletes an object of the simulation.")
    parser.add_argument(
        "-d",
        "--delete",
        nargs="?",
        const="true",
        default="false",
        choices=["False", "false", "True", "true"],
        help="delete the object instead of spawning it",
    )
    parser.add_argument("-n", "--name", nargs="?", const="", default="", help="name; default: the type")
    parser.add_argument("-t", "--type", nargs="?", const="", default="", help="folder of the model")
    parser.add_argument("-p", "--position", nargs="*", default=["0", "0", "0"], help="x y z [m]")
    parser.add_argument("-o", "--orientation", nargs="*", default=["0", "0", "0"], help="roll pitch yaw [rad]")
    parser.add_argument("-r", "--reference", nargs="?", const="world", default="world", help="reference frame")
    parser.add_argument("-f", "--file", nargs="?", const="", default="", help="SDF file; overrides the type")
    return parser
