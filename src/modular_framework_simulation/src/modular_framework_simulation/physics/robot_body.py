# SPDX-License-Identifier: BSD-3-Clause
"""Robot in the physics engine; each step reads all joints in one call and commands all joints in one call.

Joints with a transmission follow commands. Mimic joints represent the mechanism of an underactuated gripper. A mimic
joint parallel to its leading joint (the other finger) is coupled to the leading joint as if one servo closed both. A
mimic joint further down the chain (a distal phalanx) is drawn towards its free-motion angle with limited torque, so
that it yields when an object presses against it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from enum import Enum, IntEnum
from typing import NamedTuple

from modular_framework_simulation.errors import DescriptionError
from modular_framework_simulation.models.poses import Pose
from modular_framework_simulation.models.sdf_specs import JointDynamics
from modular_framework_simulation.physics.joint_resistance import set_joint_resistance
from modular_framework_simulation.physics.physics_engine import JointState, Surface
from modular_framework_simulation.physics.physics_world import PhysicsWorld
from modular_framework_simulation.physics.simulated_body import SimulatedBody
from modular_framework_simulation.robots.robot_description import RobotDescription
from modular_framework_simulation.robots.robot_joint import RobotJoint
from modular_framework_urdf.rotations import Vector3, rotate_vector

_POSITION_GAIN = 0.2
"""Fraction of a position error that a drive corrects in one physics step; velocities are fully fed forward."""

_COUPLING_FACTOR = 2.0
"""Ratio of the coupling effort of a second finger to the drive effort of the first, which centres the object."""


_MIN_AXIS_COSINE = 0.5
"""Minimum cosine between the joint axes of two link chains that belong to one finger; the closest fingers around a palm
have an angle of at least 90 degrees."""


class Role(Enum):
    """The source of a joint's motion."""

    DRIVEN = "driven"
    COUPLED = "coupled"
    COMPLIANT = "compliant"
    FREE = "free"


class Mode(IntEnum):
    """Control mode of a driven joint."""

    POSITION = 0
    VELOCITY = 1
    EFFORT = 2


@dataclass(slots=True)
class Drive:
    """Command of a driven joint.

    Attributes:
        mode: Control mode of the command.
        command: Position [rad or m], velocity [rad/s or m/s] or effort [Nm or N].
        feed_forward: Velocity of a moving position command [rad/s or m/s].
        effort_limit: Maximum effort [Nm or N].
    """

    mode: Mode
    command: float
    feed_forward: float
    effort_limit: float


@dataclass(frozen=True, slots=True)
class Gripper:
    """One of the robot's grippers.

    Attributes:
        palm_link: Link that carries the fingers.
        links: Palm and all links below, which may touch a held object.
        fingers: Engine link indices of each finger; the links of a linkage form one finger.
        sides: Engine link indices of each side between which an object is held: the fingers, or the finger and the palm
            of a gripper with a single finger.
    """

    palm_link: str
    links: tuple[str, ...]
    fingers: tuple[tuple[int, ...], ...]
    sides: tuple[tuple[int, ...], ...]


class _MimicMotion(NamedTuple):
    """Motion of a mimic joint: `multiplier` times the leading joint's position plus `offset`.

    Attributes:
        leader: Index of the leading joint.
        effort: Maximum effort of the coupling [Nm or N].
        max_velocity: Maximum velocity [rad/s or m/s], at least the velocity at the leading joint's velocity limit.
    """

    leader: int
    multiplier: float
    offset: float
    effort: float
    max_velocity: float


class RobotBody:
    """Robot in the world, with a fixed base.

    Args:
        world: The world.
        description: Description of the robot.
        name: Name of the robot in the world.
        pose: Pose of the root link in the world frame.
        positions: Initial joint positions [rad or m]. Other joints start at 0 or the nearest limit, and mimic joints
            start at the position given by the leading joint.

    Raises:
        DuplicateModelError: The name is already in use.
        DescriptionError: The engine rejects the robot, or a joint in `positions` does not exist.
    """

    def __init__(
        self,
        world: PhysicsWorld,
        description: RobotDescription,
        name: str,
        pose: Pose,
        positions: dict[str, float],
    ) -> None:
        self.description = description
        self.world = world
        self._name, self._pose = name, pose
        self._load()
        self.roles = {joint.name: _role(joint, description) for joint in description.joints}
        self.joint_names = [joint.name for joint in description.joints if joint.name in self.body.joint_indices]
        self._joints = [joint for joint in description.joints if joint.name in self.body.joint_indices]
        self._indices = [self.body.joint_indices[name] for name in self.joint_names]
        self._index_by_name = {joint_name: index for index, joint_name in enumerate(self.joint_names)}
        self.readings = [JointState(0.0, 0.0, 0.0)] * len(self._indices)
        self._commands: list[tuple[Mode, float, float, float]] = []
        self._mimic_motions = [self._mimic_motion(joint) for joint in self._joints]
        self.grippers = self._grippers()
        self.starting_positions = self._complete(positions)
        self._set_up()

    def _load(self) -> None:
        engine = self.world.engine
        number = engine.load_urdf(self.description.engine_urdf, self._name, True, self_collision=True)
        self.body = SimulatedBody(engine, number, self._name, tree=None, static=True, spec=None)
        self._dynamics = {
            joint.name: JointDynamics(damping=joint.damping, friction=joint.friction) for joint in engine.joints(number)
        }

    def _set_up(self) -> None:
        self._limit_self_collisions()
        self._set_surfaces()
        self.world.add(self.body, self._pose)
        self.reset()
        set_joint_resistance(self.world.engine, self.body, self._dynamics)

    def reload(self) -> None:
        """Loads the robot again after a restart of the world, with its joints at the initial positions."""
        self._load()
        self._set_up()

    @property
    def fingers(self) -> list[tuple[int, ...]]:
        """Returns the engine link indices of each finger of all grippers."""
        return [finger for gripper in self.grippers for finger in gripper.fingers]

    def _mimic_motion(self, joint: RobotJoint) -> _MimicMotion | None:
        if joint.mimic is None or joint.mimic.leader not in self._index_by_name:
            return None
        mimic, index = joint.mimic, self._index_by_name[joint.mimic.leader]
        effort = joint.effort * (_COUPLING_FACTOR if self.roles[joint.name] is Role.COUPLED else 1.0)
        max_velocity = max(joint.velocity, abs(mimic.multiplier) * self._joints[index].velocity)
        return _MimicMotion(index, mimic.multiplier, mimic.offset, effort, max_velocity)

    def _grippers(self) -> tuple[Gripper, ...]:
        """Groups the joints of grippers by the palm link of their leading joint."""
        joints = [joint for joint in self.description.gripper_joints if joint.name in self.body.joint_indices]
        by_name = {joint.name: joint for joint in joints}
        palms: dict[str, dict[str, RobotJoint]] = {}
        for joint in joints:
            leader = by_name.get(joint.mimic.leader, joint) if joint.mimic is not None else joint
            root = self._chain_root(joint, joints)
            palms.setdefault(self._chain_root(leader, joints).parent_link, {})[root.name] = root
        return tuple(self._gripper(palm, list(roots.values())) for palm, roots in palms.items())

    def _gripper(self, palm: str, roots: list[RobotJoint]) -> Gripper:
        links, fingers = self._links_below(palm), self._fingers(roots)
        tops = [joint.child_link for joint in self._joints if joint.parent_link in links]
        moving = {link for top in tops for link in self._links_below(top)}
        fixed = tuple(self.body.link_indices[link] for link in links if link not in moving)
        return Gripper(palm, links, fingers, fingers if len(fingers) > 1 else (*fingers, fixed))

    def _chain_root(self, joint: RobotJoint, gripper: list[RobotJoint]) -> RobotJoint:
        """Returns the first gripper joint of a chain; fixed links within the chain are allowed."""
        by_child = {each.child_link: each for each in gripper}
        link = joint.parent_link
        while link:
            joint = by_child.get(link, joint)
            link = self.description.parents.get(link, "")
        return joint

    def _fingers(self, roots: list[RobotJoint]) -> tuple[tuple[int, ...], ...]:
        """Returns the link indices of each finger.

        Chains whose first joints move in the same direction form one linkage, such as the outer and inner knuckle of a
        four-bar finger, because different fingers close from different sides.

        Args:
            roots: First joints of the chains at the palm.
        """
        fingers: list[tuple[Vector3, list[int]]] = []
        for root in roots:
            links = [self.body.link_indices[link] for link in self._links_below(root.child_link)]
            direction = self._closing_axis(root)
            finger = next((links for axis, links in fingers if _dot(axis, direction) > _MIN_AXIS_COSINE), None)
            if finger is None:
                fingers.append((direction, links))
            else:
                finger += links
        return tuple(tuple(links) for _, links in fingers)

    def _closing_axis(self, joint: RobotJoint) -> Vector3:
        """Returns the axis of a joint in the world frame, directed for an increasing leading joint position."""
        frame = self.world.engine.link_motion(self.body.number, self.body.joint_indices[joint.name]).frame
        x, y, z = rotate_vector(frame.quaternion, joint.axis)
        # jaws with a motor each and parallel axes have opposite ranges
        direction = joint.mimic.multiplier if joint.mimic is not None else joint.lower + joint.upper
        length = math.copysign(math.hypot(x, y, z), direction)
        return (x / length, y / length, z / length)

    def _links_below(self, top: str) -> tuple[str, ...]:
        """Returns a link and all links below."""
        parents = self.description.parents

        def below(link: str) -> bool:
            while link:
                if link == top:
                    return True
                link = parents.get(link, "")
            return False

        return tuple(link for link in self.description.links if below(link))

    def reset(self) -> None:
        """Sets the joints to their initial positions, at rest."""
        self.body.reset_joints(self.starting_positions)
        self.read()

    def read(self) -> list[JointState]:
        """Measures all joints, in the order of `joint_names`."""
        if not self._indices:  # the engine returns None for an empty list of joints
            return self.readings
        self.readings = self.world.engine.joint_states(self.body.number, self._indices)
        return self.readings

    def drive(self, drives: dict[str, Drive]) -> None:
        """Sets the motors of all joints for the next physics steps.

        Args:
            drives: Commands of the driven joints, by name; other joints are free.
        """
        if not self._indices:
            return
        commands = [(each.mode, each.command, each.feed_forward, each.effort_limit) for each in drives.values()]
        if commands != self._commands:
            self.world.rest.disturb()
            self._commands = commands
        elif self.world.at_rest:
            return
        correction_time_s = self.world.settings.time_step_s / _POSITION_GAIN
        targets: list[float] = []
        velocities: list[float] = []
        efforts: list[float] = []
        for joint, reading, mimic in zip(self._joints, self.readings, self._mimic_motions, strict=True):
            position, drive, max_velocity = reading.position, drives.get(joint.name), joint.velocity
            if drive is not None and drive.mode is Mode.POSITION:
                target, velocity, effort = drive.command, drive.feed_forward, drive.effort_limit
            elif drive is not None and drive.mode is Mode.VELOCITY:
                target, velocity, effort = position, drive.command, drive.effort_limit
            elif mimic is not None:
                leader = self.readings[mimic.leader]
                target = mimic.multiplier * leader.position + mimic.offset
                velocity, effort, max_velocity = mimic.multiplier * leader.velocity, mimic.effort, mimic.max_velocity
            else:  # only friction holds an undriven joint
                target, velocity, effort = position, 0.0, self._dynamics[joint.name].friction
            # The drive adds a correction velocity to the fed-forward velocity; the sum must not exceed the limit.
            max_target = position + max(0.0, max_velocity - velocity) * correction_time_s
            min_target = position - max(0.0, max_velocity + velocity) * correction_time_s
            targets.append(max(min_target, min(max_target, target)))
            velocities.append(velocity)
            efforts.append(effort)
        engine = self.world.engine
        engine.set_position_motors(
            self.body.number, self._indices, targets, velocities=velocities, efforts=efforts, gain=_POSITION_GAIN
        )
        self._apply_efforts(drives)

    def _apply_efforts(self, drives: dict[str, Drive]) -> None:
        engine = self.world.engine
        for name, drive in drives.items():
            if drive.mode is Mode.EFFORT:
                effort = max(-drive.effort_limit, min(drive.effort_limit, drive.command))
                engine.apply_effort(self.body.number, self.body.joint_indices[name], effort)

    def _complete(self, positions: dict[str, float]) -> dict[str, float]:
        unknown = sorted(set(positions) - set(self._index_by_name))
        if unknown:
            known = ", ".join(self.joint_names)
            raise DescriptionError("starting pose", f"names unknown joints {unknown}", f"allowed: {known}")
        complete = {
            joint.name: max(joint.lower, min(joint.upper, positions.get(joint.name, 0.0))) for joint in self._joints
        }
        for joint in self._joints:
            if joint.mimic is not None and joint.name not in positions and joint.mimic.leader in complete:
                mimic_position = joint.mimic.multiplier * complete[joint.mimic.leader] + joint.mimic.offset
                complete[joint.name] = max(joint.lower, min(joint.upper, mimic_position))
        return complete

    def _limit_self_collisions(self) -> None:
        """Enables self-collisions between fingers only, because the planner checks all other links.

        Links of the same finger never collide, because the bars of a linkage overlap at the hinges.
        """
        fingers = self.fingers
        allowed = {
            frozenset((a, b)) for one in fingers for other in fingers if one is not other for a in one for b in other
        }
        self.world.engine.set_self_collisions(self.body.number, allowed)

    def _set_surfaces(self) -> None:
        engine, settings = self.world.engine, self.world.settings
        finger_links = {index for gripper in self.grippers for side in gripper.sides for index in side}
        pad = Surface(settings.pad_friction, settings.pad_spinning_friction, settings.pad_rolling_friction)
        other = Surface(settings.body_friction, 0.0, 0.0)
        for link, index in self.body.link_indices.items():
            on_finger = index in finger_links
            surface = pad if on_finger else other
            if link in self.description.frictions:
                surface = replace(surface, lateral=self.description.frictions[link])
            engine.set_surface(self.body.number, index, surface, anchored=on_finger)
        engine.remove_velocity_damping(self.body.number)


def _role(joint: RobotJoint, description: RobotDescription) -> Role:
    if joint.mimic is not None:
        family = [
            other
            for other in description.joints
            if other.name == joint.mimic.leader or (other.mimic and other.mimic.leader == joint.mimic.leader)
        ]
        above = {other.child_link for other in family if other.name != joint.name}
        link = joint.parent_link
        while link:
            if link in above:
                return Role.COMPLIANT
            link = description.parents.get(link, "")
        return Role.COUPLED
    return Role.DRIVEN if joint.interfaces else Role.FREE


def _dot(a: Vector3, b: Vector3) -> float:
    return sum(x * y for x, y in zip(a, b, strict=True))
