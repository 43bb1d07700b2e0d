# SPDX-License-Identifier: BSD-3-Clause
"""The C++ functions make the same messages as the Python ones."""
from __future__ import annotations

import io
import subprocess
from pathlib import Path

import genpy
import pytest
import rospy

from modular_framework_core.grasp_messages import generate_pose_stamped_message, get_standardised_grasp
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
    subprocess.run(["g++", "-std=c++14", "-Wall", "-Werror", f"-I{ROOT}/src/modular_framework_core/include",
                    f"-I{space}/include", "p.cpp", "-o", "p", "-lrostime", "-lroscpp_serialization", "-lcpp_common"],
                   cwd=tmp_path, check=True, timeout=300)
    made = subprocess.run(["./p"], cwd=tmp_path, check=True, capture_output=True, timeout=60).stdout
    monkeypatch.setattr(rospy.Time, "now", lambda: genpy.Time(12, 34))
    turned = generate_pose_stamped_message("world", (0.1, -0.2, 0.3), (0.4, -0.5, 0.6))
    flipped = generate_pose_stamped_message("base", (0.1, -0.2, 0.3), (0.0, 0.0, 1.0, 0.0))
    expected = get_standardised_grasp(["a", "b"], [0.1, 0.2], [0.3, 0.4], [0.5, 0.6], [1.0, -1.0], turned, flipped,
                                      turned, 0.7, "g", "h", "o")
    buffer = io.BytesIO()
    expected.serialize(buffer)
    assert StandardisedGrasp().deserialize(made) == StandardisedGrasp().deserialize(buffer.getvalue())
