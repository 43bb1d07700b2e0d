# SPDX-License-Identifier: BSD-3-Clause
"""Pipelines are found in the package first, then among the packaged ones, and come out in ROS 1's layout."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from launch_param_builder import ParameterFileError
from moveit_configs_utils import MoveItConfigsBuilder

PackageMaker = Callable[..., Path]
PACKAGED = {"chomp", "ompl", "pilz_industrial_motion_planner", "stomp"}
MOVEIT1 = "default_planner_request_adapters/"
MOVEIT2 = """planning_plugins: [ompl_interface/OMPLPlanner]
request_adapters:
  - default_planning_request_adapters/ResolveConstraintFrames
  - default_planning_request_adapters/ValidateWorkspaceBounds
  - default_planning_request_adapters/CheckStartStateBounds
  - default_planning_request_adapters/CheckStartStateCollision
response_adapters:
  - default_planning_response_adapters/AddTimeOptimalParameterization
  - default_planning_response_adapters/AddRuckigTrajectorySmoothing
  - default_planning_response_adapters/ValidateSolution
  - default_planning_response_adapters/DisplayMotionPath
planner_configs: {Fast: {type: "geometric::RRTConnect"}}
"""
LAUNCH_FILE = """<launch>
  <arg name="planning_adapters" default="default_planner_request_adapters/AddTimeParameterization
                                         default_planner_request_adapters/FixStartStateBounds"/>
  <arg name="start_state_max_bounds_error" default="0.25"/>
  <param name="planning_plugin" value="ompl_interface/OMPLPlanner"/>
  <param name="request_adapters" value="$(arg planning_adapters)"/>
  <param name="start_state_max_bounds_error" value="$(arg start_state_max_bounds_error)"/>
  <rosparam command="load" file="$(dirname)/../config/ompl_planning.yaml"/>
</launch>
"""


def loaded(**arguments: Any) -> dict[str, Any]:
    return MoveItConfigsBuilder("r").planning_pipelines(**arguments).to_moveit_configs().planning_pipelines


def test_all_pipelines_of_the_package_and_all_packaged_ones_are_loaded(make_package: PackageMaker) -> None:
    make_package({"config/own_planning.yaml": "planning_plugin: my_package.my_module/MyPlanner\n"})
    result = loaded()
    assert set(result["planning_pipelines"]) == {"own", *PACKAGED}
    assert result["default_planning_pipeline"] == "ompl"


def test_without_load_all_only_those_of_the_package_are_loaded_and_the_first_is_the_default(
    make_package: PackageMaker,
) -> None:
    make_package({f"config/{name}_planning.yaml": "planning_plugin: module/Class\n" for name in ("b", "a")})
    result = loaded(load_all=False)
    assert list(result["planning_pipelines"]) == ["a", "b"]
    assert result["default_planning_pipeline"] == "a"


def test_named_pipelines_come_from_the_package_or_else_from_the_packaged_files(make_package: PackageMaker) -> None:
    make_package(
        {"config/stomp_planning.yaml": "planning_plugin: stomp_moveit/StompPlanner\nstomp_moveit: {delta_t: 9}"}
    )
    result = loaded(pipelines=["stomp", "pilz_industrial_motion_planner"])
    assert set(result["planning_pipelines"]) == {"stomp", "pilz_industrial_motion_planner"}
    assert result["planning_pipelines"]["stomp"]["stomp_moveit"] == {"delta_t": 9}
    pilz = result["planning_pipelines"]["pilz_industrial_motion_planner"]
    assert pilz["planning_plugin"] == "pilz_industrial_motion_planner/CommandPlanner"
    assert "pilz_industrial_motion_planner/MoveGroupSequenceAction" in pilz["capabilities"].split()
    assert result["default_planning_pipeline"] == "stomp"


def test_a_default_that_is_not_loaded_is_refused_with_those_that_are(make_package: PackageMaker) -> None:
    make_package()
    with pytest.raises(RuntimeError, match="`lerp` doesn't name any of the input pipelines `ompl,stomp`"):
        loaded(default_planning_pipeline="lerp", pipelines=["ompl", "stomp"])


def test_a_named_pipeline_without_a_file_is_an_error_that_says_where_it_was_looked_for(
    make_package: PackageMaker,
) -> None:
    folder = make_package()
    with pytest.raises(ParameterFileError) as caught:
        loaded(pipelines=["ompl", "lerp"])
    for place in (folder / "config/lerp_planning.yaml", folder / "launch/lerp_planning_pipeline.launch.xml"):
        assert str(place) in str(caught.value)


def test_a_pipeline_without_a_planner_is_left_out_with_a_warning_unless_it_is_named(
    make_package: PackageMaker, caplog: pytest.LogCaptureFixture
) -> None:
    make_package({"config/odd_planning.yaml": "speed: 1\n"})
    assert "odd" not in loaded()["planning_pipelines"]
    assert "pipeline 'odd': no planning_plugin; looked in" in caplog.text
    with pytest.raises(ParameterFileError, match="pipeline 'odd': no planning_plugin"):
        loaded(pipelines=["odd"])


def test_ompl_without_planners_gets_the_packaged_ones(make_package: PackageMaker) -> None:
    make_package({"config/ompl_planning.yaml": "planning_plugin: ompl_interface/OMPLPlanner\n"})
    configs = loaded(pipelines=["ompl"])["planning_pipelines"]["ompl"]["planner_configs"]
    assert configs["RRTConnect"]["type"] == "geometric::RRTConnect"
    assert len(configs) > 10


def test_moveit_2_files_come_out_as_moveit_1_writes_them(make_package: PackageMaker) -> None:
    make_package({"config/ompl_planning.yaml": MOVEIT2})
    pipeline = loaded(pipelines=["ompl"])["planning_pipelines"]["ompl"]
    assert pipeline["planning_plugin"] == "ompl_interface/OMPLPlanner"
    assert pipeline["planner_configs"] == {"Fast": {"type": "geometric::RRTConnect"}}
    assert pipeline["request_adapters"].split() == [
        f"{MOVEIT1}{name}"
        for name in (
            "AddRuckigTrajectorySmoothing",
            "AddTimeOptimalParameterization",
            "ResolveConstraintFrames",
            "FixWorkspaceBounds",
            "FixStartStateBounds",
        )
    ]
    assert "planning_plugins" not in pipeline
    assert "response_adapters" not in pipeline


@pytest.mark.parametrize("text", ["[module/First, module/Second]", "module/First module/Second"])
def test_adapters_under_other_names_stay_as_they_are(make_package: PackageMaker, text: str) -> None:
    make_package({"config/own_planning.yaml": f"planning_plugin: module/Class\nrequest_adapters: {text}\n"})
    pipeline = loaded(pipelines=["own"])["planning_pipelines"]["own"]
    assert pipeline["request_adapters"] == "module/First module/Second"


def test_several_plugins_of_one_pipeline_are_a_warning_since_only_the_first_runs(
    make_package: PackageMaker, caplog: pytest.LogCaptureFixture
) -> None:
    folder = make_package({"config/own_planning.yaml": "planning_plugins: [module/First, module/Second]\n"})
    assert loaded(pipelines=["own"])["planning_pipelines"]["own"]["planning_plugin"] == "module/First"
    assert f"{folder}/config/own_planning.yaml: planning_plugins lists module/First, module/Second" in caplog.text


def test_a_list_of_adapters_that_is_none_is_refused(make_package: PackageMaker) -> None:
    make_package({"config/own_planning.yaml": "planning_plugin: module/Class\nrequest_adapters: {a: 1}\n"})
    with pytest.raises(
        ParameterFileError, match="own_planning.yaml: request_adapters is {'a': 1}; expected a list of names"
    ):
        loaded(pipelines=["own"])


def test_planner_and_adapters_of_moveit_1_come_from_its_launch_file(make_package: PackageMaker) -> None:
    make_package(
        {
            "config/ompl_planning.yaml": "planner_configs: {Fast: {type: 'geometric::RRTConnect'}}\n",
            "launch/ompl_planning_pipeline.launch.xml": LAUNCH_FILE,
        }
    )
    pipeline = loaded(pipelines=["ompl"])["planning_pipelines"]["ompl"]
    assert pipeline["request_adapters"] == f"{MOVEIT1}AddTimeParameterization {MOVEIT1}FixStartStateBounds"
    assert pipeline["start_state_max_bounds_error"] == 0.25
    assert list(pipeline["planner_configs"]) == ["Fast"]


def test_a_launch_file_that_roslaunch_refuses_is_a_warning_and_the_packaged_planner_counts(
    make_package: PackageMaker, caplog: pytest.LogCaptureFixture
) -> None:
    folder = make_package(
        {
            "config/ompl_planning.yaml": "arm: {default_planner_config: RRT}\n",
            "launch/ompl_planning_pipeline.launch.xml": LAUNCH_FILE.replace("$(dirname)/..", "$(find lost_package)"),
        }
    )
    pipeline = loaded(pipelines=["ompl"])["planning_pipelines"]["ompl"]
    assert pipeline["planning_plugin"] == "ompl_interface/OMPLPlanner"
    assert f"{MOVEIT1}AddTimeOptimalParameterization" in pipeline["request_adapters"].split()
    assert pipeline["arm"] == {"default_planner_config": "RRT"}
    assert f"{folder}/launch/ompl_planning_pipeline.launch.xml: its parameters are left out" in caplog.text


@pytest.mark.parametrize("declaration", ['<arg name="side"/>', "", '<arg name="side" value="left"/>'])
def test_an_argument_that_a_launch_file_requires_has_the_value_of_the_package(
    make_package: PackageMaker, declaration: str
) -> None:
    required = f'<launch>{declaration}<param name="planning_plugin" value="$(arg side)/Planner"/></launch>'
    make_package({"launch/own_planning_pipeline.launch.xml": required, "config/r.urdf": "<robot/>"})
    builder = (
        MoveItConfigsBuilder("r").robot_description(mappings={"side": "left"}).planning_pipelines(pipelines=["own"])
    )
    assert builder.to_dict()["planning_pipelines"]["own"]["planning_plugin"] == "left/Planner"
