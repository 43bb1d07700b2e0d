# SPDX-License-Identifier: BSD-3-Clause
"""Command that creates a method: `python -m mbf_method.create_method NAME --kind planner`."""

from __future__ import annotations

import argparse
import keyword
import sys
from pathlib import Path
from typing import Sequence

TEMPLATES = Path(__file__).parent / "templates"
TEMPLATE_NAME = "new_method"
GRASP_EXPERIMENT = """\
# Compares NAME with the antipodal grasps of the framework, without simulation. In a shell of ./install.sh shell:
#
#   rosrun modular_framework_benchmark run_experiment experiment.yaml

experiment: NAME
mode: grasps
robot: panda_hand_moveit_config
group: panda_manipulator             # the tip of this group is the grasp frame
gripper_joint: panda_finger_joint1
objects: [{model: $object, x: [-0.2, 0.2], y: [0.4, 0.6], yaw: [-3.14, 3.14], rests_at: 0.84}]

factors:
  method:
    antipodal: {method: antipodal_grasps.ros_antipodal_node:AntipodalMethod}
    NAME:
      method: external_grasps.ros_external_node:ExternalMethod
      method_parameters: {command: [COMMAND]}
  object: [cube, can]
compare: method
metrics: [success, generation_time, candidates, reachable_share]

trials: 5                            # scenes and seeds, equal for both methods
seed: 1
time_limit: 120                      # time limit of an episode [s]
"""
PLANNER_EXPERIMENT = """\
# Compares NAME with RRTConnect of the framework, without simulation. In a shell of ./install.sh shell:
#
#   rosrun modular_framework_benchmark make_problems panda_hand_moveit_config panda_arm problems --count 20
#   rosrun modular_framework_benchmark run_experiment experiment.yaml

experiment: NAME
mode: planning
robot: panda_hand_moveit_config      # a MoveIt configuration package
problems: problems                   # folder of sceneNNNN.yaml and requestNNNN.yaml, beside this file
planning_time: 5                     # [s]

factors:
  planner:
    RRTConnect: {pipeline: ompl, planner: RRTConnect}
    NAME:
      pipeline: external
      parameters: {/move_group/planning_pipelines/external/command: [COMMAND]}
compare: planner
metrics: [success, planning_time, planner_method_time, planner_transport_time, path_length]

trials: 20                           # problems and seeds, equal for both planners
seed: 1
time_limit: 60                       # time limit of an episode [s]
"""
POLICY_TASK = """\
# Lets NAME drive a simulated Panda to the joint positions of its goal. In a shell of ./install.sh shell:
#
#   roslaunch panda_hand_robot start_framework.launch task_constructor_script:=FOLDER/task.yaml

name: NAME_task
source: framework_state_machine
node_name: NAME_task
outcomes: [done, failed]
states:
  - RunPolicy:
      source: run_policy
      command: [COMMAND]
      actions: positions             # or velocities, or deltas
      rate: 20                       # actions per second
      horizon: 20                    # actions in a chunk
      chunk: 10                      # actions that run before the next query
      max_duration: 60               # [s]
      must_finish: true
      transitions: {success: done, fail: failed}
"""
FILES = {
    "grasp": ("experiment.yaml", GRASP_EXPERIMENT),
    "planner": ("experiment.yaml", PLANNER_EXPERIMENT),
    "policy": ("task.yaml", POLICY_TASK),
}
"""Name and content of the file that runs a method in the framework, by kind of method."""


def create_method(name: str, kind: str, parent: Path) -> Path:
    """Creates a folder with a method, a test and an experiment or task, and returns the folder.

    The experiment or task runs the method with the interpreter of this process.

    Args:
        name: Name of the method, a Python identifier.
        kind: Key of `FILES`.
        parent: Folder of the new folder.

    Raises:
        ValueError: The name is no Python identifier.
        FileExistsError: The folder exists.
    """
    if not name.isidentifier() or keyword.iskeyword(name):
        raise ValueError(f"the name is '{name}'; it must be a Python identifier, such as my_{kind}")
    folder = parent.resolve() / name
    if folder.exists():
        raise FileExistsError(f"{folder} exists; choose another name, or remove the folder")
    folder.mkdir(parents=True)
    for template, file in ((f"{kind}.py", f"{name}.py"), (f"{kind}_test.py", f"test_{name}.py")):
        text = (TEMPLATES / template).read_text(encoding="utf-8").split("\n", 1)[1]  # without the licence
        (folder / file).write_text(text.replace(TEMPLATE_NAME, name), encoding="utf-8")
    command = ", ".join(f'"{part}"' for part in (sys.executable, folder / f"{name}.py"))
    file, text = FILES[kind]
    text = text.replace("NAME", name).replace("COMMAND", command).replace("FOLDER", str(folder))
    (folder / file).write_text(text, encoding="utf-8")
    return folder


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs the command; returns 0 on success, otherwise 1."""
    parser = argparse.ArgumentParser(prog="create_method", description=(__doc__ or "").splitlines()[0])
    parser.add_argument("name", metavar="NAME", help="name of the method, a Python identifier")
    parser.add_argument("--kind", choices=sorted(FILES), required=True, help="kind of the method")
    parser.add_argument("--into", type=Path, default=Path(), metavar="FOLDER", help="parent folder; default: here")
    options = parser.parse_args(arguments)
    try:
        folder = create_method(options.name, options.kind, options.into)
    except (OSError, ValueError) as error:
        print(f"create_method: {error}", file=sys.stderr)
        return 1
    method = folder / f"{options.name}.py"
    file = folder / FILES[options.kind][0]
    print(f"created {method}, test_{options.name}.py and {file.name}; next:")
    print(f"  {sys.executable} -m mbf_method.check_method --kind {options.kind} -- {sys.executable} {method}")
    if options.kind == "planner":
        problems = f"panda_hand_moveit_config panda_arm {folder / 'problems'} --count 20"
        print(f"  rosrun modular_framework_benchmark make_problems {problems}")
    if options.kind == "policy":
        print(f"  roslaunch panda_hand_robot start_framework.launch task_constructor_script:={file}")
    else:
        print(f"  rosrun modular_framework_benchmark run_experiment {file}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
