# SPDX-License-Identifier: BSD-3-Clause
"""Commands of the command line for a planning group: one method per command, and a table of all commands."""

from __future__ import annotations

import re
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from geometry_msgs.msg import Point, Pose, PoseStamped, Quaternion

from moveit_commander.conversions import list_to_pose, quaternion_from_rpy
from moveit_commander.exception import MoveItCommanderException
from moveit_commander.move_group import MoveGroupCommander
from moveit_commander.planning_scene_interface import PlanningSceneInterface

if TYPE_CHECKING:
    from moveit_msgs.msg import RobotTrajectory


class MoveGroupInfoLevel:
    """Level of an answer."""

    FAIL = 1
    WARN = 2
    SUCCESS = 3
    INFO = 4
    DEBUG = 5


Answer = tuple[int, str]
Words = Sequence[str]
OK: Answer = (MoveGroupInfoLevel.DEBUG, "OK")
DIRECTIONS = {
    "up": (2, 1),
    "down": (2, -1),
    "z": (2, 1),
    "left": (1, 1),
    "right": (1, -1),
    "y": (1, 1),
    "forward": (0, 1),
    "backward": (0, -1),
    "back": (0, -1),
    "x": (0, 1),
}
RANDOM = ("rand", "random")
TRUE = ("1", "t", "true")
GROUND_SIZE = (3.0, 3.0, 0.1)
GROUND_GAP = 1.0e-4  # [m] below the robot, to avoid contact
VALUE = r"[\d.eE+\-]+"
COPY = re.compile(r"(\w+)\s*=\s*(\w+)")
VECTOR = re.compile(rf"(\w+)\s*=\s*\[((?:\s*{VALUE}[\s,]*)*)\]")
ELEMENT = re.compile(rf"(\w+)\s*\[\s*(\d+)\s*\]\s*=\s*({VALUE})")


@dataclass(frozen=True, slots=True)
class Command:
    """Usage and method of a command.

    Attributes:
        usage: Usage line of the help.
        text: Description in the help.
        counts: Allowed numbers of arguments.
        run: Method that executes the command.
    """

    usage: str
    text: str
    counts: tuple[int, ...]
    run: Callable[[GroupCommands, Words], Answer]


def report(succeeded: bool, success: str, failure: str) -> Answer:
    """Returns an answer that reports success or failure.

    Args:
        succeeded: Whether the command succeeded.
        success: Text for success.
        failure: Text for failure.
    """
    return (MoveGroupInfoLevel.SUCCESS, success) if succeeded else (MoveGroupInfoLevel.FAIL, failure)


def info(text: object) -> Answer:
    """Returns an informational answer."""
    return MoveGroupInfoLevel.INFO, str(text)


def vector(values: Sequence[float]) -> str:
    """Returns joint values in the syntax of commands: [0.1 0.2]."""
    return f"[{' '.join(str(value) for value in values)}]"


def number(word: str) -> float:
    """Returns the number that a word represents; raises MoveItCommanderException otherwise."""
    try:
        return float(word)
    except ValueError:
        raise MoveItCommanderException(f"'{word}' is not a number") from None


class GroupCommands:
    """Executes commands for a planning group."""

    def __init__(self, group: MoveGroupCommander, scene: PlanningSceneInterface, root_link: str) -> None:
        self.group = group
        self._scene = scene
        self._root_link = root_link
        self._plan: RobotTrajectory | None = None

    def execute(self, line: str) -> Answer:
        """Executes a line; raises MoveItCommanderException."""
        words = line.split()
        command = COMMANDS.get(words[0].lower())
        if command is not None and len(words) - 1 in command.counts:
            return command.run(self, words[1:])
        if command is not None:
            return MoveGroupInfoLevel.WARN, f"'{line}': this command is used as: {command.usage}"
        return self._assign(line) or self._value(line)

    def _assign(self, line: str) -> Answer | None:
        known = self.group.get_remembered_joint_values()
        if match := VECTOR.fullmatch(line):
            values = [number(word) for word in match[2].replace(",", " ").split()]
            self.group.remember_joint_values(match[1], values)
            return MoveGroupInfoLevel.SUCCESS, f"{match[1]} = {vector(values)}"
        if (match := COPY.fullmatch(line)) and match[2] in known:
            self.group.remember_joint_values(match[1], known[match[2]])
            return MoveGroupInfoLevel.SUCCESS, f"{match[1]} is now the same as {match[2]}"
        if (match := ELEMENT.fullmatch(line)) and match[1] in known:
            values = known[match[1]]
            if int(match[2]) >= len(values):
                raise MoveItCommanderException(f"{match[1]} has {len(values)} values, there is no [{match[2]}]")
            values[int(match[2])] = number(match[3])
            self.group.remember_joint_values(match[1], values)
            return MoveGroupInfoLevel.SUCCESS, f"{match[1]} = {vector(values)}"
        return None

    def _value(self, line: str) -> Answer:
        known = self.group.get_remembered_joint_values()
        if line in known:
            return info(vector(known[line]))
        return MoveGroupInfoLevel.WARN, f"Unknown command: '{line}'; type help"

    def allow(self, words: Words) -> Answer:
        """Enables or disables replanning or looking around."""
        switches = {
            "look": self.group.allow_looking,
            "looking": self.group.allow_looking,
            "replan": self.group.allow_replanning,
            "replanning": self.group.allow_replanning,
        }
        setting, value = words[0].lower(), words[1].lower()
        if setting not in switches or value not in (*TRUE, "0", "f", "false"):
            raise MoveItCommanderException(f"allow {' '.join(words)}: looking or replanning, true or false are allowed")
        switches[setting](value in TRUE)
        return OK

    def constrain(self, words: Words) -> Answer:
        """Sets or clears path constraints."""
        self.group.set_path_constraints(words[0] if words else None)
        return MoveGroupInfoLevel.SUCCESS, f"Constrained to {words[0]}" if words else "Cleared path constraints"

    def current(self, _: Words) -> Answer:
        """Returns the joint values and the end effector's pose."""
        text = f"joints = [{', '.join(str(value) for value in self.group.get_current_joint_values())}]"
        link = self.group.get_end_effector_link()
        if link:
            text += f"\n\n{link} pose = [\n{self.group.get_current_pose()}\n]"
            text += f"\n{link} RPY = {self.group.get_current_rpy()}"
        return info(text)

    def group_state(self, _: Words) -> Answer:
        """Returns the current state in the syntax of the SRDF."""
        values = zip(self.group._group_names(), self.group.get_current_joint_values(), strict=True)
        lines = [f'        <joint name="{name}" value="{value}"/>' for name, value in values]
        return info(
            "\n".join(
                [f'    <group_state name="custom_state" group="{self.group.get_name()}">', *lines, "    </group_state>"]
            )
        )

    def database(self, words: Words) -> Answer:
        """Selects the file of constraints, and returns its path."""
        if words:
            self.group.set_constraints_database(words[0], int(number(words[1])) if len(words) > 1 else 33829)
        path = self.database_path()
        return info("Not connected to a database" if path is None else f"Connected to {path}")

    def database_path(self) -> str | None:
        """Returns the path of the file of constraints; None if none is selected."""
        storage = self.group.constraints_storage
        return None if storage is None else str(storage.path)

    def delete(self, words: Words) -> Answer:
        """Removes remembered joint values."""
        self.group.forget_joint_values(words[0])
        return OK

    def eef(self, _: Words) -> Answer:
        """Returns the end effector link."""
        return info(self.group.get_end_effector_link() or "There is no end effector defined")

    def run_plan(self, _: Words) -> Answer:
        """Executes the last plan."""
        if self._plan is None:
            return MoveGroupInfoLevel.WARN, "No motion plan computed"
        return report(self.group.execute(self._plan), "Plan executed", "Failed to execute the plan")

    def go(self, words: Words) -> Answer:
        """Moves to a named or random state, by a distance, or to a pose (x y z, with roll pitch yaw)."""
        self._plan = None
        name = words[0].lower()
        if name in DIRECTIONS and len(words) == 2:
            axis, sign = DIRECTIONS[name]
            self.group.shift_pose_target(axis, sign * number(words[1]))
            return report(self.group.go(), f"Moved {name} by {words[1]} m", f"Failed while moving {name}")
        if len(words) > 2:
            self._set_pose(words)
        else:
            self._set_named(words)
        return report(self.group.go(), f"Moved to {' '.join(words)}", f"Failed while moving to {' '.join(words)}")

    def _set_named(self, words: Words) -> None:
        if words[0].lower() in RANDOM:
            self.group.set_random_target()
        else:
            self.group.set_named_target(words[0])

    def _set_pose(self, words: Words) -> None:
        approximate = words[-1].lower() in ("approx", "approximate")
        values = [number(word) for word in (words[:-1] if approximate else words)]
        if len(values) not in (3, 6):
            raise MoveItCommanderException(
                f"go {' '.join(words)}: 3 numbers (x y z) or 6 (x y z roll pitch yaw) are allowed"
            )
        if approximate:
            quaternion = quaternion_from_rpy(*values[3:]) if len(values) == 6 else (0.0, 0.0, 0.0, 1.0)
            self.group.set_joint_value_target(Pose(Point(*values[:3]), Quaternion(*quaternion)), True)
        elif len(values) == 3:
            self.group.set_position_target(values)
        else:
            self.group.set_pose_target(list_to_pose(values))

    def ground(self, _: Words) -> Answer:
        """Adds a ground plate below the robot."""
        pose = PoseStamped()
        pose.header.frame_id = self._root_link
        pose.pose.position.z = -GROUND_SIZE[2] / 2.0 - GROUND_GAP
        pose.pose.orientation.w = 1.0
        self._scene.attach_box(self._root_link, "ground", pose, GROUND_SIZE)
        return info("Added ground")

    def identify(self, _: Words) -> Answer:
        """Returns the name of the group."""
        return info(self.group.get_name())

    def joints(self, _: Words) -> Answer:
        """Returns the joints."""
        return info("\n".join(f"{index} = {name}" for index, name in enumerate(self.group.get_joints())))

    def pick(self, words: Words) -> Answer:
        """Picks an object."""
        return report(self.group.pick(words[0]) == 1, f"Picked object {words[0]}", f"Failed to pick object {words[0]}")

    def place(self, words: Words) -> Answer:
        """Places an object."""
        return report(self.group.place(words[0]), f"Placed object {words[0]}", f"Failed to place object {words[0]}")

    def plan(self, words: Words) -> Answer:
        """Plans to a named or random state, or returns the last plan."""
        if not words:
            return info("No previous plan" if self._plan is None else self._plan)
        self._set_named(words)
        worked, trajectory, _, _ = self.group.plan()
        self._plan = trajectory if worked else None
        return report(
            worked,
            f"Planned to {words[0]}: {len(trajectory.joint_trajectory.points)} points",
            f"Failed while planning to {words[0]}",
        )

    def planner(self, words: Words) -> Answer:
        """Selects a planner."""
        self.group.set_planner_id(words[0])
        return MoveGroupInfoLevel.SUCCESS, f"Planner is now {words[0]}"

    def remember_random(self, words: Words) -> Answer:
        """Remembers random joint values."""
        self.group.remember_joint_values(words[0], self.group.get_random_joint_values())
        return MoveGroupInfoLevel.SUCCESS, f"Remembered random joint values under the name {words[0]}"

    def record(self, words: Words) -> Answer:
        """Remembers the current joint values."""
        self.group.remember_joint_values(words[0])
        return MoveGroupInfoLevel.SUCCESS, f"Remembered current joint values under the name {words[0]}"

    def rotate(self, words: Words) -> Answer:
        """Moves the end effector to roll, pitch, yaw [rad]."""
        self.group.set_rpy_target([number(word) for word in words])
        text = " ".join(words)
        return report(self.group.go(), f"Rotation complete: {text}", f"Failed while rotating to {text}")

    def show(self, words: Words) -> Answer:
        """Returns remembered joint values."""
        known = self.group.get_remembered_joint_values()
        if words and words[0] not in known:
            raise MoveItCommanderException(f"'{words[0]}' is not known; known: {', '.join(known) or 'none'}")
        chosen = {words[0]: known[words[0]]} if words else known
        return info("\n".join(f"{name} = {vector(values)}" for name, values in chosen.items()))

    def stop(self, _: Words) -> Answer:
        """Stops the motion."""
        self.group.stop()
        return OK

    def time(self, words: Words) -> Answer:
        """Sets or returns the planning time [s]."""
        if words:
            self.group.set_planning_time(number(words[0]))
        return info(self.group.get_planning_time())

    def tolerance(self, words: Words) -> Answer:
        """Sets or returns the goal tolerances."""
        if words:
            self.group.set_goal_tolerance(number(words[0]))
        return info("Joint = {:.6g}, Position = {:.6g}, Orientation = {:.6g}".format(*self.group.get_goal_tolerance()))

    def variables(self, _: Words) -> Answer:
        """Returns the names of the remembered joint values."""
        return info(f"[{' '.join(self.group.get_remembered_joint_values())}]")

    def wait(self, words: Words) -> Answer:
        """Sleeps."""
        time.sleep(max(number(words[0]), 0.0))
        return MoveGroupInfoLevel.SUCCESS, f"{words[0]} s passed"


def _command(usage: str, text: str, counts: tuple[int, ...], run: Any) -> tuple[str, Command]:
    return usage.split()[0], Command(usage, text, counts, run)


G = GroupCommands
COMMANDS = dict(
    (
        _command("allow <looking|replanning> <true|false>", "switch looking around or replanning", (2,), G.allow),
        _command("constrain [<name>]", "use named path constraints, or none", (0, 1), G.constrain),
        _command("current", "joint values and pose of the end effector", (0,), G.current),
        _command("group_state", "joint values as the SRDF writes them", (0,), G.group_state),
        _command("database [<host> [<port>]]", "database of constraints", (0, 1, 2), G.database),
        _command("delete <name>", "forget joint values", (1,), G.delete),
        _command("eef", "name of the end effector link", (0,), G.eef),
        _command("execute", "execute the last plan", (0,), G.run_plan),
        _command(
            "go <name>|rand|<direction> <dx>|<x> <y> <z> [<r> <p> <y>] [approx]",
            "plan and move; directions: " + " ".join(DIRECTIONS),
            (1, 2, 3, 4, 6, 7),
            G.go,
        ),
        _command("ground", "put a plate below the robot", (0,), G.ground),
        _command("id", "name of the group that is commanded", (0,), G.identify),
        _command("joints", "names of the joints", (0,), G.joints),
        _command("pick <name>", "pick an object", (1,), G.pick),
        _command("place <name>", "place an object", (1,), G.place),
        _command("plan [<name>|rand]", "plan to a state, or show the last plan", (0, 1), G.plan),
        _command("planner <name>", "choose a planner", (1,), G.planner),
        _command("random <name>", "remember random joint values", (1,), G.remember_random),
        _command("record <name>", "remember the current joint values", (1,), G.record),
        _command("rotate <r> <p> <y>", "turn the end effector [rad]", (3,), G.rotate),
        _command("show [<name>]", "remembered joint values", (0, 1), G.show),
        _command("stop", "stop the motion", (0,), G.stop),
        _command("time [<s>]", "show or set the planning time", (0, 1), G.time),
        _command("tolerance [<x>]", "show or set the tolerance of goals", (0, 1), G.tolerance),
        _command("vars", "names of remembered joint values", (0,), G.variables),
        _command("wait <s>", "sleep", (1,), G.wait),
    )
)
COMMANDS |= {
    short: COMMANDS[name]
    for short, name in (("del", "delete"), ("rand", "random"), ("rec", "record"), ("tol", "tolerance"))
}
ASSIGNMENTS = (
    ("<name>", "show joint values"),
    ("<name> = <other>", "copy joint values"),
    ("<name> = [<v1> <v2> ...]", "remember joint values"),
    ("<name>[<i>] = <v>", "change one joint value"),
)
