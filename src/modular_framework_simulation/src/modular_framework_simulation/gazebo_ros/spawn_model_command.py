# SPDX-License-Identifier: BSD-3-Clause
"""Reads the command line of spawn_model, the tool that adds a model to a running simulation."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum

from modular_framework_simulation.models.poses import Pose


@dataclass(frozen=True, slots=True)
class SpawnCommand:
    """Parsed command line of spawn_model.

    Attributes:
        model: Name of the model in the world.
        format: Format of the description.
        source: Kind of the description's source.
        source_name: File, parameter or model folder; empty for stdin.
        pose: Pose of the model in the reference frame.
        reference_frame: Model or "model::link"; empty for the world.
        namespace: Namespace of the model's ROS interfaces; empty if not given.
        gazebo_namespace: Namespace of the simulation's services.
        package_to_model: Whether meshes with package:// URIs are searched in the model folders.
        joints: Joint positions after the spawn, by joint name [rad or m].
        wait_for: Model to wait for before the spawn; empty for none.
        unpause: Whether time is unpaused after the spawn.
        bond: Whether the model is deleted when the tool ends.
    """

    model: str
    format: Format
    source: Source
    source_name: str
    pose: Pose
    reference_frame: str
    namespace: str
    gazebo_namespace: str
    package_to_model: bool
    joints: dict[str, float]
    wait_for: str
    unpause: bool
    bond: bool


class Format(Enum):
    """Format of a model description."""

    SDF = "sdf"
    URDF = "urdf"


class Source(Enum):
    """Kind of a model description's source."""

    FILE = "file"
    PARAM = "param"
    DATABASE = "database"
    STDIN = "stdin"


def parse_spawn_command(arguments: Sequence[str]) -> SpawnCommand:
    """Parses the arguments after the name of the program.

    Raises:
        SystemExit: The arguments are invalid; the reason has been printed.
    """
    parser = argparse.ArgumentParser("spawn_model", description="Adds a model to the running simulation.")
    language = parser.add_mutually_exclusive_group(required=True)
    language.add_argument("-sdf", dest="format", action="store_const", const=Format.SDF, help="the model is SDF")
    language.add_argument("-urdf", dest="format", action="store_const", const=Format.URDF, help="the model is URDF")
    source = parser.add_mutually_exclusive_group(required=True)
    source.add_argument("-file", metavar="PATH", help="file with the model")
    source.add_argument("-param", metavar="NAME", help="parameter with the model")
    source.add_argument("-database", metavar="NAME", help="folder of the model below gazebo_model_path")
    source.add_argument("-stdin", action="store_const", const="", help="read the model from the standard input")
    parser.add_argument("-model", required=True, metavar="NAME", help="name of the model in the simulation")
    parser.add_argument("-reference_frame", default="", metavar="FRAME", help="model or model::link of the pose")
    parser.add_argument("-robot_namespace", default="", metavar="NS", help="namespace of the model's ROS interfaces")
    parser.add_argument(
        "-gazebo_namespace", default="/gazebo", metavar="NS", help="namespace of the services, default /gazebo"
    )
    parser.add_argument(
        "-package_to_model", action="store_true", help="search meshes with package:// URIs in the model folders"
    )
    for name in ("x", "y", "z"):
        parser.add_argument(f"-{name}", type=float, default=0.0, help="position [m], default 0")
    for name, meaning in (("R", "roll"), ("P", "pitch"), ("Y", "yaw")):
        parser.add_argument(f"-{name}", type=float, default=0.0, help=f"{meaning} [rad], default 0")
    parser.add_argument("-J", nargs=2, action="append", default=[], metavar=("JOINT", "VALUE"), help="joint position")
    parser.add_argument("-wait", default="", metavar="MODEL", help="wait for this model first")
    parser.add_argument("-unpause", action="store_true", help="unpause time after the spawn")
    parser.add_argument("-b", "-bond", dest="bond", action="store_true", help="delete the model when this program ends")
    options = parser.parse_args(arguments)
    joints: dict[str, float] = {}
    for joint, value in options.J:
        try:
            joints[joint] = float(value)
        except ValueError:
            parser.error(f"argument -J: joint '{joint}': got '{value}', expected a number")
    chosen = next(each for each in Source if getattr(options, each.value) is not None)
    return SpawnCommand(
        model=options.model,
        format=options.format,
        source=chosen,
        source_name=getattr(options, chosen.value),
        pose=Pose.from_xyz_rpy((options.x, options.y, options.z), (options.R, options.P, options.Y)),
        reference_frame=options.reference_frame,
        namespace=options.robot_namespace,
        gazebo_namespace=options.gazebo_namespace,
        package_to_model=options.package_to_model,
        joints=joints,
        wait_for=options.wait,
        unpause=options.unpause,
        bond=options.bond,
    )
