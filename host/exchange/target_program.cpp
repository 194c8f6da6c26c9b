// SPDX-License-Identifier: Apache-2.0
#include "exchange/target_program.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <string_view>

#include "exchange/program_text.hpp"
#include "exchange/rotation_angles.hpp"
#include "exchange/text_edits.hpp"
#include "files/read_file.hpp"
#include "files/text.hpp"
#include "input_error.hpp"
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
  for (std::size_t n = 0; n < corrected.size(); ++n) {
    const ProgramTarget& t = corrected[n];
    const ProgramTarget& old = program.targets[n];
    if (!t.pose) {
      for (std::size_t j = 0; j < joint_count; ++j)
        edits.replace(t.numbers[j], six_decimals(degrees(t.q_rad[j])));
      continue;
    }
    for (std::size_t k = 0; k < 3; ++k)
      edits.replace(t.numbers[k], six_decimals(t.position_m[static_cast<Eigen::Index>(k)] * 1e3));
    if (program.language == ProgramLanguage::kuka) {
      const Eigen::Vector3d abc = roll_pitch_yaw(t.orientation.toRotationMatrix()).reverse();
      for (std::size_t k = 0; k < 3; ++k)
        edits.replace(t.numbers[3 + k], six_decimals(degrees(abc[static_cast<Eigen::Index>(k)])));
    } else {
      const Eigen::Quaterniond& q = t.orientation;
      const std::array<double, 4> wxyz{q.w(), q.x(), q.y(), q.z()};
      // 1e-9 of a quaternion is what 1e-6 deg is of an angle.
      for (std::size_t k = 0; k < 4; ++k) edits.replace(t.numbers[3 + k], fmt::format("{:.9f}", wxyz[k]));
    }
    // A word that is right stays as it is written.
    if (t.turn && t.turn_number && t.turn != old.turn) {
      const std::string_view word =
          std::string_view(program.text)
              .substr(t.turn_number->begin, t.turn_number->end - t.turn_number->begin);
      edits.replace(*t.turn_number, turn_word(*t.turn, word));
    }
    for (std::size_t k = 0; k < t.quadrant_numbers.size(); ++k) {
      if ((*t.quadrant)[k] != (*old.quadrant)[k])
        edits.replace(t.quadrant_numbers[k], fmt::format("{}", (*t.quadrant)[k]));
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

}  // namespace flexcomp::host
