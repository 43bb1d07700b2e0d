# SPDX-License-Identifier: BSD-3-Clause
"""The C++ functions make the same messages as the Python ones."""

from __future__ import annotations

import io
import subprocess
from pathlib import Path

import genpy
import pytest
import rospy

from modular_framework_core.grasping.grasp_messages import generate_pose_stamped_message, get_standardised_grasp
from modular_framework_core.msg import StandardisedGrasp

ROOT = Path(__file__).parents[3]
PROGRAM = """
#include <array>
#include <cstdio>
#include <modular_framework_core/message_utils.h>
#include <ros/serialization.h>

using namespace modular_framework_core;

int main()
{
  ros::Time::init();
  ros::Time::setNow(ros::Time(12, 34));
  const std::array<double, 3> position = {0.1, -0.2, 0.3}, rpy = {0.4, -0.5, 0.6};
  const std::vector<float> quaternion = {0.0f, 0.0f, 1.0f, 0.0f};
  const auto turned = generate_pose_stamped_message("world", position, rpy);
  const auto flipped = generate_pose_stamped_message("base", position, quaternion);
  try { generate_pose_stamped_message("base", quaternion, rpy); return 1; }
  catch (const std::invalid_argument&) {}
  const auto grasp = get_standardised_grasp({"a", "b"}, {0.1, 0.2}, {0.3, 0.4}, {0.5, 0.6}, {1.0, -1.0}, turned,
                                            flipped, turned, 0.7, "g", "h", "o");
  std::vector<uint8_t> bytes(ros::serialization::serializationLength(grasp));
  ros::serialization::OStream stream(bytes.data(), bytes.size());
  ros::serialization::serialize(stream, grasp);
  return fwrite(bytes.data(), 1, bytes.size(), stdout) == bytes.size() ? 0 : 1;
}
"""


def test_a_grasp_made_in_c_plus_plus_is_the_grasp_made_in_python(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "p.cpp").write_text(PROGRAM)
    space = next(folder for folder in (ROOT / "devel", ROOT / "install") if (folder / "include").is_dir())
    subprocess.run(
        [
            "g++",
            "-std=c++14",
            "-Wall",
            "-Werror",
            f"-I{ROOT}/src/modular_framework_core/include",
            f"-I{space}/include",
            "p.cpp",
            "-o",
            "p",
            "-lrostime",
            "-lroscpp_serialization",
            "-lcpp_common",
        ],
        cwd=tmp_path,
        check=True,
        timeout=300,
    )
    made = subprocess.run(["./p"], cwd=tmp_path, check=True, capture_output=True, timeout=60).stdout
    monkeypatch.setattr(rospy.Time, "now", lambda: genpy.Time(12, 34))
    turned = generate_pose_stamped_message("world", (0.1, -0.2, 0.3), (0.4, -0.5, 0.6))
    flipped = generate_pose_stamped_message("base", (0.1, -0.2, 0.3), (0.0, 0.0, 1.0, 0.0))
    expected = get_standardised_grasp(
        ["a", "b"], [0.1, 0.2], [0.3, 0.4], [0.5, 0.6], [1.0, -1.0], turned, flipped, turned, 0.7, "g", "h", "o"
    )
    buffer = io.BytesIO()
    expected.serialize(buffer)
    assert StandardisedGrasp().deserialize(made) == StandardisedGrasp().deserialize(buffer.getvalue())


NODE_OF_THE_ORIGINAL = """
#include <ros/ros.h>
#include <modular_framework_core/message_utils.hpp>

int main(int argc, char** argv)
{
  ros::Time::init();
  Eigen::Vector3f position(0.1, -0.2, 0.3);
  Eigen::Vector3f rpy(0.0, 0.0, 3.14159265);
  Eigen::Vector4f quaternion(0.0, 0.0, 1.0, 0.0);
  geometry_msgs::PoseStamped turned = generate_pose_stamped_message("world", position, rpy);
  geometry_msgs::PoseStamped given = generate_pose_stamped_message("base", position, quaternion);
  sensor_msgs::JointState state = generate_joint_state_message({"a"}, {0.5}, {}, {});
  modular_framework_core::StandardisedGrasp grasp =
      get_standardised_grasp({"a"}, {0.1}, {0.2}, {0.3}, {1.0}, turned, given, turned);
  tf2::Transform transform;
  tf2::fromMsg(grasp.grasp.pose.pose, transform);
  printf("%s %s %.3f %s %.1f %.1f %.3f\\n", turned.header.frame_id.c_str(), state.header.frame_id.c_str(),
         turned.pose.orientation.z, grasp.grasp.pose.header.frame_id.c_str(), grasp.grasp.posture.position[0],
         grasp.torque_intensity.torque_intensity[0], transform.getOrigin().y());
  return 0;
}
"""
CMAKE_OF_THE_ORIGINAL = """
cmake_minimum_required(VERSION 2.8.3)
project(grasping_method)
find_package(catkin REQUIRED COMPONENTS roscpp modular_framework_core)
catkin_package()
include_directories(${catkin_INCLUDE_DIRS})
add_executable(grasping_node node.cpp)
target_link_libraries(grasping_node ${catkin_LIBRARIES})
add_dependencies(grasping_node ${catkin_EXPORTED_TARGETS})
"""
PACKAGE_OF_THE_ORIGINAL = """<package format="2"><name>grasping_method</name><version>0.0.1</version>
<description>A method</description><maintainer email="a@example.org">A</maintainer><license>BSD</license>
<buildtool_depend>catkin</buildtool_depend><depend>roscpp</depend><depend>modular_framework_core</depend></package>"""


def test_a_node_in_c_plus_plus_for_the_original_builds_as_its_package_says(tmp_path: Path) -> None:
    for name, text in (
        ("node.cpp", NODE_OF_THE_ORIGINAL),
        ("CMakeLists.txt", CMAKE_OF_THE_ORIGINAL),
        ("package.xml", PACKAGE_OF_THE_ORIGINAL),
    ):
        (tmp_path / name).write_text(text)
    build = tmp_path / "build"
    for command in (["cmake", "-S", str(tmp_path), "-B", str(build)], ["cmake", "--build", str(build)]):
        answer = subprocess.run(command, capture_output=True, text=True, timeout=600, check=False)
        assert answer.returncode == 0, answer.stdout + answer.stderr
    node = build / "devel" / "lib" / "grasping_method" / "grasping_node"
    made = subprocess.run([str(node)], capture_output=True, text=True, timeout=60, check=True).stdout
    assert made == "world world 1.000 base 0.2 1.0 -0.200\n"
