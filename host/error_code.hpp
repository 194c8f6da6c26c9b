// SPDX-License-Identifier: Apache-2.0
/// \file
/// What an error is about. Library code names no options: commands/hints.cpp adds them by these codes.
#pragma once

namespace flexcomp::host {

enum class ErrorCode {
  none,      ///< the message says all
  argument,  ///< InputError::field() names the argument of the call that is wrong
  // files/
  no_such_file,
  missing_column,
  looks_like_radians,
  long_links,
  // model/, kinematics/, measurement/
  unnamed_effect,
  unreachable_pose,
  several_branches,  ///< of the inverse kinematics, and no joints that say which
  no_reflectors,
  // planning/
  search_state,
  too_few_poses,
  // identification/, diagnosis/
  fixed_parameter,  ///< one that the model does not have
  implausible_data,
  distant_base,
  held_out_was_fitted,
  poor_fit,  ///< chi-square outside its interval, or a fit that did not converge
  // report/
  no_result_file,
  // bus/
  no_can_sockets,
  bus_not_opened,
  unknown_robot,  ///< the controller does not tell which
  outcome_open,   ///< of a command that may have been executed
  // exchange/
  not_xml,
  another_arm,
  ambiguous_dialect,
  ambiguous_decimal_mark,
  several_orientations,
  ambiguous_column,
  unknown_layout,
  no_length_unit,
  no_angle_unit,
  no_angle_convention,
  log_without_joints,
  ambiguous_joint_column,
  ambiguous_time_column,
  ambiguous_log_decimal_mark,
  ambiguous_name_column,
  no_joint_unit,
  no_names,
  repeated_point,
  no_common_points,
  moving_arm,
};

}  // namespace flexcomp::host
