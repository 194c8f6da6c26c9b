// SPDX-License-Identifier: Apache-2.0
// A whole device as a sequence of operations over all its interfaces: the C interface with staging, hooks and steps of odd
// numbers, both buses beside it, a flash that fails, and power that goes. Input: the controller's start, then operations.
#include <cstddef>

#include "modbus_requests.hpp"

namespace fuzz::device_target {
namespace {

enum : unsigned {
  step,
  step_rate,
  readings,
  start,
  steps,
  poll,
  settle,
  stage_good,
  stage_begin,
  stage_write,
  stage_verify,
  stage_commit,
  stage_trial,
  stage_abort,
  command,
  permission,
  storage,
  power,
  can_download,
  can_command,
  can_any,
  rtu_request,
  tcp_request,
  tcp_end,
  texts,
  whole_push,
  signed_command,
  unlock,
  checks,
  other_arm,
  operations
};

/// The last number of FLEXCOMP_BUILD_.
constexpr std::size_t other_structs() {
  const std::size_t built[] = {FLEXCOMP_BUILD_};
  return built[sizeof built / sizeof built[0] - 1];
}

/// Another arm, of a robot and settings of odd numbers, in memory of a wrong size, by a program that was compiled with others: it
/// is refused with a reason, or it makes a step.
void init_other(Input& input) {
  const unsigned what = input.u8();
  flexcomp_robot robot = arm_of_the_paper();
  flexcomp_settings settings;
  flexcomp_settings_default(&settings);
  if ((what & 1U) != 0) {
    // The members between name and serial number are numbers.
    constexpr std::size_t first = offsetof(flexcomp_robot, links), end = offsetof(flexcomp_robot, serial);
    const std::size_t at = first + sizeof(double) * (input.u8() % ((end - first) / sizeof(double)));
    const double v = input.odd_number();
    std::memcpy(reinterpret_cast<unsigned char*>(&robot) + at, &v, sizeof v);
  }
  if ((what & 2U) != 0) {
    flexcomp_real* const numbers[] = {
        &settings.largest_correction_rad,    &settings.steepest,
        &settings.direction_band_rad,        &settings.plausible_position_m,
        &settings.plausible_orientation_rad, &settings.correction_rate_rad_s[2],
        &settings.offset_rate_rad_s,         &settings.offset_acceleration_rad_s2};
    *numbers[input.u8() % 8U] = static_cast<flexcomp_real>(input.odd_number());
  }
  if ((what & 4U) != 0) {
    const unsigned which = input.u8() % 6;
    if (which == 0) settings.cycle_us = input.u16();
    if (which == 1) settings.struct_size = input.u16();
    if (which == 2) robot.name = nullptr;
    if (which == 3) robot.name = "";
    if (which == 4) settings.direction_band_rad = 0;
    if (which == 5) robot.serial = "a serial number of more bytes than the unit record has room for";
  }
  std::size_t built[] = {sizeof(flexcomp_real), FLEXCOMP_JOINTS,       FLEXCOMP_TERMS,
                         FLEXCOMP_TABLES,       FLEXCOMP_TABLE_VALUES, FLEXCOMP_STAGING_BYTES};
  if ((what & 8U) != 0) built[input.u8() % 6U] += 1;
  std::size_t size = FLEXCOMP_MEMORY_BYTES;
  if ((what & 16U) != 0) size -= 8 * std::size_t{input.u16()};
  const std::unique_ptr<unsigned char[]> memory(new unsigned char[FLEXCOMP_MEMORY_BYTES]);
  unsigned error = 99;
  flexcomp_arm* arm =
      flexcomp_init_checked(memory.get(), size, &robot, &settings, nullptr, &error, built[0], built[1],
                            built[2], built[3], built[4], built[5], (what & 32U) != 0 ? 1 : other_structs());
  require((arm == nullptr) == (error != FLEXCOMP_INIT_DONE) && error <= FLEXCOMP_INIT_OTHER_STRUCTS,
          "refused without a reason, or taken with one");
  if (arm == nullptr) return;
  flexcomp_boot(arm);
  const flexcomp_trust trust{nullptr, public_keys(), 1, nullptr};
  require(flexcomp_set_trust(arm, &trust) == 0, "keys are taken after the start, and without a check");
  const Bytes image = good_image(1, 1);
  flexcomp_stage_begin(arm, static_cast<std::uint32_t>(image.size()));
  flexcomp_stage_write(arm, 0, image.data(), static_cast<std::uint32_t>(image.size()));
  require(flexcomp_stage_commit(arm) == static_cast<unsigned>(flexcomp::wire::Answer::storage_failed),
          "a set was committed without a storage");
  Device::Joints out{};
  for (int k = 0; k < 3; ++k) {
    const Device::Joints q{{static_cast<flexcomp_real>(0.1 * k), 0.1F, 0.1F, 0.1F, 0.1F, 0.1F}};
    flexcomp_step(arm, q.data(), nullptr, out.data());
    for (const flexcomp_real v : out) require(std::isfinite(v), "a number that is not finite left a step");
  }
}

void operate(Device& device, Input& input) {
  flexcomp_arm* arm = device.arm();
  unsigned answer = 0;
  switch (input.u8() % operations) {
    case step: {
      const OddStep odd(input, arm);
      device.step(odd.q, odd.given());
      break;
    }
    case step_rate: {
      const OddStep odd(input, arm);
      device.step_rate(odd.q, odd.rate, odd.given());
      break;
    }
    case readings: {
      const OddStep odd(input, arm);
      device.readings(odd.q, odd.given());
      break;
    }
    case start: {
      const OddStep odd(input, arm);
      const int taken = device.start(odd.q);
      for (const flexcomp_real q : odd.q) {
        require(taken == 0 || std::abs(q) <= static_cast<flexcomp_real>(most_rad),
                "a start beyond a limit was taken");
      }
      break;
    }
    case steps:
      device.ordinary_steps(1 + input.u8() % 24);
      break;
    case poll:
      device.poll(input.u16());
      break;
    case settle:
      device.settle();
      break;
    case stage_good: {
      const unsigned which = input.u8();
      const Bytes image = device.image(which, input.u8());
      answer = flexcomp_stage_begin(arm, static_cast<std::uint32_t>(image.size()));
      flexcomp_stage_write(arm, 0, image.data(), static_cast<std::uint32_t>(image.size()));
      break;
    }
    case stage_begin:
      answer = flexcomp_stage_begin(arm, (input.u8() & 3U) == 0 ? input.u32() : input.u16());
      break;
    case stage_write: {
      const std::uint32_t offset = (input.u8() & 3U) == 0 ? input.u32() : input.u16();
      const Bytes bytes = input.bytes(input.u8());
      answer = flexcomp_stage_write(arm, offset, bytes.data(), static_cast<std::uint32_t>(bytes.size()));
      break;
    }
    case stage_verify:
      answer = flexcomp_stage_verify(arm);
      break;
    case stage_commit:
      answer = flexcomp_stage_commit(arm);
      break;
    case stage_trial:
      answer = flexcomp_stage_commit_trial(arm, input.u8() % 32);
      break;
    case stage_abort:
      answer = flexcomp_stage_abort(arm);
      break;
    case command: {
      const unsigned c = input.u8();
      answer = flexcomp_command(arm, c < 192 ? c % 10 : input.u32());
      break;
    }
    case permission:
      device.allow(input.u16());
      break;
    case storage: {
      const unsigned what = input.u8();
      if (what < 96) device.fail_storage(what % 4, what / 4);
      if (what >= 96 && what < 160) device.busy_storage(what % 8);
      if (what >= 160) device.cut_power_after(static_cast<std::uint32_t>(input.u16()) % 30000U);
      break;
    }
    case power:
      device.power_on();
      break;
    case can_download: {
      const unsigned which = input.u8();
      const Bytes image = device.image(which, input.u8());
      device.download(0x2010, 1, image, (input.u8() & 1U) == 0);
      break;
    }
    case can_command:
      device.download(0x2011, 2, Output().u16(input.u8() % 12).out, true);
      device.can_poll(input.u8());
      break;
    case can_any:
      device.sdo(input.bytes(8));
      break;
    case rtu_request: {
      const unsigned to = input.u8();
      device.rtu_frame(to < 200 ? unit_id : to - 200, modbus_request(device, input), 3000);
      break;
    }
    case tcp_request: {
      const std::size_t k = input.u8() & 1U;
      device.ask(k, modbus_request(device, input));
      break;
    }
    case tcp_end: {
      const unsigned how = input.u8();
      if ((how & 2U) == 0) {
        device.tcp_reset(how & 1U);
      } else {
        device.tcp_init(how & 1U);
      }
      break;
    }
    case texts: {
      const unsigned first = input.u16();
      for (unsigned n = first; n < first + 40; ++n) {
        require(flexcomp_answer_text(n) != nullptr && flexcomp_refusal_text(n) != nullptr &&
                    flexcomp_init_error_text(n) != nullptr &&
                    flexcomp_status_text(static_cast<flexcomp_status>(n % 8)) != nullptr &&
                    flexcomp_version()[0] != 0,
                "a number without a text");
        // Whatever a store answers, a client is told by an abort, or it was accepted.
        const auto refusal = static_cast<flexcomp::Refusal>(n % 64);
        require(flexcomp::wire::canopen::abort_code(flexcomp::wire::Answer::refused, refusal) != 0 ||
                    refusal == flexcomp::Refusal::none,
                "a refusal without an abort code");
        const auto said = static_cast<flexcomp::wire::Answer>(n % 16);
        require(flexcomp::wire::canopen::abort_code(said, flexcomp::Refusal::checksum) != 0 ||
                    said == flexcomp::wire::Answer::accepted,
                "an answer without an abort code");
      }
      break;
    }
    case signed_command: {
      const unsigned which = input.u8();
      Bytes bytes = device.signed_command(which & 0x0FU, input.u8(), (which >> 4U & 3U) % key_count);
      if ((which & 0x80U) != 0) bytes[input.u8() % bytes.size()] ^= input.u8();
      if ((which & 0x40U) != 0) mend_crc(bytes);
      flexcomp_stage_begin(arm, static_cast<std::uint32_t>(bytes.size()));
      flexcomp_stage_write(arm, 0, bytes.data(), static_cast<std::uint32_t>(bytes.size()));
      answer = flexcomp_stage_verify(arm);
      break;
    }
    case unlock:
      flexcomp_command(arm, 9);
      device.poll(1);  // without one there is no challenge
      device.download(0x2011, 1, Output().u32(0).out, true);
      device.download(0x2011, 2, Output().u16(9).out, true);
      device.download(0x2011, 1, Output().u32(device.state().detail ^ input.u8()).out, true);
      device.download(0x2011, 2, Output().u16(9).out, true);
      break;
    case checks:
      device.slow_checks(input.u8());
      break;
    case other_arm:
      init_other(input);
      break;
    default: {
      const unsigned which = input.u8();
      device.push(device.image(which, input.u8()));
      device.ordinary_steps(3);
    }
  }
  require(answer <= 10, "an answer that the protocol does not have");
  device.end_of_operation();
}

void run(Input input) {
  Device device(input.u8());
  for (unsigned k = 0; k < 48 && !input.is_empty(); ++k) operate(device, input);
  device.check_active();
}

std::vector<Bytes> seeds() {
  std::vector<Bytes> all;
  const auto add = [&all](const Output& out) { all.push_back(out.out); };
  add(Output()
          .u8(2)
          .u8(start)
          .u8(0)
          .u8(steps)
          .u8(20)
          .u8(step)
          .u8(0xC1)
          .u8(2)
          .u8(1)
          .u8(2)
          .u8(3)
          .u8(4)
          .u8(readings)
          .u8(0)
          .u8(step_rate)
          .u8(0x40)
          .u32(0x20202020));
  add(Output()
          .u8(8)
          .u8(whole_push)
          .u8(5)
          .u8(3)
          .u8(steps)
          .u8(5)
          .u8(step_rate)
          .u8(0x7F)
          .u32(0x8090A0B0)
          .u32(0x8090A0B0)
          .u32(0x8090A0B0)
          .u8(readings)
          .u8(0xBF)
          .u8(0x3F)
          .u32(0x8090A0B0)
          .u32(0x80908050)
          .u32(0x80908040));
  add(Output()
          .u8(1)
          .u8(steps)
          .u8(2)
          .u8(stage_good)
          .u8(3)
          .u8(9)
          .u8(stage_verify)
          .u8(settle)
          .u8(stage_commit)
          .u8(settle)
          .u8(steps)
          .u8(9)
          .u8(command)
          .u8(6)
          .u8(settle)
          .u8(steps)
          .u8(4)
          .u8(command)
          .u8(8)
          .u8(settle)
          .u8(power));
  add(Output()
          .u8(1)
          .u8(steps)
          .u8(2)
          .u8(stage_good)
          .u8(3)
          .u8(9)
          .u8(stage_trial)
          .u8(9)
          .u8(settle)
          .u8(steps)
          .u8(4)
          .u8(command)
          .u8(5)
          .u8(settle)
          .u8(steps)
          .u8(4)
          .u8(power));
  add(Output()
          .u8(1)
          .u8(steps)
          .u8(2)
          .u8(stage_good)
          .u8(4)
          .u8(9)
          .u8(stage_trial)
          .u8(3)
          .u8(settle)
          .u8(steps)
          .u8(20)
          .u8(poll)
          .u16(1)
          .u8(poll)
          .u16(1));
  add(Output()
          .u8(0)
          .u8(stage_begin)
          .u8(1)
          .u16(100)
          .u8(stage_write)
          .u8(1)
          .u16(0)
          .u8(5)
          .u32(1)
          .u8(5)
          .u8(stage_abort)
          .u8(stage_begin)
          .u8(0)
          .u32(0x80000000)
          .u8(texts)
          .u16(3));
  add(Output()
          .u8(0)
          .u8(permission)
          .u16(0xFFF7)
          .u8(stage_good)
          .u8(1)
          .u8(1)
          .u8(stage_commit)
          .u8(permission)
          .u16(0xFFFF)
          .u8(stage_commit)
          .u8(storage)
          .u8(170)
          .u16(13000)
          .u8(settle));
  add(Output()
          .u8(0)
          .u8(can_download)
          .u8(2)
          .u8(3)
          .u8(0)
          .u8(can_command)
          .u8(3)
          .u8(5)
          .u8(settle)
          .u8(steps)
          .u8(3)
          .u8(tcp_request)
          .u8(0)
          .u8(1)
          .u8(0)
          .u8(2)
          .u8(48)
          .u8(rtu_request)
          .u8(0)
          .u8(9)
          .u8(17)
          .u8(tcp_end)
          .u8(2));
  add(Output()
          .u8(2)
          .u8(steps)
          .u8(2)
          .u8(storage)
          .u8(2)
          .u8(whole_push)
          .u8(1)
          .u8(20)
          .u8(storage)
          .u8(101)
          .u8(whole_push)
          .u8(2)
          .u8(30)
          .u8(can_any)
          .u32(0x00200040)
          .u32(0)
          .u8(tcp_end)
          .u8(1));
  add(Output()
          .u8(20)
          .u8(whole_push)
          .u8(4)
          .u8(2)
          .u8(step)
          .u8(0x81)
          .u8(3)
          .u8(9)
          .u8(3)
          .u8(step)
          .u8(0x80)
          .u8(1)
          .u8(2)
          .u8(steps)
          .u8(9));
  add(Output().add(octets(0, texts, 0, 0, texts, 255, 0, stage_abort)));
  for (const unsigned what : {0U, 8U, 16U, 32U}) {
    for (unsigned which = 0; which < 6; ++which)
      add(Output().add(octets(0, other_arm, what, which, 0, other_arm, what + 4, which, 255, 255, 255)));
  }
  for (unsigned which = 0; which < 8; ++which)
    add(Output().add(octets(0, other_arm, 1, 7 * which, 2 + which, other_arm, 2, which, 2 + which, other_arm,
                            2, which, 9, other_arm, 2, which, 0)));
  // On devices that trust keys, and on one that has a serial number alone.
  for (const unsigned begin : {32U, 33U, 34U, 65U, 97U}) {
    add(Output().add(octets(begin, steps, 3, whole_push, 1, 20, stage_good, 3, 21, stage_trial, 9, settle,
                            steps, 4, command, 5, settle, steps, 3, power)));
    add(Output().add(octets(begin, steps, 3, checks, 9, signed_command, 6, 40, settle, command, 6, settle,
                            signed_command, 0x86, 41, 70, 1, settle, signed_command, 0xC8, 42, 9, 1, settle,
                            unlock, 0, can_command, 6, 0, settle, power)));
    add(Output().add(octets(begin, steps, 3, whole_push, 2, 20, permission, 0, 0xFF, unlock, 1, can_command,
                            8, 0, permission, 0xFF, 0xFF, can_command, 6, 0, settle, can_command, 6, 1)));
  }
  return all;
}

const Register registered({"device", run, seeds, nullptr});

}  // namespace
}  // namespace fuzz::device_target
