// SPDX-License-Identifier: Apache-2.0
#include "exchange/robot_header.hpp"

#include <fmt/format.h>

#include <array>
#include <cctype>
#include <filesystem>
#include <string>
#include <string_view>

#include "model/calibration.hpp"

namespace flexcomp::host {

namespace {

/// Keywords and alternative tokens of C17 and C++20 that the name of a robot could become.
constexpr std::string_view keywords =
    " alignas alignof and and_eq asm auto bitand bitor bool break case catch char char8_t char16_t"
    " char32_t class co_await co_return co_yield compl concept const const_cast consteval constexpr"
    " constinit continue decltype default delete do double dynamic_cast else enum explicit export extern"
    " false float for friend goto if inline int long mutable namespace new noexcept not not_eq nullptr"
    " operator or or_eq private protected public register reinterpret_cast requires restrict return short"
    " signed sizeof static static_assert static_cast struct switch template this thread_local throw true"
    " try typedef typeid typename union unsigned using virtual void volatile wchar_t while xor xor_eq main"
    " ";

bool letter_or_digit(char c) {
  return (c >= '0' && c <= '9') || (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z');
}

/// What a string literal of C90 may hold: anything else as three octal digits, and no trigraph.
std::string c_string(std::string_view text) {
  std::string out = "\"";
  for (const char c : text) {
    const auto byte = static_cast<unsigned char>(c);
    if (c == '"' || c == '\\' || c == '?') {
      out += '\\';
      out += c;
    } else if (byte < 0x20 || byte > 0x7E) {
      out += fmt::format("\\{:03o}", byte);
    } else {
      out += c;
    }
  }
  return out + "\"";
}

/// Shortest decimal that reads back to the same double, and a double it stays: 20 is written 20.0.
std::string number(double v) {
  std::string text = fmt::format("{}", v);
  if (text.find_first_of(".e") == std::string::npos) text += ".0";
  return text;
}

template <class List>
std::string numbers(const List& list) {
  std::string text;
  for (const double v : list) text += (text.empty() ? "{" : ", ") + number(v);
  return text + "}";
}

}  // namespace

std::string c_identifier(std::string_view name) {
  std::string out;
  for (const char c : name) out += letter_or_digit(c) ? c : '_';
  // An identifier that begins with a digit or an underscore is not ours to use.
  const bool free = letter_or_digit(out[0]) && !(out[0] >= '0' && out[0] <= '9') &&
                    keywords.find(" " + out + " ") == std::string_view::npos;
  return free ? out : "robot_" + out;
}

std::string robot_header(const Robot& robot, const std::string& made_by) {
  const NominalRobot<joint_count>& r = robot.nominal;
  const std::string name = c_identifier(robot.name);
  std::string guard = "FLEXCOMP_ROBOT_";
  for (const char c : name) guard += static_cast<char>(std::toupper(static_cast<unsigned char>(c)));
  guard += "_H";

  std::string links;
  for (const NominalLink& link : r.links) {
    const double values[] = {link.theta_rad, link.d_m, link.a_m, link.alpha_rad, link.beta_rad};
    links += (links.empty() ? "    {" : ",\n     ") + numbers(values);
  }
  std::array<double, joint_count> low{};
  std::array<double, joint_count> high{};
  for (std::size_t j = 0; j < joint_count; ++j) {
    low[j] = r.limits[j].min_rad;
    high[j] = r.limits[j].max_rad;
  }
  std::string text;
  text += fmt::format("/* The nominal robot of {} for a C or C++ controller, written by {}.\n",
                      std::filesystem::path(robot.path).filename().string(), made_by);
  text += fmt::format(" * nominal hash {} */\n", hex(nominal_hash(r)));
  text += fmt::format("/* clang-format off */\n#ifndef {0}\n#define {0}\n\n#include <flexcomp.h>\n\n", guard);
  text += fmt::format("static const flexcomp_robot {} = {{\n    {},\n", name, c_string(robot.name));
  text += links + "},\n";
  text +=
      fmt::format("    {},\n    {},\n    {},\n    {},\n    {},\n    {},\n    {},\n    {},\n", numbers(low),
                  numbers(high), numbers(r.gravity_m_s2), numbers(r.tool_xyz_m), numbers(r.tool_wxyz),
                  number(r.payload_kg), numbers(r.payload_com_m), number(r.reference_temperature_c));
  // Also where there is none: compilers warn of a member that is left out.
  text += fmt::format("    {},\n", robot.serial.empty() ? "NULL" : c_string(robot.serial));
  text += "};\n\n#endif\n";
  return text;
}

}  // namespace flexcomp::host
