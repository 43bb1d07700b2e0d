// SPDX-License-Identifier: BSD-3-Clause
// Builds the messages a grasp is made of, for nodes in C++; the same functions as grasp_messages.py. ros::Time must be
// initialised (a ros::NodeHandle does that): the messages are stamped now.
#ifndef MODULAR_FRAMEWORK_CORE_MESSAGE_UTILS_H
#define MODULAR_FRAMEWORK_CORE_MESSAGE_UTILS_H

#include <cmath>
#include <stdexcept>
#include <string>
#include <vector>

#include <geometry_msgs/PoseStamped.h>
#include <modular_framework_core/StandardisedGrasp.h>
#include <ros/time.h>
#include <sensor_msgs/JointState.h>

namespace modular_framework_core
{

// A joint state stamped now: positions [rad or m], velocities and efforts (either may be empty).
inline sensor_msgs::JointState generate_joint_state_message(const std::vector<std::string>& joint_names,
                                                            const std::vector<double>& position,
                                                            const std::vector<double>& velocity = {},
                                                            const std::vector<double>& effort = {},
                                                            const std::string& reference_frame_name = "world")
{
  sensor_msgs::JointState message;
  message.header.stamp = ros::Time::now();
  message.header.frame_id = reference_frame_name;
  message.name = joint_names;
  message.position = position;
  message.velocity = velocity;
  message.effort = effort;
  return message;
}

// A pose stamped now. Position x, y, z [m]; orientation roll, pitch, yaw about fixed axes [rad], or a quaternion
// x, y, z, w. Both may be anything with size() and []: std::array, std::vector, Eigen::Vector3f, Eigen::Vector4f.
// Throws std::invalid_argument when they have other numbers of values.
template <typename Position, typename Orientation>
geometry_msgs::PoseStamped generate_pose_stamped_message(const std::string& reference_frame_name,
                                                         const Position& position, const Orientation& orientation)
{
  if (position.size() != 3 || (orientation.size() != 3 && orientation.size() != 4))
    throw std::invalid_argument("a pose needs 3 values of position and 3 (roll, pitch, yaw) or 4 (x, y, z, w) of "
                                "orientation, got " + std::to_string(position.size()) + " and " +
                                std::to_string(orientation.size()));
  geometry_msgs::PoseStamped message;
  message.header.stamp = ros::Time::now();
  message.header.frame_id = reference_frame_name;
  message.pose.position.x = position[0];
  message.pose.position.y = position[1];
  message.pose.position.z = position[2];
  geometry_msgs::Quaternion& rotation = message.pose.orientation;
  if (orientation.size() == 4)
  {
    rotation.x = orientation[0];
    rotation.y = orientation[1];
    rotation.z = orientation[2];
    rotation.w = orientation[3];
    return message;
  }
  const double cr = std::cos(orientation[0] / 2.0), sr = std::sin(orientation[0] / 2.0);
  const double cp = std::cos(orientation[1] / 2.0), sp = std::sin(orientation[1] / 2.0);
  const double cy = std::cos(orientation[2] / 2.0), sy = std::sin(orientation[2] / 2.0);
  rotation.x = sr * cp * cy - cr * sp * sy;
  rotation.y = cr * sp * cy + sr * cp * sy;
  rotation.z = cr * cp * sy - sr * sp * cy;
  rotation.w = cr * cp * cy + sr * sp * sy;
  return message;
}

// A grasp message; the three postures are stamped now. Torque intensities are shares of the greatest torque, in [-1, 1].
inline StandardisedGrasp get_standardised_grasp(
    const std::vector<std::string>& manipulator_joint_names, const std::vector<double>& pregrasp_joint_values,
    const std::vector<double>& grasp_joint_values, const std::vector<double>& postgrasp_joint_values,
    const std::vector<double>& torque_intensity, const geometry_msgs::PoseStamped& pregrasp_pose,
    const geometry_msgs::PoseStamped& grasp_pose, const geometry_msgs::PoseStamped& postgrasp_pose,
    double grasp_quality = 0.0, const std::string& grasp_id = "", const std::string& hand_id = "",
    const std::string& object_id = "")
{
  StandardisedGrasp grasp;
  grasp.grasp_id = grasp_id;
  grasp.hand_id = hand_id;
  grasp.object_id = object_id;
  grasp.pregrasp.posture = generate_joint_state_message(manipulator_joint_names, pregrasp_joint_values, {}, {}, "");
  grasp.pregrasp.pose = pregrasp_pose;
  grasp.grasp.posture = generate_joint_state_message(manipulator_joint_names, grasp_joint_values, {}, {}, "");
  grasp.grasp.pose = grasp_pose;
  grasp.postgrasp.posture = generate_joint_state_message(manipulator_joint_names, postgrasp_joint_values, {}, {}, "");
  grasp.postgrasp.pose = postgrasp_pose;
  grasp.torque_intensity.joint_names = manipulator_joint_names;
  grasp.torque_intensity.torque_intensity = torque_intensity;
  grasp.grasp_quality = grasp_quality;
  return grasp;
}

}  // namespace modular_framework_core

#endif  // MODULAR_FRAMEWORK_CORE_MESSAGE_UTILS_H
