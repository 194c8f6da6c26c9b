// SPDX-License-Identifier: Apache-2.0
#pragma once
// One calculation that host and targets both make: the paper's TX60L with the errors of its Table 1, as an image,
// through the model to poses and corrected commands. The host prints the bits (golden.hpp), the targets compare.
#include <array>
#include <cstddef>
#include <cstdint>

#include "flexcomp/compensate.hpp"
#include "flexcomp/identification.hpp"
#include "flexcomp/image.hpp"

namespace selftest {

using flexcomp::Basis;
using flexcomp::Effect;

constexpr double degree = flexcomp::pi / 180;
constexpr double mm = 1e-3;

constexpr char robot_name[] = "staubli-tx60l";

/// Chen et al. 2019: nominal TX60L, joint limits of Table 2, tool and payload of the experiments. Assigned, not
/// computed: a target without a double unit may copy doubles, but not add them.
inline flexcomp::NominalRobot<6> tx60l() {
  flexcomp::NominalRobot<6> r;
  r.links = {{{0, 0, 0, -90 * degree, 0},
              {-90 * degree, 0, 400 * mm, 0, 0},
              {90 * degree, 20 * mm, 0, 90 * degree, 0},
              {0, 450 * mm, 0, -90 * degree, 0},
              {0, 0, 0, 90 * degree, 0},
              {0, 70 * mm, 0, 0, 0}}};
  r.limits = {{{-180 * degree, 180 * degree},
               {-127.5 * degree, 127.5 * degree},
               {-142.5 * degree, 142.5 * degree},
               {-270 * degree, 270 * degree},
               {-122.5 * degree, 133.5 * degree},
               {-270 * degree, 270 * degree}}};
  r.tool_xyz_m = {10 * mm, 30 * mm, 60 * mm};
  r.payload_kg = 1.108;
  r.payload_com_m = {5 * mm, 8 * mm, 60 * mm};
  r.name_hash = flexcomp::name_hash(robot_name, sizeof robot_name - 1);
  return r;
}

struct Entry {
  std::uint8_t body, slot;
  Basis basis;
  std::uint8_t joint;
  double argument, coefficient;
};

/// Table 1, with a compliance of 1 / K (K in N·mm/rad there), the lever's far joints of the link weight, and one
/// curve on joint 1, so that a table is in the image as well.
constexpr Entry entries[] = {
    {1, 0, Basis::one, 0, 0, -0.08 * degree},
    {1, 1, Basis::one, 0, 0, -0.4 * mm},
    {1, 2, Basis::one, 0, 0, 0.09 * mm},
    {1, 3, Basis::one, 0, 0, 0.03 * degree},
    {2, 0, Basis::one, 0, 0, -0.04 * degree},
    {2, 2, Basis::one, 0, 0, -0.05 * mm},
    {2, 3, Basis::one, 0, 0, 0.02 * degree},
    {2, 4, Basis::one, 0, 0, 0.03 * degree},
    {3, 0, Basis::one, 0, 0, 0.05 * degree},
    {3, 1, Basis::one, 0, 0, 0.2 * mm},
    {3, 2, Basis::one, 0, 0, -0.1 * mm},
    {3, 3, Basis::one, 0, 0, -0.05 * degree},
    {4, 0, Basis::one, 0, 0, 0.03 * degree},
    {4, 1, Basis::one, 0, 0, -0.1 * mm},
    {4, 2, Basis::one, 0, 0, 0.06 * mm},
    {4, 3, Basis::one, 0, 0, -0.008 * degree},
    {5, 0, Basis::one, 0, 0, 0.06 * degree},
    {5, 1, Basis::one, 0, 0, 0.1 * mm},
    {5, 2, Basis::one, 0, 0, -0.08 * mm},
    {5, 3, Basis::one, 0, 0, 0.01 * degree},
    {6, 0, Basis::one, 0, 0, -0.1 * degree},
    {6, 1, Basis::one, 0, 0, -0.3 * mm},
    {6, 2, Basis::one, 0, 0, 0.03 * mm},
    {6, 3, Basis::one, 0, 0, 0.07 * degree},
    {0, 0, Basis::one, 0, 0, 0.3 * mm},
    {0, 1, Basis::one, 0, 0, -0.2 * mm},
    {0, 2, Basis::one, 0, 0, 0.1 * mm},
    {0, 3, Basis::one, 0, 0, 0.02 * degree},
    {0, 4, Basis::one, 0, 0, 0.01 * degree},
    {0, 5, Basis::one, 0, 0, 0.01 * degree},
    {1, 0, Basis::load_torque, 0, 0, 1e3 / 1.47e10},
    {2, 0, Basis::load_torque, 1, 0, 1e3 / 6.67e7},
    {3, 0, Basis::load_torque, 2, 0, 1e3 / 3.13e7},
    {4, 0, Basis::load_torque, 3, 0, 1e3 / 2.22e7},
    {5, 0, Basis::load_torque, 4, 0, 1e3 / 1.18e6},
    {6, 0, Basis::load_torque, 5, 0, 1e3 / 7.69e5},
    {2, 0, Basis::link_weight, 1, 2, 0.0015},
    {2, 0, Basis::link_weight, 2, 4, 0.00123},
    {3, 0, Basis::link_weight, 2, 4, 0.00054},
    {1, 0, Basis::curve, 0, 0, 1},
};
constexpr std::size_t entry_count = sizeof entries / sizeof entries[0];
constexpr double curve[] = {0, 1.0e-4, 0, -1.0e-4, 5.0e-5, -5.0e-5};
constexpr std::size_t curve_size = sizeof curve / sizeof curve[0];

constexpr std::size_t image_bytes =
    flexcomp::image::header_bytes + flexcomp::image::crc_bytes + flexcomp::image::record_head_bytes +
    flexcomp::image::table_head_bytes + 8 * curve_size +
    entry_count * (flexcomp::image::record_head_bytes + flexcomp::image::term_bytes);
using Image = std::array<std::uint8_t, image_bytes>;

/// One of the entries as a term.
template <class S>
inline flexcomp::Term<S> make_term(const Entry& e) {
  flexcomp::Term<S> term;
  term.place = {e.body, e.slot};
  term.basis = e.basis;
  term.joint = e.joint;
  if (e.basis == Basis::link_weight) {
    term.distal_joint = static_cast<std::uint8_t>(flexcomp::from_binary64<S>(e.argument));
  } else {
    term.argument = flexcomp::from_binary64<S>(e.argument);
  }
  term.coefficient = flexcomp::from_binary64<S>(e.coefficient);
  term.effect = e.basis == Basis::load_torque   ? Effect::joint_compliance
                : e.basis == Basis::link_weight ? Effect::link_gravity
                : e.basis == Basis::curve       ? Effect::joint_curve
                                                : Effect::geometric;
  if (e.basis == Basis::curve) term.table = 0;
  return term;
}

/// The image of the entries; needs a scalar that holds their values (double). 0 where it does not fit.
template <class S>
inline std::size_t make_image(Image& image) {
  static std::array<flexcomp::Term<S>, entry_count> terms;
  for (std::size_t k = 0; k < entry_count; ++k) terms[k] = make_term<S>(entries[k]);
  static std::array<S, curve_size> values;
  for (std::size_t k = 0; k < curve_size; ++k) values[k] = flexcomp::from_binary64<S>(curve[k]);
  flexcomp::Table table;
  table.size = static_cast<std::uint16_t>(curve_size);
  const flexcomp::TermList<S> list{terms.data(), terms.size(), &table, 1, values.data(), values.size()};
  const flexcomp::NominalRobot<6> robot = tx60l();
  flexcomp::ImageHeader header;
  header.sequence = 7;
  header.nominal_hash = flexcomp::nominal_hash(robot);
  header.name_hash = robot.name_hash;
  return flexcomp::encode_image(list, header, image.data(), image.size());
}

/// Joint commands in 1/64 rad, which float and double hold exactly: ordinary poses, the wrist singularity (joint 5
/// at 0), the stretched arm (joint 3 at 0) and one beyond a limit.
constexpr int commands[][6] = {
    {0, 0, 64, 0, 64, 0},       {32, -40, 70, 50, -60, 10},   {-100, 60, 50, -120, 80, 200},
    {150, 100, -90, 17, 33, 5}, {-180, -120, 140, 90, 45, 7}, {64, 20, 100, 250, 100, -250},
    {10, 30, 60, 20, 0, 10},    {5, 15, 0, 30, 40, 20},       {12, 24, 36, 48, 200, 60}};
constexpr std::size_t command_count = sizeof commands / sizeof commands[0];

/// Per command: 9 of the rotation (row by row), 3 of the position, 6 corrected joints.
constexpr std::size_t numbers_per_command = 18;
/// The columns of H (identification.hpp) of every entry are taken at these commands: an ordinary pose without and
/// one with an external force.
constexpr std::size_t column_commands[] = {1, 2};
constexpr std::size_t column_command_count = sizeof column_commands / sizeof column_commands[0];
template <class S>
struct Results {
  flexcomp::Refusal refusal = flexcomp::Refusal::none;
  std::array<std::array<S, numbers_per_command>, command_count> numbers{};
  std::array<std::uint8_t, command_count> status{};
  std::array<std::array<std::array<S, 6>, entry_count>, column_command_count> columns{};
};

template <class S>
inline void evaluate(const Image& image, Results<S>& results) {
  static flexcomp::Model<S, 6> model;  // too large for a stack
  const flexcomp::NominalRobot<6> robot = tx60l();
  flexcomp::ImageHeader header;
  results.refusal = flexcomp::check_image(image.data(), image.size(), flexcomp::nominal_hash(robot),
                                          robot.name_hash, header);
  if (results.refusal == flexcomp::Refusal::none)
    results.refusal = flexcomp::model_from_image<S>(image.data(), image.size(), robot, model);
  if (results.refusal != flexcomp::Refusal::none) return;
  flexcomp::Context<S, 6> context = flexcomp::default_context<S>(robot);
  for (std::size_t k = 0; k < command_count; ++k) {
    std::array<S, 6> q;
    for (std::size_t i = 0; i < 6; ++i) q[i] = static_cast<S>(commands[k][i]) / S(64);
    context.force_n[0] = k % 2 == 1 ? S(10) : S(0);
    flexcomp::Workspace<S, 6> workspace;
    const flexcomp::Pose<S> pose = flexcomp::forward(model, q, context, workspace);
    std::array<S, numbers_per_command>& out = results.numbers[k];
    for (int r = 0; r < 3; ++r) {
      for (int c = 0; c < 3; ++c)
        out[3 * static_cast<std::size_t>(r) + static_cast<std::size_t>(c)] = pose.rotation(r, c);
      out[9 + static_cast<std::size_t>(r)] = pose.position[r];
    }
    const flexcomp::Compensated<S, 6> corrected = flexcomp::compensate(model, q, context);
    for (std::size_t i = 0; i < 6; ++i) out[12 + i] = corrected.q[i];
    results.status[k] = static_cast<std::uint8_t>(corrected.status);
    for (std::size_t c = 0; c < column_command_count; ++c) {
      if (column_commands[c] != k) continue;
      static flexcomp::Linearisation<S, 6> at;
      flexcomp::linearise(model, q, context, at);
      for (std::size_t e = 0; e < entry_count; ++e) {
        const flexcomp::Vector6<S> column = flexcomp::column(model, at, make_term<S>(entries[e]), context);
        for (int r = 0; r < 6; ++r) results.columns[c][e][static_cast<std::size_t>(r)] = column[r];
      }
    }
  }
}

}  // namespace selftest
