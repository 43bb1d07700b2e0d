# SPDX-License-Identifier: BSD-3-Clause
"""Node, which starts a ROS node under roslaunch's process monitor, with its parameters on the parameter server."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from launch.actions import ExecuteProcess
from launch.core.errors import LaunchError
from launch.core.launch_context import LaunchContext
from launch.core.parameter_plan import Lookup
from launch.core.process_request import ProcessRequest
from launch.core.some_substitutions_type import SomeSubstitutionsType
from launch.core.utilities import normalize_to_list_of_substitutions, perform_text
from launch.ros_packages import program_of_package
from launch.substitutions.text import described

from launch_ros.namespaces import check_node_name, full_name, join, name_from
from launch_ros.node_parameters import CLOCK, ParameterSource, evaluate_sources, parameters_of_node, plan_parameters
from launch_ros.ros1_programs import NodePlan, ros1_plan
from launch_ros.ros_arguments import RosArguments, split_ros_arguments

NAMESPACE, PARAMETERS, REMAPPINGS = "ros_namespace", "global_params", "ros_remaps"
"""Launch configurations with the namespace, parameters and remappings of a scope."""


class Node(ExecuteProcess):
    """Starts a ROS node.

    The launch sets the parameters of all nodes before any process starts. They are set in the node's private namespace;
    the robot description is also set in the node's namespace, where ROS 1 nodes expect it. The table in
    `launch_ros.ros1_programs` contains ROS 2 programs with another name on ROS 1.

    Args:
        executable: Name of the program; without a package, the path of the program.
        package: Package of the program.
        name: Name of the node. By default, the program sets its own name, or if the node has parameters, the name is
            derived from the program.
        namespace: Namespace of the node, absolute or relative to the pushed namespace.
        exec_name: Name of the process in messages.
        parameters: Dicts, paths of YAML files, ParameterFile or Parameter objects; later entries override earlier
            entries.
        remappings: Pairs of old and new name.
        ros_arguments: ROS arguments of ROS 2: `-r a:=b`, `-p a:=b`, `--params-file FILE`.
        arguments: Arguments of the program.
        options: Options of ExecuteProcess: output, respawn, respawn_delay, respawn_max_retries, on_exit, condition,
            prefix, env, additional_env, cwd, sigterm_timeout, sigkill_timeout.
    """

    def __init__(
        self,
        *,
        executable: SomeSubstitutionsType,
        package: SomeSubstitutionsType | None = None,
        name: SomeSubstitutionsType | None = None,
        namespace: SomeSubstitutionsType | None = None,
        exec_name: SomeSubstitutionsType | None = None,
        parameters: Iterable[Any] | None = None,
        remappings: Iterable[tuple[SomeSubstitutionsType, SomeSubstitutionsType]] | None = None,
        ros_arguments: Iterable[SomeSubstitutionsType] | None = None,
        arguments: Iterable[SomeSubstitutionsType] | None = None,
        **options: Any,
    ) -> None:
        if isinstance(arguments, str):
            raise TypeError(f"Node: arguments is a single text, '{arguments}'; allowed: a list of texts, [...]")
        super().__init__(cmd=[executable], name=exec_name, **options)
        self._package = None if package is None else normalize_to_list_of_substitutions(package)
        self._node_name, self._namespace, self._exec_name = name, namespace, exec_name
        self._parameters = [] if parameters is None else parameters
        self._remappings = list(remappings or ())
        self._arguments = list(arguments or ())
        self._ros_arguments = list(ros_arguments or ())
        self._full_name = ""

    @property
    def node_name(self) -> str:
        """Returns the full name of the node, which is known after its visit."""
        if not self._full_name:
            raise LaunchError("the name of a node is only known after its visit")
        return self._full_name

    def describe(self) -> str:
        package = "" if self._package is None else f"{described(self._package)}, "
        return f"Node({package}{described(self.cmd[0])})"

    def execute(self, context: LaunchContext) -> None:
        plan, own = self._plan(context)
        super().execute(context)
        request = context.requests[-1]
        ros1 = ros1_plan(plan)
        self._complete(context, request, ros1, own)
        if self._exec_name is not None or not ros1.name:
            label = name_from(plan.executable.rpartition("/")[2])
            request.name = perform_text(context, self._exec_name) if self._exec_name is not None else label
        for companion in ros1.companions:
            added = ProcessRequest(None, "", [], dict(request.environment), on_screen=request.on_screen)
            context.requests.append(added)
            self._complete(context, added, companion, RosArguments())

    def _plan(self, context: LaunchContext) -> tuple[NodePlan, RosArguments]:
        """Returns the node for ROS 2, and its ROS arguments."""
        arguments = [perform_text(context, each) for each in self._arguments]
        ros_arguments = [perform_text(context, each) for each in self._ros_arguments]
        arguments, own = split_ros_arguments([*arguments, "--ros-args", *ros_arguments])
        name = own.name or (perform_text(context, self._node_name) if self._node_name is not None else "")
        given = own.namespace or (perform_text(context, self._namespace) if self._namespace is not None else None)
        namespace = join(context.launch_configurations.get(NAMESPACE), given)
        scope = [_source_of_scope(entry) for entry in context.launch_configurations.get(PARAMETERS, ())]
        entries = [*evaluate_sources(context, self._parameters), *evaluate_sources(context, own.parameters)]
        executable = perform_text(context, self.cmd[0])
        package = "" if self._package is None else perform_text(context, self._package)
        sources = (*(source for source in scope if source.content), *entries)
        name = check_node_name(name) if name else ""
        return NodePlan(package, executable, namespace, name, tuple(arguments), sources), own

    def _complete(self, context: LaunchContext, request: ProcessRequest, plan: NodePlan, own: RosArguments) -> None:
        """Writes the node into the request of its process, and plans its parameters.

        Args:
            context: Launch context.
            request: Request of the process.
            plan: The node for ROS 1.
            own: ROS arguments of the node.
        """
        name = plan.name or (name_from(plan.executable) if plan.sources or plan.late_plan else "")
        self._full_name = self._full_name or full_name(plan.namespace, name or name_from(plan.executable))
        path = program_of_package(plan.package, plan.executable) if plan.package else plan.executable
        request.name = full_name(plan.namespace, name or name_from(plan.executable)).lstrip("/")
        request.node_name = full_name(plan.namespace, name) if name else ""
        request.is_node = True
        scope_remappings = list(context.launch_configurations.get(REMAPPINGS, ()))
        pairs = [(perform_text(context, old), perform_text(context, new)) for old, new in self._remappings]
        remappings = [f"{old}:={new}" for old, new in [*scope_remappings, *pairs, *own.remappings]]
        names = [f"__name:={name}"] if name else []
        prefix = self.prefix_of(context, path)
        request.command = [*prefix, path, *plan.arguments, *remappings, *names]
        request.environment.pop("ROS_NAMESPACE", None)
        if plan.namespace != "/":
            request.environment["ROS_NAMESPACE"] = plan.namespace
        self._plan_parameters(context, request, plan, name)

    @staticmethod
    def _plan_parameters(context: LaunchContext, request: ProcessRequest, plan: NodePlan, name: str) -> None:
        node = full_name(plan.namespace, name)
        if name:
            parameters = parameters_of_node(plan.sources, node)
            plan_parameters(context.parameters, plan.namespace, name, parameters)
        for key, value in plan.namespace_parameters.items():
            context.parameters.set(full_name(plan.namespace, key), value, f"node {node}")
        late_plan = plan.late_plan
        if late_plan is None:
            return

        def prepare(lookup: Lookup) -> None:
            found = late_plan(lookup)
            owner = f"node {node}"
            for key, value in found.parameters.items():
                context.parameters.set(full_name(node, key), value, owner)
            for key, value in found.namespace_parameters.items():
                context.parameters.set(full_name(plan.namespace, key), value, owner)
            if found.simulated_time:
                context.parameters.set(f"/{CLOCK}", True, owner, shared=True)
            if found.program is not None:
                path = program_of_package(*found.program)
                own = program_of_package(plan.package, plan.executable)
                request.command = [path if word == own else word for word in request.command]

        request.prepare = prepare


def _source_of_scope(entry: Any) -> ParameterSource:
    return entry if isinstance(entry, ParameterSource) else ParameterSource(dict(entry))
