# SPDX-License-Identifier: BSD-3-Clause
"""Services of the message stores, one set for each kind of message, and a topic with all changes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import rospy
from std_srvs.srv import Trigger, TriggerResponse

from modular_framework_core import srv
from modular_framework_core.files import default_folders
from modular_framework_core.files.yaml_entries import EntryError
from modular_framework_core.managers import message_files
from modular_framework_core.managers.message_numbers import position_fault
from modular_framework_core.managers.message_store import Change, MessageNotFoundError, MessageStore
from modular_framework_core.managers.ros_manager_services import ManagerServices
from modular_framework_core.msg import ManagerChange
from modular_framework_ros.declared_parameters import DeclaredParameters


@dataclass(frozen=True, slots=True)
class MessageKind:
    """Services and message types of one kind of message.

    Attributes:
        noun: Noun for the message in logs.
        add_type: Service type that stores a message.
        get_type: Service type that returns a message.
        message_field: Field of the message in both types.
        suffixes: Suffixes of the services ``add_<suffix>`` and ``get_<suffix>``; only the last suffix has
            ``remove_<suffix>``.
        plural: Suffix of the services for all messages, such as ``list_<plural>``.
    """

    noun: str
    add_type: Any
    get_type: Any
    message_field: str
    suffixes: tuple[str, ...]
    plural: str

    @property
    def name_field(self) -> str:
        """Field of the name in both requests."""
        return f"{self.noun.replace(' ', '_')}_name"

    @property
    def message_type(self) -> Any:
        """Class of the messages."""
        return type(getattr(self.add_type._request_class(), self.message_field))


JOINT_STATE = MessageKind(
    "joint state",
    srv.AddJointState,
    srv.GetJointState,
    "joint_state",
    ("joint_state",),
    "joint_states",
)
TRAJECTORY = MessageKind(
    "trajectory",
    srv.AddJointTrajectory,
    srv.GetJointTrajectory,
    "joint_trajectory",
    ("trajectory",),
    "trajectories",
)
POSE = MessageKind("pose", srv.AddPoseStamped, srv.GetPoseStamped, "pose_stamped", ("pose_stamped", "pose"), "poses")
ROBOT_POSE = MessageKind("robot pose", srv.AddRobotPose, srv.GetRobotPose, "robot_pose", ("robot_pose",), "robot_poses")
PLAN = MessageKind("plan", srv.AddMoveitPlan, srv.GetMoveitPlan, "moveit_plan", ("plan",), "plans")
GRASP = MessageKind("grasp", srv.AddStandardisedGrasp, srv.GetStandardisedGrasp, "grasp_message", ("grasp",), "grasps")


def complete_grasp_id(grasp: Any, name: str) -> None:
    """Sets the ID of a grasp without ID to the grasp's name."""
    if not grasp.grasp_id:
        grasp.grasp_id = name


@dataclass(frozen=True, slots=True)
class NamedFile:
    """A file with the initial messages of a manager.

    Attributes:
        path: Path of the file.
        read: Function that returns the valid messages by name, and the errors of invalid entries.
    """

    path: Path
    read: Callable[[Path], tuple[dict[str, Any], list[EntryError]]]


class MessageServices(ManagerServices):
    """ROS interface of a message store.

    An invalid request is answered with ``success=False``, and its reason is logged.

    Services:
        ``add_<suffix>``, ``get_<suffix>`` (types of the kind): Store or return a message.
        ``remove_<suffix>`` (RemoveMessage): Removes a named message.
        ``list_<plural>`` (ListMessages), ``clear_<plural>`` (std_srvs/Trigger): List or remove all messages.
        ``clear_anonymous_<plural>`` (std_srvs/Trigger): Removes the anonymous messages.
        ``save_<plural>``, ``load_<plural>`` (MessageFile): Save all messages to a file, or load a saved file.
        ``reload_<plural>`` (MessageFile): Replaces all messages by the content of a file of named messages, by default
            the initial file.
        ``reinitialise_<suffix>_manager`` (ReinitManager): GRIP's name of ``reload_<plural>``.
    Parameters:
        ``~file_directory``: Folder of saved files; default: ``$ROS_HOME/modular_framework/managers``. Files elsewhere
            are refused, except that ``reload_<plural>`` also reads from the folder of the initial file.
    Publishers:
        ``manager_changes`` (ManagerChange): Every change, in order.
    """

    def __init__(self, kind: MessageKind, named_file: NamedFile | None = None) -> None:
        """Reads the file of named messages, if any; :meth:`connect` advertises the services."""
        self.kind = kind
        self._file = named_file
        self.store: MessageStore[Any] = MessageStore(
            kind.noun, complete_grasp_id if kind is GRASP else None, self._publish_change
        )
        super().__init__()
        self._changes: rospy.Publisher | None = None
        if named_file is not None:
            for fault in self._read(named_file)[1]:
                rospy.logerr("%s. This entry is skipped.", fault)

    def connect(self) -> None:
        """Advertises the services.

        Raises:
            ParameterError: A parameter has an invalid value.
        """
        directory = DeclaredParameters("modular_framework_core", "managers").value("~file_directory")
        self._folder = Path(directory) if directory else default_folders.framework_home() / "managers"
        self._changes = rospy.Publisher("manager_changes", ManagerChange, queue_size=1000)
        kind, last = self.kind, self.kind.suffixes[-1]
        for suffix in kind.suffixes:
            self._serve(f"add_{suffix}", kind.add_type, self._add)
            self._serve(f"get_{suffix}", kind.get_type, self._get)
        self._serve(f"remove_{last}", srv.RemoveMessage, self._remove)
        self._serve(f"list_{kind.plural}", srv.ListMessages, self._list)
        self._serve(f"clear_{kind.plural}", Trigger, self._clear)
        self._serve(f"clear_anonymous_{kind.plural}", Trigger, self._clear_anonymous)
        for verb, handler in (("save", self._save), ("load", self._load), ("reload", self._reload)):
            self._serve(f"{verb}_{kind.plural}", srv.MessageFile, handler)
        self._serve(f"reinitialise_{last}_manager", srv.ReinitManager, self._reinitialise)

    def _serve(self, name: str, service_type: Any, handler: Callable[[Any], Any]) -> None:
        self._services.append(rospy.Service(name, service_type, handler))

    def _publish_change(self, change: Change) -> None:
        if self._changes is not None:
            self._changes.publish(
                ManagerChange(
                    rospy.Time.now(), self.kind.noun, change.action.value, change.name, change.named, change.anonymous
                )
            )

    def _add(self, request: Any) -> Any:
        name = getattr(request, self.kind.name_field)
        fault = position_fault(getattr(request, self.kind.message_field))
        if fault:
            rospy.logerr(
                "The %s '%s' is not stored: %s; give one finite position for each joint.", self.kind.noun, name, fault
            )
            return self.kind.add_type._response_class(success=False)
        self.store.add(getattr(request, self.kind.message_field), name)
        return self.kind.add_type._response_class(success=True)

    def _get(self, request: Any) -> Any:
        response = self.kind.get_type._response_class()
        try:
            setattr(response, self.kind.message_field, self.store.get(getattr(request, self.kind.name_field)))
            response.success = True
        except MessageNotFoundError as error:
            rospy.logerr("%s", error)
            response.success = False
        return response

    def _remove(self, request: Any) -> Any:
        try:
            self.store.remove(request.name)
        except MessageNotFoundError as error:
            rospy.logerr("%s", error)
            return srv.RemoveMessageResponse(success=False, message=str(error))
        return srv.RemoveMessageResponse(success=True)

    def _list(self, request: Any) -> Any:
        return srv.ListMessagesResponse(names=list(self.store.names()), anonymous=self.store.anonymous_count())

    def _clear(self, request: Any) -> TriggerResponse:
        self.store.clear()
        return TriggerResponse(success=True)

    def _clear_anonymous(self, request: Any) -> TriggerResponse:
        self.store.clear(named=False)
        return TriggerResponse(success=True)

    def _save(self, request: Any) -> Any:
        try:
            path = message_files.path_of(request.path, self._folder)
            count = message_files.save(path, self.kind.noun, *self.store.contents())
        except message_files.MessageFileError as error:
            return self._refuse_request(str(error))
        return srv.MessageFileResponse(success=True, message=str(path), count=count)

    def _load(self, request: Any) -> Any:
        try:
            path = message_files.path_of(request.path, self._folder)
            named, anonymous = message_files.load(path, self.kind.noun, self.kind.message_type)
        except message_files.MessageFileError as error:
            return self._refuse_request(str(error))
        messages = [
            *((f"'{name}'", item) for name, item in named.items()),
            *((f"anonymous message {index}", item) for index, item in enumerate(anonymous, start=1)),
        ]
        faults = [
            f"{path}: {label}: {fault}; give one finite position for each joint"
            for label, item in messages
            if (fault := position_fault(item))
        ]
        if faults:
            return self._refuse_request("\n".join(faults))
        self.store.load(named, anonymous)
        return srv.MessageFileResponse(success=True, message=str(path), count=len(named) + len(anonymous))

    def _reload(self, request: Any) -> Any:
        if self._file is None:
            if request.path:
                return self._refuse_request(
                    f"no file of named messages is configured for the kind '{self.kind.noun}'; "
                    f"use load_{self.kind.plural} to read a saved file"
                )
            self.store.clear()
            return srv.MessageFileResponse(success=True)
        file = self._file
        try:
            if request.path:
                path = message_files.path_of(request.path, self._folder, (file.path.parent,))
                file = NamedFile(path, file.read)
        except message_files.MessageFileError as error:
            return self._refuse_request(str(error))
        count, faults = self._read(file)
        if faults:
            return self._refuse_request("\n".join(map(str, faults)), count)
        return srv.MessageFileResponse(success=True, message=str(file.path), count=count)

    def _reinitialise(self, request: Any) -> Any:
        response = self._reload(srv.MessageFileRequest(path=request.argument))
        return srv.ReinitManagerResponse(success=response.success)

    def _read(self, file: NamedFile) -> tuple[int, list[EntryError]]:
        """Replaces the stored messages by the valid messages of a file, unless all of its entries are invalid."""
        named, faults = file.read(file.path)
        if faults and not named:
            return 0, faults
        self.store.load(named, clear=True)
        if named:
            rospy.loginfo("Loaded the %s of %s: %s.", self.kind.plural.replace("_", " "), file.path, ", ".join(named))
        return len(named), faults

    def _refuse_request(self, reason: str, count: int = 0) -> Any:
        rospy.logerr("%s", reason)
        return srv.MessageFileResponse(success=False, message=reason, count=count)
