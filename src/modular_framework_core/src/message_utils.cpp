// SPDX-License-Identifier: BSD-3-Clause
// The functions outside a namespace call those of message_utils.h.
#include <modular_framework_core/message_utils.h>
#include <modular_framework_core/message_utils.hpp>

geometry_msgs::PoseStamped generate_pose_stamped_message(std::string reference_frame_name, Eigen::Vector3f position,
                                                         Eigen::Vector3f orientation)
{
  return modular_framework_core::generate_pose_stamped_message(reference_frame_name, position, orientation);
}

geometry_msgs::PoseStamped generate_pose_stamped_message(std::string reference_frame_name, Eigen::Vector3f position,
                                                         Eigen::Vector4f orientation)
{
  return modular_framework_core::generate_pose_stamped_message(reference_frame_name, position, orientation);
}

sensor_msgs::JointState generate_joint_state_message(std::vector<std::string> joint_names, std::vector<double> position,
                                                     std::vector<double> velocity, std::vector<double> effort,
                                                     std::string reference_frame_name)
{
  return modular_framework_core::generate_joint_state_message(joint_names, position, velocity, effort,
                                                              reference_frame_name);
}

modular_framework_core::StandardisedGrasp get_standardised_grasp(
    std::vector<std::string> manipulator_joint_names, std::vector<double> pregrasp_joint_values,
    std::vector<double> grasp_joint_values, std::vector<double> postgrasp_joint_values,
    std::vector<double> torque_intensity, geometry_msgs::PoseStamped pregrasp_pose,
    geometry_msgs::PoseStamped grasp_pose, geometry_msgs::PoseStamped postgrasp_pose, double grasp_quality,
    std::string grasp_id, std::string hand_id, std::string object_id)
{
  return modular_framework_core::get_standardised_grasp(manipulator_joint_names, pregrasp_joint_values,
                                                        grasp_joint_values, postgrasp_joint_values, torque_intensity,
                                                        pregrasp_pose, grasp_pose, postgrasp_pose, grasp_quality,
                                                        grasp_id, hand_id, object_id);
}
