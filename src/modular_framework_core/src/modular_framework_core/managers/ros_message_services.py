# SPDX-License-Identifier: BSD-3-Clause
"""Services of the message stores, one set for each kind of message, and the topic of their changes."""

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
from modular_framework_core.managers.message_numbers import unusable_position
from modular_framework_core.managers.message_store import Change, MessageNotFoundError, MessageStore
from modular_framework_core.managers.ros_manager_services import ManagerServices
from modular_framework_core.msg import ManagerChange
from modular_framework_ros.declared_parameters import DeclaredParameters

OVERWRITTEN_PERIOD_S = 1.0  # a line of the log takes as long as ten requests; manager_changes reports every one


@dataclass(frozen=True, slots=True)
class MessageKind:
    """The services and message types of one kind of message.

    Attributes:
        noun: Word for the message in log lines.
        add_type: Service type that stores a message.
        get_type: Service type that hands one out.
        message_field: Field of the message in both types.
        name_field: Field of the name in both requests.
        suffixes: Services for one message are called ``add_<suffix>`` and ``get_<suffix>``.
        plural: Services for all messages are called ``list_<plural>`` and so on; only the last suffix has a
            ``remove_<suffix>``.
    """

    noun: str
    add_type: Any
    get_type: Any
    message_field: str
    name_field: str
    suffixes: tuple[str, ...]
    plural: str

    @property
    def message_type(self) -> Any:
        """Class of the messages."""
        return type(getattr(self.add_type._request_class(), self.message_field))


JOINT_STATE = MessageKind(
    "joint state",
    srv.AddJointState,
    srv.GetJointState,
    "joint_state",
    "joint_state_name",
    ("joint_state",),
    "joint_states",
)
TRAJECTORY = MessageKind(
    "trajectory",
    srv.AddJointTrajectory,
    srv.GetJointTrajectory,
    "joint_trajectory",
    "trajectory_name",
    ("trajectory",),
    "trajectories",
)
POSE = MessageKind(
    "pose", srv.AddPoseStamped, srv.GetPoseStamped, "pose_stamped", "pose_name", ("pose_stamped", "pose"), "poses"
)
ROBOT_POSE = MessageKind(
    "robot pose", srv.AddRobotPose, srv.GetRobotPose, "robot_pose", "robot_pose_name", ("robot_pose",), "robot_poses"
)
PLAN = MessageKind("plan", srv.AddMoveitPlan, srv.GetMoveitPlan, "moveit_plan", "plan_name", ("plan",), "plans")
GRASP = MessageKind(
    "grasp", srv.AddStandardisedGrasp, srv.GetStandardisedGrasp, "grasp_message", "grasp_name", ("grasp",), "grasps"
)


def complete_grasp_id(grasp: Any, name: str) -> None:
    """Gives a grasp without an id the name it is stored under."""
    if not grasp.grasp_id:
        grasp.grasp_id = name


@dataclass(frozen=True, slots=True)
class NamedFile:
    """A file of named messages a manager begins with.

    Attributes:
        path: The file.
        read: Gives its usable messages by name, and the faults of the others.
    """

    path: Path
    read: Callable[[Path], tuple[dict[str, Any], list[EntryError]]]


class MessageServices(ManagerServices):
    """One store behind its services.

    A request that cannot be served answers ``success=False`` and logs the reason; it never raises.

    Services:
        ``add_<suffix>``, ``get_<suffix>``: of the kind's types, for each of its suffixes.
        ``remove_<suffix>`` (RemoveMessage), ``list_<plural>`` (ListMessages), ``clear_<plural>`` (std_srvs/Trigger):
            all messages; ``clear_anonymous_<plural>`` (std_srvs/Trigger): those that wait to be read.
        ``save_<plural>``, ``load_<plural>`` (MessageFile): all messages to a file and from one.
        ``reload_<plural>`` (MessageFile): forgets everything and reads the file of named messages again, or
            another one. ``reinitialise_<suffix>_manager`` (ReinitManager): GRIP's name for that.
    Parameters:
        ``~file_directory``: folder of the files that are saved and loaded (default:
            ``$ROS_HOME/modular_framework/managers``); a file elsewhere is refused, but for
            ``reload_<plural>``, which also takes one beside the node's own.
    Publishers:
        ``manager_changes`` (ManagerChange): every change, in order.
    """

    def __init__(self, kind: MessageKind, named_file: NamedFile | None = None) -> None:
        """Reads the file of named messages, if there is one; nothing is advertised before :meth:`connect`."""
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
        """Advertises the services; raises ParameterError where a parameter has a wrong value."""
        given = DeclaredParameters("modular_framework_core", "managers").value("~file_directory")
        self._folder = Path(given) if given else default_folders.framework_home() / "managers"
        self._changes = rospy.Publisher("manager_changes", ManagerChange, queue_size=1000)
        kind, last = self.kind, self.kind.suffixes[-1]
        for suffix in kind.suffixes:
            self._serve(f"add_{suffix}", kind.add_type, self._add)
            self._serve(f"get_{suffix}", kind.get_type, self._get)
        self._serve(f"remove_{last}", srv.RemoveMessage, self._remove)
        self._serve(f"list_{kind.plural}", srv.ListMessages, self._list)
        self._serve(f"clear_{kind.plural}", Trigger, self._clear)
        self._serve(f"clear_anonymous_{kind.plural}", Trigger, self._clear_anonymous)
        for verb, work in (("save", self._save), ("load", self._load), ("reload", self._reload)):
            self._serve(f"{verb}_{kind.plural}", srv.MessageFile, work)
        self._serve(f"reinitialise_{last}_manager", srv.ReinitManager, self._reinitialise)

    def _serve(self, name: str, service_type: Any, work: Callable[[Any], Any]) -> None:
        self._services.append(rospy.Service(name, service_type, work))

    def _publish_change(self, change: Change) -> None:
        if self._changes is not None:
            self._changes.publish(
                ManagerChange(
                    rospy.Time.now(), self.kind.noun, change.action.value, change.name, change.named, change.anonymous
                )
            )

    def _add(self, request: Any) -> Any:
        name = getattr(request, self.kind.name_field)
        wrong = unusable_position(getattr(request, self.kind.message_field))
        if wrong:
            rospy.logerr(
                "The %s '%s' is not stored: %s; give one finite position for each joint.", self.kind.noun, name, wrong
            )
            return self.kind.add_type._response_class(success=False)
        if self.store.add(getattr(request, self.kind.message_field), name):
            rospy.loginfo_throttle(OVERWRITTEN_PERIOD_S, f"The {self.kind.noun} '{name}' was overwritten.")
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
            return self._refused(str(error))
        return srv.MessageFileResponse(success=True, message=str(path), count=count)

    def _load(self, request: Any) -> Any:
        try:
            path = message_files.path_of(request.path, self._folder)
            named, anonymous = message_files.load(path, self.kind.noun, self.kind.message_type)
        except message_files.MessageFileError as error:
            return self._refused(str(error))
        messages = [
            *((f"'{name}'", item) for name, item in named.items()),
            *((f"anonymous message {number}", item) for number, item in enumerate(anonymous, start=1)),
        ]
        wrong = [
            f"{path}: {what}: {found}; give one finite position for each joint"
            for what, item in messages
            if (found := unusable_position(item))
        ]
        if wrong:
            return self._refused("\n".join(wrong))
        self.store.load(named, anonymous)
        return srv.MessageFileResponse(success=True, message=str(path), count=len(named) + len(anonymous))

    def _reload(self, request: Any) -> Any:
        if self._file is None:
            if request.path:
                return self._refused(
                    f"no file of named messages is known for the kind '{self.kind.noun}'; "
                    f"load_{self.kind.plural} reads saved files"
                )
            self.store.clear()
            return srv.MessageFileResponse(success=True)
        file = self._file
        try:
            if request.path:
                path = message_files.path_of(request.path, self._folder, (file.path.parent,))
                file = NamedFile(path, file.read)
        except message_files.MessageFileError as error:
            return self._refused(str(error))
        count, faults = self._read(file)
        if faults:
            return self._refused("\n".join(map(str, faults)), count)
        return srv.MessageFileResponse(success=True, message=str(file.path), count=count)

    def _reinitialise(self, request: Any) -> Any:
        answer = self._reload(srv.MessageFileRequest(path=request.argument))
        return srv.ReinitManagerResponse(success=answer.success)

    def _read(self, file: NamedFile) -> tuple[int, list[EntryError]]:
        """Replaces the stored messages by the usable ones of a file; keeps them when the file has none."""
        named, faults = file.read(file.path)
        if faults and not named:
            return 0, faults
        self.store.load(named, clear=True)
        rospy.loginfo(
            "Loaded the %s of %s: %s.", self.kind.plural.replace("_", " "), file.path, ", ".join(named) or "none"
        )
        return len(named), faults

    def _refused(self, reason: str, count: int = 0) -> Any:
        rospy.logerr("%s", reason)
        return srv.MessageFileResponse(success=False, message=reason, count=count)
