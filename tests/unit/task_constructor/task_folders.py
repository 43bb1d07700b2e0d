# SPDX-License-Identifier: BSD-3-Clause
"""A small world for tests of the task constructor: a folder of states, the shipped templates, and one valid task."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from modular_framework_core.files import located_yaml
from modular_framework_core.files.faults import FaultList, TaskFault
from modular_framework_core.task_constructor import generator
from modular_framework_core.task_constructor.known_names import KnownNames
from modular_framework_core.task_constructor.state_catalogue import StateCatalogue
from modular_framework_core.task_constructor.task_builder import TaskBuilder
from modular_framework_core.task_constructor.task_spec import TaskSpec
from modular_framework_core.task_constructor.template_catalogue import TemplateCatalogue

TEMPLATES = Path(__file__).parents[3] / "src" / "modular_framework_core" / "templates"

STATE_FILES = {
    "plan": '''
from typing import Literal

from modular_framework_core.state_api.framework_state import FrameworkState

Kind = Literal["pose", "joint_state"]


class Plan(FrameworkState):
    """Plans."""

    def __init__(self, target, plan_name: str = "", speed: float = 0.5, kind: Kind = "pose",
                 names: "list[str] | None" = None, tries: int = 1, wait: bool = False,
                 outcomes=("success", "fail"), input_keys=(), output_keys=(), io_keys=()):
        super().__init__(outcomes, input_keys, output_keys, io_keys)
        self.target, self.plan_name, self.speed = target, plan_name, speed

    def execute(self, userdata):
        return self.fail("no way") if self.target == "nowhere" else self.succeed()
''',
    "move": """
from modular_framework_core.state_api.framework_state import FrameworkState


class Move(FrameworkState):
    def execute(self, userdata):
        return self.succeed()
""",
    "use_arm": """
from modular_framework_core.state_api.framework_state import FrameworkState


class UseArm(FrameworkState):
    def __init__(self, outcomes=("success", "fail"), io_keys=("arm_commander",)):
        super().__init__(outcomes, (), (), io_keys)

    def execute(self, userdata):
        return self.succeed() if userdata.arm_commander.stop() else self.fail("it goes on")
""",
    "choose": """
from typing import Annotated, Literal

from modular_framework_core.state_api.framework_state import FrameworkState
from modular_framework_core.state_api.option_uses import Key, Named


class Choose(FrameworkState):
    def __init__(self, message_type: Annotated[Literal["pose", "grasp", "pregrasp"], Key("output", "selected_{}")],
                 message_names: Annotated[list[str] | None, Named("option:message_type")] = None,
                 outcomes=("success", "fail"), input_keys=(), output_keys=(), io_keys=()):
        super().__init__(outcomes, input_keys, output_keys, io_keys)
""",
    "go": """
from typing import Annotated

from modular_framework_core.state_api.framework_state import FrameworkState
from modular_framework_core.state_api.option_uses import Named


class Go(FrameworkState):
    def __init__(self, target_type: str = "",
                 target_name: Annotated[str, Named("option:target_type", userdata=True)] = "",
                 posture: Annotated[str, Named("posture")] = "", group: Annotated[str, Named("group")] = "",
                 makes: Annotated[str, Named("plan", made=True)] = "", runs: Annotated[str, Named("plan")] = "",
                 outcomes=("success", "fail"), input_keys=(), output_keys=(), io_keys=()):
        super().__init__(outcomes, input_keys, output_keys, io_keys)
""",
    "ask": """
from typing import Annotated, Any

from modular_framework_core.state_api.framework_state import FrameworkState
from modular_framework_core.state_api.option_uses import Fields, OutcomeNames, OutputKeys


class Ask(FrameworkState):
    def __init__(self, request: Annotated[dict[str, Any] | None, Fields()] = None,
                 keep: Annotated[dict[str, str] | None, OutputKeys()] = None,
                 outcome_values: Annotated[dict[str, Any] | None, OutcomeNames()] = None,
                 outcomes=("success", "fail"), input_keys=(), output_keys=(), io_keys=()):
        super().__init__(outcomes, input_keys, output_keys, io_keys)
""",
    "recall": """
import smach


class Recall(smach.State):
    def __init__(self, outcomes=("success", "fail"), input_keys=()):
        smach.State.__init__(self, outcomes=outcomes, input_keys=input_keys)

    def execute(self, userdata):
        count = userdata.count
        return "success" if count else "fail"
""",
    "remember": """
import smach


class Remember(smach.State):
    def __init__(self, outcomes=["success", "fail"], **options):
        smach.State.__init__(self, outcomes=outcomes, io_keys=["notes"])
        self.options = options
        self.outcomes = outcomes

    def execute(self, userdata):
        userdata.notes = [*(userdata.notes if "notes" in userdata else []), self.options]
        return self.outcomes[0]
""",
    "broken_file": "class BrokenFile(:\n",
    "wrong_class": "class Wrongclass:\n    pass\n",
}

KNOWN = KnownNames(
    {
        "pose": frozenset({"above", "below"}),
        "joint_state": frozenset({"home"}),
        "posture": frozenset({"open", "closed"}),
        "group": frozenset({"arm", "hand"}),
    },
    {
        "pose": "config/named_poses.yaml",
        "joint_state": "config/named_joint_states.yaml",
        "posture": "group 'hand' of robot.srdf",
        "group": "robot.srdf",
    },
)

GOOD_TASK = """\
name: tiny
source: state_machine
outcomes: [done, gave_up]
states:
  - A:
      source: plan
      target: home
      transitions: {success: B, fail: gave_up}
  - B:
      source: move
      transitions: {success: done, fail: gave_up}
"""


def write_states(folder: Path, more: Mapping[str, str] | None = None) -> Path:
    """Write the state files, and more by name, and return their folder."""
    states = folder / "own_states"
    states.mkdir(exist_ok=True)
    for name, text in {**STATE_FILES, **(more or {})}.items():
        (states / f"{name}.py").write_text(text)
    return states


class World:
    """Builds and generates tasks from text."""

    def __init__(self, folder: Path, *templates: Path, states: Mapping[str, str] | None = None) -> None:
        self.folder = folder
        self.states = StateCatalogue([write_states(folder, states)])
        self.known = KNOWN
        self.template_folders = [*templates, TEMPLATES]
        self.templates = TemplateCatalogue(self.template_folders)

    def build(self, text: str, file: str = "t.yaml") -> TaskSpec:
        """Check a task; ``file`` is what its file is called in messages."""
        faults = FaultList()
        document = located_yaml.loads(text, file, faults)
        return TaskBuilder(self.states, self.templates, faults, self.known).build(document, file)

    def faults(self, text: str, file: str = "t.yaml") -> list[str]:
        """Return the messages about a task, one a fault; none for a valid one."""
        try:
            self.build(text, file)
        except TaskFault as error:
            return [str(fault) for fault in error.faults]
        return []

    def generate(self, text: str) -> str:
        """Return the module of a task."""
        return generator.generate(self.build(text), self.template_folders)

    def write(self, text: str) -> Path:
        """Write the module of a task and return its path."""
        return generator.write(self.build(text), self.generate(text), self.folder / "generated")
