# SPDX-License-Identifier: BSD-3-Clause
"""Reads the parameters of the simulation node, and checks them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import rospy

from modular_framework_ros.node_handle import ParameterError
from modular_framework_simulation.gazebo_ros.starting_pose import parse_starting_pose
from modular_framework_simulation.physics.engine_choice import ENGINES, PYBULLET
from modular_framework_simulation.physics.physics_settings import LONGEST_STEP_NS, SHORTEST_STEP_NS, PhysicsSettings


@dataclass(frozen=True, slots=True)
class SimulationParameters:
    """Parameters of the simulation node.

    Attributes:
        robot_description: `robot_description`: URDF; empty for a world without a robot.
        model_path: `gazebo_model_path`: folders with one folder a model, separated by colons.
        world_file: `~world_file`: path of a .world file, or below GAZEBO_RESOURCE_PATH; empty for an empty world.
        starting_positions: `~starting_pose`: "-J joint value ..." [rad or m].
        robot_name: `~robot_name`: instance name; empty for the name in the description.
        gui: `~gui`: whether to open a window (false).
        paused: `~paused`: whether to start with time standing still (false).
        real_time_factor: `~real_time_factor`: simulated over real time (1.0; 0 = as fast as possible).
        time_step_ns: `~time_step`, in seconds there: one step of the physics and of the controllers [ns] (2,000,000).
        wait_for_planning: `/wait_for_planning`: whether nodes may hold time while they compute (false).
        state_digest: `~state_digest`: whether to hash the state of every physics step, for comparisons (false).
        clock_rate_hz: `~pub_clock_frequency`: of /clock, in simulated time; 0 is every step [Hz] (100).
        ros_network: `~enable_ros_network`: whether there are the topics and services of Gazebo (true).
        gui_required: `~gui_required`: whether to end without a window (false).
        verbose: `~verbose`: whether to log details too (false).
        unsupported: `~unsupported`: arguments of a launch file that have no effect here, for a warning.
        physics_engine: `~physics_engine`: which engine moves the bodies [pybullet, mujoco] (pybullet).
        weld_grasps: `~weld_grasps`: whether held objects are fastened to the hand; else friction holds them (false).
    """

    robot_description: str
    model_path: str
    world_file: str
    starting_positions: dict[str, float]
    robot_name: str
    gui: bool
    paused: bool
    real_time_factor: float
    time_step_ns: int = PhysicsSettings().time_step_ns
    wait_for_planning: bool = False
    state_digest: bool = False
    clock_rate_hz: float = 100.0
    ros_network: bool = True
    gui_required: bool = False
    verbose: bool = False
    unsupported: str = ""
    physics_engine: str = PYBULLET
    weld_grasps: bool = False


def read_parameters() -> SimulationParameters:
    """Reads them from the parameter server.

    Raises:
        ParameterError: One has a wrong type or value.
        DescriptionError: The starting pose cannot be read.
    """
    factor = _read("~real_time_factor", 1.0, (int, float))
    if factor < 0:
        raise ParameterError(f"parameter ~real_time_factor: got {factor}; allowed: 0 (as fast as possible) or greater")
    clock_rate_hz = _read("~pub_clock_frequency", 100, (int, float))
    if not 0 <= clock_rate_hz < math.inf:
        raise ParameterError(f"parameter ~pub_clock_frequency: got {clock_rate_hz}; allowed: 0 (every step) or greater")
    time_step_ns = _read("~time_step", PhysicsSettings().time_step_s, (int, float)) * 1e9
    if not SHORTEST_STEP_NS <= time_step_ns <= LONGEST_STEP_NS:
        allowed = f"{SHORTEST_STEP_NS * 1e-9:g} to {LONGEST_STEP_NS * 1e-9:g} s"
        raise ParameterError(f"parameter ~time_step: got {time_step_ns * 1e-9:g} s; allowed: {allowed}")
    return SimulationParameters(
        robot_description=_read("/robot_description", "", (str,)),
        model_path=_read("/gazebo_model_path", "", (str,)),
        world_file=_read("~world_file", "", (str,)),
        starting_positions=parse_starting_pose(_read("~starting_pose", "", (str,))),
        robot_name=_read("~robot_name", "", (str,)),
        gui=_read("~gui", False, (bool,)),
        paused=_read("~paused", False, (bool,)),
        real_time_factor=float(factor),
        time_step_ns=round(time_step_ns),
        wait_for_planning=_read("/wait_for_planning", False, (bool,)),
        state_digest=_read("~state_digest", False, (bool,)),
        clock_rate_hz=float(clock_rate_hz),
        ros_network=_read("~enable_ros_network", True, (bool,)),
        gui_required=_read("~gui_required", False, (bool,)),
        verbose=_read("~verbose", False, (bool,)),
        unsupported=_read("~unsupported", "", (str,)),
        physics_engine=_physics_engine(),
        weld_grasps=_read("~weld_grasps", False, (bool,)),
    )


def _physics_engine() -> str:
    name: str = _read("~physics_engine", PYBULLET, (str,))
    if name not in ENGINES:
        raise ParameterError(
            f"parameter {rospy.resolve_name('~physics_engine')}: got '{name}'; allowed: {', '.join(ENGINES)}"
        )
    return name


def _read(name: str, default: Any, kinds: tuple[type, ...]) -> Any:
    value = rospy.get_param(name, default)
    if not isinstance(value, kinds) or (isinstance(value, bool) and bool not in kinds):
        allowed = " or ".join(kind.__name__ for kind in kinds)
        raise ParameterError(f"parameter {rospy.resolve_name(name)}: got {value!r}; expected {allowed}")
    return value
