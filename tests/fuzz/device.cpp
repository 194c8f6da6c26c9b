// SPDX-License-Identifier: Apache-2.0
// A whole device as a sequence of operations over all its interfaces: the C interface with staging, hooks and steps of odd
// numbers, both buses beside it, a flash that fails, and power that goes. Input: the controller's start, then operations.
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
  operations
};

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
      const Bytes image = good_image(input.u8(), input.u8());
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
      if (what < 96) device.fail_storage(what % 4);
      if (what >= 96 && what < 160) device.busy_storage(what % 8);
      if (what >= 160) device.cut_power_after(static_cast<std::uint32_t>(input.u16()) % 30000U);
      break;
    }
    case power:
      device.power_on();
      break;
    case can_download: {
      const Bytes image = good_image(input.u8(), input.u8());
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
      device.rtu_frame(to < 200 ? unit_id : to - 200, modbus_request(input), 3000);
      break;
    }
    case tcp_request: {
      const std::size_t k = input.u8() & 1U;
      device.ask(k, modbus_request(input));
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
      const unsigned n = input.u16();
      require(flexcomp_answer_text(n) != nullptr && flexcomp_refusal_text(n) != nullptr &&
                  flexcomp_init_error_text(n) != nullptr &&
                  flexcomp_status_text(static_cast<flexcomp_status>(n % 8)) != nullptr,
              "a number without a text");
      break;
    }
    default: {
      const unsigned which = input.u8();
      device.push(good_image(which, input.u8()));
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
  return all;
}

const Register registered({"device", run, seeds, nullptr});

}  // namespace
}  // namespace fuzz::device_target
