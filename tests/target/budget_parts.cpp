// SPDX-License-Identifier: Apache-2.0
// The parts of the instruction budget, one line each: "name count". tests/target/budget.cpp is the step alone.
#include "budget_arm.hpp"
#include "flexcomp/compensate.hpp"
#include "instructions.hpp"
#include "print.hpp"

namespace {

using budget::Scalar;
using flexcomp::boards::instructions;
using flexcomp::boards::ticks;

alignas(8) flexcomp_memory memory;
alignas(8) flexcomp_can_memory can_memory;
alignas(8) flexcomp_rtu_memory rtu_memory;
budget::Storage storage;
volatile int nothing;
std::uint32_t own;  // ticks of two readings with nothing between

constexpr std::uint32_t calls = 200;

struct Counts {
  std::uint32_t least = ~0U, most = 0, sum = 0;
};

flexcomp::Model<Scalar, 6, flexcomp::Capacity<1, 1, 6>> nominal;

/// Steps at random commands, or at such where the arm is regular, each from a cold start; false where one was not
/// corrected.
bool steps(flexcomp_arm* arm, Counts& counts, bool regular = false) {
  budget::Commands commands(1);
  counts = {};
  for (std::uint32_t k = 0; k < calls; ++k) {
    std::array<Scalar, 6> command;
    do {
      commands.next(command.data());
    } while (regular && !budget::is_regular(nominal, command));
    Scalar* const q = command.data();
    const std::uint32_t from = ticks();
    const flexcomp_status status = flexcomp_step(arm, q, nullptr, q);
    const std::uint32_t count = instructions(from + own, ticks());
    if (status >= FLEXCOMP_NO_SET) return false;
    if (count < counts.least) counts.least = count;
    if (count > counts.most) counts.most = count;
    counts.sum += count;
  }
  return true;
}

/// The same commands with a rate, by flexcomp_step_rate.
bool steps_with_rate(flexcomp_arm* arm, Counts& counts) {
  budget::Commands commands(1);
  counts = {};
  const Scalar rate[6] = {Scalar(1), Scalar(-0.5F), Scalar(0.5F), Scalar(1), Scalar(-1), Scalar(1)};
  for (std::uint32_t k = 0; k < calls; ++k) {
    std::array<Scalar, 6> command;
    do {
      commands.next(command.data());
    } while (!budget::is_regular(nominal, command));
    Scalar* const q = command.data();
    Scalar corrected_rate[6];
    const std::uint32_t from = ticks();
    const flexcomp_status status = flexcomp_step_rate(arm, q, rate, nullptr, q, corrected_rate);
    const std::uint32_t count = instructions(from + own, ticks());
    if (status >= FLEXCOMP_NO_SET) return false;
    if (count < counts.least) counts.least = count;
    if (count > counts.most) counts.most = count;
    counts.sum += count;
  }
  return true;
}

flexcomp_arm* arm_with(budget::Set set, std::uint32_t cycle_us) {
  flexcomp_settings settings;
  flexcomp_settings_default(&settings);
  settings.cycle_us = cycle_us;
  return budget::start(memory, storage, set, &settings);
}

/// What the same run's answers leave at the regular poses, and what a step takes there.
bool regular_poses(flexcomp_arm* arm) {
  static flexcomp::Model<Scalar, 6> model;
  const flexcomp::NominalRobot<6> robot = selftest::tx60l();
  const std::size_t size = flexcomp::load_u32(storage.bytes + FLEXCOMP_SLOT_BYTES - 32 + 4);
  if (flexcomp::model_from_image<Scalar>(storage.bytes, size, robot, model) != flexcomp::Refusal::none)
    return false;
  const flexcomp::Context<Scalar, 6> context = flexcomp::default_context<Scalar>(robot);
  budget::Commands commands(1);
  Scalar left = Scalar(0);
  std::uint32_t regular = 0, sum = 0, most = 0;
  for (std::uint32_t k = 0; k < calls; ++k) {
    std::array<Scalar, 6> q;
    std::array<Scalar, 6> corrected;
    commands.next(q.data());
    const std::uint32_t from = ticks();
    const flexcomp_status status = flexcomp_step(arm, q.data(), nullptr, corrected.data());
    const std::uint32_t count = instructions(from + own, ticks());
    if (status != FLEXCOMP_OK || !budget::is_regular(model, q)) continue;
    ++regular;
    sum += count;
    if (count > most) most = count;
    const Scalar p = flexcomp::target_residual(model, corrected, q, context).position_m;
    if (p > left) left = p;
  }
  print("regular poses of 200: ", regular, "\n");
  print("step, 39 terms, regular poses, mean: ", sum / regular, "\n");
  print("step, 39 terms, regular poses, most: ", most, "\n");
  print("left at regular poses, pm: ", static_cast<std::uint32_t>(left * Scalar(1e12F)), "\n");

  flexcomp::Workspace<Scalar, 6> workspace;
  std::array<Scalar, 6> q;
  commands.next(q.data());
  const std::uint32_t from = ticks();
  const flexcomp::Pose<Scalar> pose = flexcomp::forward(model, q, context, workspace);
  const std::uint32_t to = ticks();
  nothing = pose.position[0] > Scalar(0);
  print("forward model, 39 terms: ", instructions(from + own, to), "\n");
  return true;
}

void image_check() {
  const flexcomp::NominalRobot<6> robot = selftest::tx60l();
  const flexcomp::Sha256Digest hash = flexcomp::nominal_hash(robot);
  const std::size_t size = flexcomp::load_u32(storage.bytes + FLEXCOMP_SLOT_BYTES - 32 + 4);
  flexcomp::ImageHeader header;
  const std::uint32_t from = ticks();
  const flexcomp::Refusal refusal = flexcomp::check_image(storage.bytes, size, hash, robot.name_hash, header);
  const std::uint32_t to = ticks();
  if (refusal != flexcomp::Refusal::none) return;
  print("image check, tenths per byte: ",
        instructions(from + own, to) * 10U / static_cast<std::uint32_t>(size), "\n");
}

int frames_sent;
int send_frame(void*, std::uint16_t, const std::uint8_t*, std::uint8_t) { return ++frames_sent; }
std::size_t bytes_sent;
void send_bytes(void*, const std::uint8_t*, std::size_t size) { bytes_sent = size; }

bool sdo_request(flexcomp_arm* arm) {
  flexcomp_can* can = flexcomp_can_init(&can_memory, sizeof can_memory, arm, 1, 0, send_frame, nullptr);
  flexcomp_can_poll(can, 0);
  const std::uint8_t upload_identity[8] = {0x40, 0x18, 0x10, 0x01, 0, 0, 0, 0};
  const int before = frames_sent;
  const std::uint32_t from = ticks();
  flexcomp_can_receive(can, 0x601, upload_identity, 8);
  const std::uint32_t to = ticks();
  if (frames_sent != before + 1) return false;
  print("SDO request (expedited upload): ", instructions(from + own, to), "\n");
  return true;
}

bool modbus_request(flexcomp_arm* arm) {
  flexcomp_rtu* rtu = flexcomp_rtu_init(&rtu_memory, sizeof rtu_memory, arm, 1, 1750, send_bytes, nullptr);
  const std::uint8_t read_status[8] = {1, 3, 0x00, 0x40, 0, 48, 0x44, 0x0A};
  flexcomp_rtu_poll(rtu, 0);
  flexcomp_rtu_poll(rtu, 10000);
  const std::uint32_t from = ticks();
  flexcomp_rtu_receive(rtu, read_status, 8, 20000);
  flexcomp_rtu_poll(rtu, 30000);
  const std::uint32_t to = ticks();
  if (bytes_sent != 3 + 96 + 2) return false;
  print("Modbus request (48 registers): ", instructions(from + own, to), "\n");
  return true;
}

}  // namespace

int main() {
  flexcomp::boards::start_instruction_counter();
  const std::uint32_t from = ticks();
  own = ticks() - from;
  nominal.begin(selftest::tx60l());
  nominal.finish();
  Counts plain, bounded, curves, eleven;
  // In a cycle of a millisecond what a change of set leaves is settling, and commands so far from each other are
  // followed at the greatest rate; in one of a second nothing is held back.
  flexcomp_arm* arm = arm_with(budget::Set::paper, 1000);
  if (arm == nullptr || !steps(arm, bounded)) return 1;
  arm = arm_with(budget::Set::curves, 1000000);
  if (arm == nullptr || !steps(arm, curves)) return 2;
  arm = arm_with(budget::Set::eleven_kinds, 1000000);
  if (arm == nullptr || !steps(arm, eleven, true)) return 7;
  arm = arm_with(budget::Set::paper, 1000000);
  if (arm == nullptr || !steps(arm, plain)) return 3;
  print("step, 39 terms, least: ", plain.least, "\n");
  print("step, 39 terms, mean: ", plain.sum / calls, "\n");
  print("step, 39 terms, most: ", plain.most, "\n");
  print("step, 39 terms, settling, mean: ", bounded.sum / calls, "\n");
  print("step, 39 terms, settling, most: ", bounded.most, "\n");
  print("step, 39 terms and 6 curves, mean: ", curves.sum / calls, "\n");
  print("a joint curve: ", (curves.sum - plain.sum) / calls / 6U, "\n");
  print("step, eleven kinds of effect, regular poses, mean: ", eleven.sum / calls, "\n");
  print("step, eleven kinds of effect, regular poses, most: ", eleven.most, "\n");
  if (!regular_poses(arm)) return 4;
  Counts rate;
  if (!steps_with_rate(arm, rate)) return 8;
  print("step_rate, 39 terms, regular poses, mean: ", rate.sum / calls, "\n");
  print("step_rate, 39 terms, regular poses, most: ", rate.most, "\n");
  image_check();
  if (!sdo_request(arm)) return 5;
  if (!modbus_request(arm)) return 6;
  return 0;
}
