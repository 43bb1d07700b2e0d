# SPDX-License-Identifier: BSD-3-Clause
"""Completes a URDF with the elements that planning, control and simulation require."""

from __future__ import annotations

from scipy.spatial.transform import Rotation

from modular_framework_planning.geometry.spatial import Array
from modular_framework_setup.config_files.robot_tree import RobotTree
from modular_framework_setup.creation.robot_parts import Gripper
from modular_framework_urdf.xml_text import Element, add_child

EFFORT, VELOCITY = 100.0, 1.0  # [N m or N], [rad/s or m/s]
MAX_GRIP_N, GUESSED_GRIP_N = 250.0, 100.0
"""Maximum plausible force of a finger (about 250 N for the strongest electric grippers), and the force that replaces a
larger force."""
INTERFACE = "hardware_interface/PositionJointInterface"
GAZEBO_PLUGIN = "libgazebo_ros_control.so"
FRAME_MASS, FRAME_INERTIA = "1e-5", "1e-9"  # [kg], [kg m^2]; simulators may assume 1 kg for links without inertia


def complete_urdf(root: Element, tree: RobotTree, grippers: tuple[Gripper, ...]) -> list[str]:
    """Adds mimic elements, limits, inertias of frames, transmissions and the simulation plugin to a URDF.

    Args:
        root: Root element of the URDF, which is modified.
        tree: Kinematic tree of the robot.
        grippers: Grippers, whose twin joints get a mimic element.

    Returns:
        One sentence per addition that the user may want to correct.
    """
    notes = []
    for gripper in grippers:
        if gripper.twin:
            multiplier = f"{gripper.twin_multiplier:g}"
            add_child(_joint(root, gripper.twin), "mimic", joint=gripper.driver, multiplier=multiplier)
            notes.append(f"joint '{gripper.twin}' mimics '{gripper.driver}' with the multiplier {multiplier} now")
    notes += [note for joint in tree.robot.movable_joints() if (note := _add_limits(_joint(root, joint.name)))]
    for link in tree.robot.links:
        element = next(item for item in root.findall("link") if item.get("name") == link.name)
        if element.find("inertial") is None and element.find("collision") is None and link.name not in tree.roots:
            _add_inertia(element)
        elif element.find("inertial") is None and element.find("collision") is not None:
            notes.append(
                f"link '{link.name}' has a shape but no <inertial>: add it (the simulation fills the shape with water)"
            )
    driven = {part.name for item in tree.robot.transmissions for part in item.joints}
    for item in root.findall("joint"):
        is_movable = item.get("type") in ("revolute", "continuous", "prismatic")
        if is_movable and item.find("mimic") is None and item.get("name") not in driven:
            _add_transmission(root, item.get("name"))
    if not any(item.get("filename") == GAZEBO_PLUGIN for item in root.iter("plugin")):
        plugin = add_child(add_child(root, "gazebo"), "plugin", name="gazebo_ros_control", filename=GAZEBO_PLUGIN)
        add_child(plugin, "robotNamespace").text = "/"
    return notes


def bound_grip(root: Element, gripper: Gripper, travel: float) -> list[str]:
    """Lowers an implausibly large effort limit of a gripper's driver joint, which would crush grasped objects.

    Args:
        root: Root element of the URDF, which is modified.
        gripper: Gripper with the driver joint.
        travel: Motion of a fingertip per unit of the driver joint [m/rad or m/m]; 0 if unknown.

    Returns:
        A sentence for the user if the effort limit was changed; otherwise an empty list.
    """
    limit = _joint(root, gripper.driver).find("limit")
    effort = float(limit.get("effort"))
    if effort <= MAX_GRIP_N * travel or not travel > 0.0:
        return []
    limit.set("effort", f"{GUESSED_GRIP_N * travel:.3g}")
    return [
        f"joint '{gripper.driver}' has the effort {effort:g}, which corresponds to a finger force of "
        f"{effort / travel:.0f} N; {limit.get('effort')} ({GUESSED_GRIP_N:g} N) is written instead: correct it"
    ]


def add_frame(root: Element, name: str, parent: str, pose: Array) -> None:
    """Adds a link without shape that is fixed to a parent link.

    Args:
        root: Root element of the URDF, which is modified.
        name: Name of the new link.
        parent: Parent link.
        pose: Pose in the parent frame, shape (4, 4) [m].
    """
    _add_inertia(add_child(root, "link", name=name))
    joint = add_child(root, "joint", name=f"{name}_joint", type="fixed")
    add_child(joint, "parent", link=parent)
    add_child(joint, "child", link=name)
    xyz = " ".join(f"{value:.5g}" for value in pose[:3, 3])
    rpy = " ".join(f"{value:.6g}" for value in Rotation.from_matrix(pose[:3, :3]).as_euler("xyz"))
    add_child(joint, "origin", xyz=xyz, rpy=rpy)


def _joint(root: Element, name: str) -> Element:
    return next(item for item in root.findall("joint") if item.get("name") == name)


def _add_limits(joint: Element) -> str:
    """Adds missing or zero effort and velocity limits to a joint; returns a note, or "" for no change."""
    limit = joint.find("limit")
    if limit is None:
        limit = add_child(joint, "limit")
    added = []
    for key, value in (("effort", EFFORT), ("velocity", VELOCITY)):
        if not float(limit.get(key, "0") or 0.0) > 0.0:
            limit.set(key, f"{value:g}")
            added.append(f"{key} {value:g}")
    return f"joint '{joint.get('name')}' has no {' and no '.join(added)} in the URDF: correct it" if added else ""


def _add_inertia(link: Element) -> None:
    inertial = add_child(link, "inertial")
    add_child(inertial, "mass", value=FRAME_MASS)
    moments = {"ixx": FRAME_INERTIA, "iyy": FRAME_INERTIA, "izz": FRAME_INERTIA, "ixy": "0", "ixz": "0", "iyz": "0"}
    add_child(inertial, "inertia", **moments)


def _add_transmission(root: Element, joint: str) -> None:
    transmission = add_child(root, "transmission", name=f"{joint}_transmission")
    add_child(transmission, "type").text = "transmission_interface/SimpleTransmission"
    part = add_child(transmission, "joint", name=joint)
    add_child(part, "hardwareInterface").text = INTERFACE
    motor = add_child(transmission, "actuator", name=f"{joint}_motor")
    add_child(motor, "hardwareInterface").text = INTERFACE
    add_child(motor, "mechanicalReduction").text = "1"
