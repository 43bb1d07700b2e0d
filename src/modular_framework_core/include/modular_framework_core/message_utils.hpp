// SPDX-License-Identifier: BSD-3-Clause
// The functions of message_utils.h outside a namespace and with Eigen vectors, as nodes in C++ written for the original
// framework call them. They are in the library modular_framework_core, which ${catkin_LIBRARIES} holds.
#ifndef MODULAR_FRAMEWORK_CORE_MESSAGE_UTILS_HPP
#define MODULAR_FRAMEWORK_CORE_MESSAGE_UTILS_HPP

#include <string>
#include <vector>

#include <Eigen/Dense>
#include <geometry_msgs/PoseStamped.h>
#include <modular_framework_core/StandardisedGrasp.h>
#include <sensor_msgs/JointState.h>
#include <tf2_geometry_msgs/tf2_geometry_msgs.h>

// A pose stamped now: position x, y, z [m], orientation roll, pitch, yaw about fixed axes [rad].
geometry_msgs::PoseStamped generate_pose_stamped_message(std::string reference_frame_name, Eigen::Vector3f position,
                                                         Eigen::Vector3f orientation);

// A pose stamped now: position x, y, z [m], orientation as a quaternion x, y, z, w.
geometry_msgs::PoseStamped generate_pose_stamped_message(std::string reference_frame_name, Eigen::Vector3f position,
                                                         Eigen::Vector4f orientation);

// A joint state stamped now: positions [rad or m], velocities and efforts (either may be empty).
sensor_msgs::JointState generate_joint_state_message(std::vector<std::string> joint_names, std::vector<double> position,
                                                     std::vector<double> velocity, std::vector<double> effort,
                                                     std::string reference_frame_name = "world");

// A grasp message; the three postures are stamped now. Torque intensities are shares of the greatest torque, in [-1, 1].
modular_framework_core::StandardisedGrasp get_standardised_grasp(
    std::vector<std::string> manipulator_joint_names, std::vector<double> pregrasp_joint_values,
    std::vector<double> grasp_joint_values, std::vector<double> postgrasp_joint_values,
    std::vector<double> torque_intensity, geometry_msgs::PoseStamped pregrasp_pose,
    geometry_msgs::PoseStamped grasp_pose, geometry_msgs::PoseStamped postgrasp_pose, double grasp_quality = 0.0,
    std::string grasp_id = "", std::string hand_id = "", std::string object_id = "");

#endif  // MODULAR_FRAMEWORK_CORE_MESSAGE_UTILS_HPP
