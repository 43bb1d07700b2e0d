# SPDX-License-Identifier: BSD-3-Clause
"""Starts and switches groups of controllers: the command-line tool controller_group."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import rospy

from modular_framework_control.ros import controller_manager_interface as interface
from modular_framework_control.ros.controller_manager_client import (
    ControllerManagerClient,
    ControllerManagerClientError,
)

Groups = Mapping[str, Sequence[str]]


@dataclass(frozen=True, slots=True)
class GroupPlan:
    """Lists the controllers to load, start and stop so that one group runs.

    Attributes:
        load: Controllers of the group that are not loaded, in the order of the group.
        start: Controllers of the group that are not running, in the order of the group.
        stop: Running controllers that belong only to other groups.
    """

    load: tuple[str, ...]
    start: tuple[str, ...]
    stop: tuple[str, ...]


def read_groups(value: object) -> Groups:
    """Returns the checked value of the parameter `controller_groups`.

    Raises:
        ControllerManagerClientError: If `value` is not a mapping of names to lists of names.
    """
    where = f"parameter {rospy.resolve_name('controller_groups')}"
    if not isinstance(value, dict) or not value:
        raise ControllerManagerClientError(
            f"{where}: got {value!r}; expected a mapping of group names to lists of controllers"
        )
    for group, controllers in value.items():
        if not isinstance(controllers, list) or not all(isinstance(name, str) and name for name in controllers):
            raise ControllerManagerClientError(f"{where}/{group}: got {controllers!r}; expected a list of controllers")
    return value


def plan_group(groups: Groups, group: str, states: Mapping[str, str]) -> GroupPlan:
    """Returns the controllers to load, start and stop for a group.

    Args:
        groups: Controllers of each group.
        group: Name of the requested group.
        states: State of each loaded controller by name.

    Raises:
        ControllerManagerClientError: If the group is unknown or has no controllers.
    """
    if not groups.get(group):
        raise ControllerManagerClientError(
            f"no controllers are defined for group '{group}'; known groups: {', '.join(sorted(groups))}"
        )
    group_controllers = tuple(dict.fromkeys(groups[group]))
    other_controllers = dict.fromkeys(
        name for names in groups.values() for name in names if name not in group_controllers
    )
    return GroupPlan(
        tuple(name for name in group_controllers if name not in states),
        tuple(name for name in group_controllers if states.get(name) != "running"),
        tuple(name for name in other_controllers if states.get(name) == "running"),
    )


def _print_groups(groups: Groups) -> None:
    print(f"Number of groups: {len(groups)}")
    for group in sorted(groups):
        print(f"  {group}")
        for name in groups[group]:
            print(f"      {name}")


def _bring_up(groups: Groups, group: str, client: ControllerManagerClient, switch: bool) -> None:
    plan_group(groups, group, {})
    states = {entry.name: entry.state for entry in client.list_controllers()}
    plan = plan_group(groups, group, states)
    for name in plan.load:
        if not interface.load_controller(name, client):
            raise ControllerManagerClientError(
                f"{'Cancel group switching' if switch else 'Group not spawned'}: "
                f"controller '{name}' of group '{group}' was not loaded"
            )
    if switch:
        interface.start_stop_controllers(plan.start, plan.stop, client)
        return
    for name in plan.start:
        interface.start_controller(name, client)


def controller_group_main() -> int:
    """List the groups of controllers, load and start one group, or switch from the other groups to one group."""
    parser = argparse.ArgumentParser(prog="controller_group", description=controller_group_main.__doc__)
    commands = parser.add_subparsers(dest="command", required=True)
    commands.add_parser("list", help="list the groups and their controllers")
    for name, text in (
        ("spawn", "load and start the controllers of a group"),
        ("switch", "start the controllers of a group and stop those of the other groups, in one cycle"),
    ):
        commands.add_parser(name, help=text).add_argument("group", help="name of a group in controller_groups")
    arguments = parser.parse_args(rospy.myargv(sys.argv)[1:])
    rospy.init_node("controller_group", anonymous=True)
    try:
        groups = read_groups(rospy.get_param("controller_groups", None))
        if arguments.command == "list":
            _print_groups(groups)
        else:
            _bring_up(groups, arguments.group, ControllerManagerClient(), arguments.command == "switch")
    except ControllerManagerClientError as error:
        rospy.logerr("%s", error)
        return 1
    finally:
        rospy.signal_shutdown("done")
    return 0
