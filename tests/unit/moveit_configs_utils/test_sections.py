# SPDX-License-Identifier: BSD-3-Clause
"""The other sections, and all of them together in one dictionary."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from launch_param_builder import ParameterBuilderFileNotFoundError, ParameterFileError
from moveit_configs_utils import MoveItConfigs, MoveItConfigsBuilder

PackageMaker = Callable[..., Path]
KINECT = "{sensor_plugin: occupancy_map_monitor/PointCloudOctomapUpdater, point_cloud_topic: points}"


def test_every_section_is_loaded_unless_a_step_did(make_package: PackageMaker) -> None:
    make_package({"config/slow.yaml": "joint_limits: {j1: {max_velocity: 0.1}}\n"})
    configs = MoveItConfigsBuilder("r").joint_limits("config/slow.yaml").to_moveit_configs()
    assert configs.joint_limits == {"robot_description_planning": {"joint_limits": {"j1": {"max_velocity": 0.1}}}}
    assert list(configs.robot_description_kinematics["robot_description_kinematics"]) == ["arm"]
    assert configs.trajectory_execution["controller_list"][0]["name"] == "arm_controller"
    assert configs.move_group_capabilities == {"capabilities": "", "disable_capabilities": ""}
    assert configs.moveit_cpp == {}


def test_the_dictionary_has_every_parameter_in_ros_1s_layout(make_package: PackageMaker) -> None:
    make_package()
    parameters = MoveItConfigsBuilder("r").to_dict()
    assert set(parameters) == {
        "robot_description",
        "robot_description_semantic",
        "robot_description_kinematics",
        "robot_description_planning",
        "planning_pipelines",
        "default_planning_pipeline",
        "moveit_manage_controllers",
        "moveit_controller_manager",
        "controller_list",
        "moveit_simple_controller_manager",
        "planning_scene_monitor",
    }
    assert parameters["robot_description_planning"] == {
        "default_velocity_scaling_factor": 0.2,
        "joint_limits": {"j1": {"max_velocity": 1.0}},
        "cartesian_limits": {"max_trans_vel": 1.0},
    }
    assert parameters == MoveItConfigsBuilder("r").to_moveit_configs().to_dict()


def test_the_sections_stay_as_they_are_when_the_dictionary_is_made(make_package: PackageMaker) -> None:
    make_package()
    configs = MoveItConfigsBuilder("r").to_moveit_configs()
    configs.to_dict()
    assert "cartesian_limits" not in configs.joint_limits["robot_description_planning"]


def test_own_parameters_of_the_builder_are_in_its_dictionary(make_package: PackageMaker) -> None:
    make_package({"config/extra.yaml": "rate: 5\n"})
    builder = MoveItConfigsBuilder("r").yaml("config/extra.yaml").parameter("flag", True)
    assert builder.to_dict(include_moveit_configs=False) == {"rate": 5, "flag": True}
    assert {"rate", "flag", "robot_description"} <= set(builder.to_dict())


def test_what_the_planning_scene_monitor_publishes_is_below_its_name(make_package: PackageMaker) -> None:
    make_package()
    builder = MoveItConfigsBuilder("r").planning_scene_monitor(
        publish_state_updates=False, publish_robot_description=True
    )
    assert builder.to_moveit_configs().planning_scene_monitor == {
        "planning_scene_monitor": {
            "publish_planning_scene": True,
            "publish_geometry_updates": True,
            "publish_state_updates": False,
            "publish_transforms_updates": True,
            "publish_robot_description": True,
            "publish_robot_description_semantic": False,
        }
    }


@pytest.mark.parametrize("name", ["kinematics.yaml", "joint_limits.yaml", "pilz_cartesian_limits.yaml"])
def test_a_file_a_robot_can_do_without_is_a_warning_and_an_error_when_a_step_asks_for_it(
    make_package: PackageMaker, name: str, caplog: pytest.LogCaptureFixture
) -> None:
    folder = make_package(without=[f"config/{name}"])
    assert MoveItConfigsBuilder("r").to_dict()["planning_pipelines"]
    assert f"File {folder}/config/{name} doesn't exist" in caplog.text
    builder = MoveItConfigsBuilder("r")
    step = {
        "kinematics.yaml": builder.robot_description_kinematics,
        "joint_limits.yaml": builder.joint_limits,
        "pilz_cartesian_limits.yaml": builder.pilz_cartesian_limits,
    }[name]
    with pytest.raises(ParameterBuilderFileNotFoundError, match=name):
        step()


def test_limits_of_pilz_are_loaded_with_its_pipeline_only(make_package: PackageMaker) -> None:
    make_package()
    configs = MoveItConfigsBuilder("r").planning_pipelines(pipelines=["ompl"]).to_moveit_configs()
    assert configs.pilz_cartesian_limits == {}


def test_limits_of_pilz_under_their_old_name_are_taken_with_a_warning(
    make_package: PackageMaker, caplog: pytest.LogCaptureFixture
) -> None:
    old = {"config/cartesian_limits.yaml": "cartesian_limits: {max_trans_vel: 3.0}\n"}
    make_package(old, without=["config/pilz_cartesian_limits.yaml"])
    parameters = MoveItConfigsBuilder("r").to_dict()
    assert parameters["robot_description_planning"]["cartesian_limits"] == {"max_trans_vel": 3.0}
    assert "cartesian_limits.yaml is deprecated, please rename to pilz_cartesian_limits.yaml" in caplog.text


def test_limits_of_pilz_need_no_joint_limits(make_package: PackageMaker) -> None:
    make_package(without=["config/joint_limits.yaml"])
    limits = MoveItConfigsBuilder("r").to_dict()["robot_description_planning"]
    assert limits == {"cartesian_limits": {"max_trans_vel": 1.0}}


@pytest.mark.parametrize("text", ["sensors: []\n", "sensors: [{}]\n", "octomap_frame: world\n"])
def test_sensors_without_a_first_one_are_none(make_package: PackageMaker, text: str) -> None:
    make_package({"config/sensors_3d.yaml": text})
    assert MoveItConfigsBuilder("r").to_moveit_configs().sensors_3d == {}


@pytest.mark.parametrize("text", [f"sensors: [{KINECT}]\n", f"sensors: [kinect]\nkinect: {KINECT}\n"])
def test_sensors_are_listed_in_either_form(make_package: PackageMaker, text: str) -> None:
    make_package({"config/sensors_3d.yaml": f"octomap_resolution: 0.05\n{text}"})
    parameters = MoveItConfigsBuilder("r").to_dict()
    assert parameters["octomap_resolution"] == 0.05
    assert parameters["sensors"] == [
        {"sensor_plugin": "occupancy_map_monitor/PointCloudOctomapUpdater", "point_cloud_topic": "points"}
    ]
    assert "kinect" not in parameters


def test_faulty_sensors_and_missing_files_of_them_are_named(make_package: PackageMaker) -> None:
    make_package({"config/sensors_3d.yaml": "sensors: [kinect]\n", "config/other.yaml": "sensors: {a: 1}\n"})
    with pytest.raises(ParameterFileError, match="sensors_3d.yaml: sensors lists kinect; add a mapping of that name"):
        MoveItConfigsBuilder("r").to_moveit_configs()
    with pytest.raises(ParameterFileError, match="other.yaml: sensors is {'a': 1}; expected a list"):
        MoveItConfigsBuilder("r").sensors_3d("config/other.yaml")
    with pytest.raises(ParameterBuilderFileNotFoundError, match="lost.yaml"):
        MoveItConfigsBuilder("r").sensors_3d("config/lost.yaml")


def test_moveit_cpp_is_loaded_by_its_step_and_leaves_the_pipelines_there(make_package: PackageMaker) -> None:
    make_package({"config/moveit_cpp.yaml": "planning_pipelines: {pipeline_names: [ompl]}\nrate: 3\n"})
    parameters = MoveItConfigsBuilder("r").moveit_cpp().to_dict()
    assert parameters["rate"] == 3
    assert parameters["planning_pipelines"]["pipeline_names"] == ["ompl"]
    assert parameters["planning_pipelines"]["ompl"]["planning_plugin"] == "ompl_interface/OMPLPlanner"


def test_sections_made_by_hand_add_up_in_any_combination() -> None:
    limits = {"left_planning": {"cartesian_limits": {"max_trans_vel": 1.0}}}
    assert MoveItConfigs(pilz_cartesian_limits=limits).to_dict() == limits


def test_a_package_of_moveit_1_is_read_as_it_is() -> None:
    configs = MoveItConfigsBuilder("ur5_ezgripper").to_moveit_configs()
    parameters = configs.to_dict()
    assert parameters["controller_list"][0]["joints"][0] == "shoulder_pan_joint"
    assert parameters["robot_description"].count("<link ") > 5
    assert "AddTimeOptimalParameterization" in parameters["planning_pipelines"]["ompl"]["request_adapters"]
    assert parameters["robot_description_planning"]["cartesian_limits"]["max_trans_vel"] == 1.0


@pytest.mark.parametrize("robot", ["ur5_ezgripper", "panda_hand", "iiwa_wsg50", "dual_panda"])
def test_the_shipped_packages_load_without_a_word_of_deprecation(robot: str, caplog: pytest.LogCaptureFixture) -> None:
    parameters = MoveItConfigsBuilder(robot).pilz_cartesian_limits().to_dict()
    assert "deprecated" not in caplog.text
    assert parameters["robot_description_planning"]["cartesian_limits"]["max_trans_vel"] == 1.0
