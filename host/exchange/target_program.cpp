// SPDX-License-Identifier: Apache-2.0
#include "exchange/target_program.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <filesystem>
#include <iterator>
#include <string_view>
#include <utility>

#include "exchange/arm_sides.hpp"
#include "exchange/program_text.hpp"
#include "exchange/rotation_angles.hpp"
#include "exchange/text_edits.hpp"
#include "files/read_file.hpp"
#include "files/text.hpp"
#include "flexcomp/forward.hpp"
#include "flexcomp/model.hpp"
#include "input_error.hpp"
#include "kinematics/nominal_inverse.hpp"
#include "quaternion.hpp"
#include "units.hpp"

namespace flexcomp::host {

namespace {

std::string six_decimals(double value) {
  std::string text = fmt::format("{:.6f}", value);
  while (text.ends_with('0')) text.pop_back();
  if (text.ends_with('.')) text += '0';
  return text == "-0.0" ? "0.0" : text;
}

/// In the notation and with the digits of the word that it replaces.
std::string turn_word(unsigned turn, std::string_view old) {
  if (!old.starts_with('\'')) return fmt::format("{}", turn);
  const std::size_t digits = old.size() - 3;
  return old[1] == 'B' || old[1] == 'b' ? fmt::format("'{}{:0{}b}'", old[1], turn, digits)
                                        : fmt::format("'{}{:0{}X}'", old[1], turn, digits);
}

}  // namespace

std::optional<ProgramLanguage> program_language(const std::string& path) {
  const std::string ending = lower(std::filesystem::path(path).extension().string());
  if (ending == ".src") return ProgramLanguage::kuka;
  // Tables are called .dat as well; they have no braces.
  if (ending == ".dat" && read_file(path).find('{') != std::string::npos) return ProgramLanguage::kuka;
  if (ending == ".mod" || ending == ".modx" || ending == ".prg" || ending == ".sys")
    return ProgramLanguage::rapid;
  if (ending == ".dtx") return ProgramLanguage::val3;
  return {};
}

TargetProgram read_program(const std::string& path, ProgramLanguage language) {
  TargetProgram program;
  program.path = path;
  program.language = language;
  program.text = read_file(path);
  switch (language) {
    case ProgramLanguage::kuka:
      read_krl(program);
      break;
    case ProgramLanguage::rapid:
      read_rapid(program);
      break;
    case ProgramLanguage::val3:
      read_val3(program);
  }
  if (program.targets.empty()) {
    const char* const expected = language == ProgramLanguage::kuka
                                     ? "targets: {A1 …, A6 …} or {X …, Y …, Z …, A …, B …, C …, S …, T …}"
                                 : language == ProgramLanguage::rapid
                                     ? "targets: [[six angles],[…]] or [[x,y,z],[quaternion],[robconf],[…]]"
                                     : "targets: <Value j1=… j6=…/>";
    throw InputError(path, 0, "", expected, "none");
  }
  return program;
}

std::string program_text(const TargetProgram& program, const std::vector<ProgramTarget>& corrected) {
  TextEdits edits;
  // Where a number follows its name without a blank (C.5, X-3), the new one must not become a part of the name.
  const auto put = [&](const TextSpan& span, std::string number) {
    const char before = span.begin == 0 ? ' ' : program.text[span.begin - 1];
    const bool is_name = before == '_' || std::isalnum(static_cast<unsigned char>(before)) != 0;
    edits.replace(span, is_name && number.front() != '-' ? " " + number : std::move(number));
  };
  for (std::size_t n = 0; n < corrected.size(); ++n) {
    const ProgramTarget& t = corrected[n];
    const ProgramTarget& old = program.targets[n];
    if (!t.pose) {
      for (std::size_t j = 0; j < joint_count; ++j) put(t.numbers[j], six_decimals(degrees(t.q_rad[j])));
      continue;
    }
    for (std::size_t k = 0; k < 3; ++k)
      put(t.numbers[k], six_decimals(t.position_m[static_cast<Eigen::Index>(k)] * 1e3));
    if (program.language == ProgramLanguage::kuka) {
      const Eigen::Vector3d abc = roll_pitch_yaw(t.orientation.toRotationMatrix()).reverse();
      for (std::size_t k = 0; k < 3; ++k)
        put(t.numbers[3 + k], six_decimals(degrees(abc[static_cast<Eigen::Index>(k)])));
    } else {
      const Eigen::Quaterniond& q = t.orientation;
      const std::array<double, 4> wxyz{q.w(), q.x(), q.y(), q.z()};
      // 1e-9 of a quaternion is what 1e-6 deg is of an angle.
      for (std::size_t k = 0; k < 4; ++k) put(t.numbers[3 + k], fmt::format("{:.9f}", wxyz[k]));
    }
    // A word that is right stays as it is written.
    if (t.turn && t.turn_number && t.turn != old.turn) {
      const std::string_view word =
          std::string_view(program.text)
              .substr(t.turn_number->begin, t.turn_number->end - t.turn_number->begin);
      put(*t.turn_number, turn_word(*t.turn, word));
    }
    for (std::size_t k = 0; k < t.quadrant_numbers.size(); ++k) {
      if ((*t.quadrant)[k] != (*old.quadrant)[k])
        put(t.quadrant_numbers[k], fmt::format("{}", (*t.quadrant)[k]));
    }
  }
  return edits.applied_to(program.text);
}

unsigned turn_of(const std::array<double, joint_count>& q_rad, unsigned before) {
  for (std::size_t j = 0; j < joint_count; ++j) {
    const unsigned bit = 1U << j;
    if (std::abs(q_rad[j]) > word_edge_rad) before = q_rad[j] < 0 ? before | bit : before & ~bit;
  }
  return before;
}

std::array<int, 3> quadrants_of(const std::array<double, joint_count>& q_rad, std::array<int, 3> before) {
  constexpr std::array<std::size_t, 3> joints{0, 3, 5};
  for (std::size_t k = 0; k < 3; ++k) {
    const double quarters = q_rad[joints[k]] / (pi / 2);
    const double edge = word_edge_rad / (pi / 2);
    if (quarters < before[k] - edge || quarters > before[k] + 1 + edge)
      before[k] = static_cast<int>(std::floor(quarters));
  }
  return before;
}

bool words_fit(const ProgramTarget& target, const std::array<double, joint_count>& q_rad) {
  return (!target.turn || turn_of(q_rad, *target.turn) == *target.turn) &&
         (!target.quadrant || quadrants_of(q_rad, *target.quadrant) == *target.quadrant);
}

namespace {

using Joints = std::array<double, joint_count>;

/// All joint commands that reach the pose of a target as its words say.
/// \throws InputError  there are none
std::vector<Joints> solutions(const TargetProgram& program, const ProgramTarget& t, const Robot& robot,
                              const Pose<double>& pose, std::vector<std::string>& warnings) {
  std::vector<Joints> all = nominal_inverses(robot.nominal, pose);
  const std::size_t reaching = all.size();
  std::erase_if(all, [&t](const Joints& q) { return !words_fit(t, q); });
  if (all.empty()) {
    throw InputError(program.path, t.line, t.name, "a pose that the nominal arm reaches with its tool, in F0",
                     reaching == 0
                         ? std::string("one that it does not reach")
                         : fmt::format("{} ways to reach it, none with the turns that it asks for", reaching),
                     ErrorCode::unreachable_pose);
  }
  // Only where several remain: there are programs whose cfx was never looked at.
  if (all.size() == 1 || !t.cfx) return all;
  std::vector<Joints> with_cfx;
  std::copy_if(all.begin(), all.end(), std::back_inserter(with_cfx), [&](const Joints& q) {
    const auto sides = arm_sides(robot.nominal, q);
    return sides && fits_cfx(*sides, *t.cfx);
  });
  if (!with_cfx.empty()) return with_cfx;
  warnings.push_back(
      fmt::format("{}:{}: {}{}cfx {} fits none of {} ways to reach the pose: the nearest is taken.",
                  program.path, t.line, t.name, t.name.empty() ? "" : ": ", *t.cfx, all.size()));
  return all;
}

double largest_difference(const Joints& a, const Joints& b) {
  double most = 0;
  for (std::size_t j = 0; j < joint_count; ++j) most = std::max(most, std::abs(a[j] - b[j]));
  return most;
}

}  // namespace

TargetsFile program_commands(const TargetProgram& program, const Robot& robot, const Pose<double>& frame,
                             const std::optional<Joints>& start,
                             const std::function<void(std::size_t, std::size_t)>& progress) {
  TargetsFile list;
  list.path = program.path;
  list.warnings = program.warnings;
  std::optional<Joints> before = start;
  const Eigen::Matrix3d to_f0 = frame.rotation.transpose();
  for (const ProgramTarget& t : program.targets) {
    Target target;
    target.line = t.line;
    target.context = default_context<double>(robot.nominal);
    target.q_rad = t.q_rad;
    if (t.pose) {
      const Pose<double> pose{to_f0 * t.orientation.toRotationMatrix(),
                              to_f0 * (t.position_m - frame.position)};
      const std::vector<Joints> all = solutions(program, t, robot, pose, list.warnings);
      if (all.size() > 1 && !before) {
        throw InputError(program.path, t.line, t.name,
                         "the joints at the beginning, of which the nearest way is taken",
                         fmt::format("{} ways to reach the pose", all.size()), ErrorCode::several_branches);
      }
      const Joints from = before.value_or(all.front());
      target.q_rad = *std::min_element(all.begin(), all.end(), [&from](const Joints& a, const Joints& b) {
        return largest_difference(a, from) < largest_difference(b, from);
      });
    }
    before = target.q_rad;
    list.rows.push_back(std::move(target));
    progress(list.rows.size(), program.targets.size());
  }
  return list;
}

std::string with_commands(const TargetProgram& program, const Robot& robot, const Pose<double>& frame,
                          const std::vector<Joints>& q_rad) {
  Model<double, joint_count, Capacity<1, 1, 6>> nominal;
  nominal.begin(robot.nominal);
  nominal.finish();
  std::vector<ProgramTarget> corrected = program.targets;
  for (std::size_t k = 0; k < corrected.size(); ++k) {
    ProgramTarget& t = corrected[k];
    t.q_rad = q_rad[k];
    if (!t.pose) continue;
    const Pose<double> pose = frame * nominal_forward(nominal, t.q_rad);
    t.position_m = pose.position;
    t.orientation = unit_quaternion(pose.rotation);
    if (t.turn) t.turn = turn_of(t.q_rad, *t.turn);
    if (t.quadrant) t.quadrant = quadrants_of(t.q_rad, *t.quadrant);
  }
  return program_text(program, corrected);
}

}  // namespace flexcomp::host
