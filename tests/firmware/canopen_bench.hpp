// SPDX-License-Identifier: Apache-2.0
// What the tests of the CANopen node share: frames of SDO by hand.
#pragma once

#include <array>
#include <optional>
#include <vector>

#include "firmware/bench.hpp"
#include "flexcomp_firmware/canopen.hpp"

namespace flexcomp::firmware::bench {

namespace co = wire::canopen;
using SdoFrame = std::array<std::uint8_t, 8>;

/// A frame that names an object: command specifier, index, sub-index, data.
inline SdoFrame sdo_frame(unsigned command, std::uint16_t index, std::uint8_t sub, std::uint32_t data = 0) {
  SdoFrame f{};
  f[0] = static_cast<std::uint8_t>(command);
  store_u16(f.data() + 1, index);
  f[3] = sub;
  store_u32(f.data() + 4, data);
  return f;
}

/// The abort code of an answer; 0 for any other answer, and for none.
inline std::uint32_t abort_code_of(const std::optional<SdoFrame>& f) {
  return f && (*f)[0] == 0x80 ? load_u32(f->data() + 4) : 0;
}

/// The same of all answers, where there is one.
inline std::uint32_t abort_code_of(const std::vector<SdoFrame>& answers) {
  return answers.size() == 1 ? abort_code_of(answers[0]) : 0;
}

/// One poll of store and node, and a cycle, after so long.
inline void poll_node(Arm& arm, CanopenNode& node, std::uint32_t ms) {
  arm.now_ms += ms;
  arm.device->store().poll(arm.now_ms);
  node.poll(arm.now_ms);
  arm.step();
}

}  // namespace flexcomp::firmware::bench
