// SPDX-License-Identifier: Apache-2.0
#include "model/robot.hpp"

#include <fmt/format.h>

#include "flexcomp/image.hpp"
#include "flexcomp/wire/unit_record.hpp"
#include "model/calibration.hpp"
#include "utf8.hpp"

namespace flexcomp::host {

static_assert(longest_serial == wire::serial_bytes);

bool is_serial(std::string_view text) {
  return !text.empty() && text.size() <= longest_serial && is_printable(text);
}

void set_serial(Robot& robot, const std::string& serial) {
  robot.serial = serial;
  robot.nominal.unit_hash = name_hash(serial.data(), serial.size());
}

std::string unit_text(const std::string& serial, const Sha256Digest& unit_hash) {
  if (!serial.empty()) return fmt::format("unit '{}'", serial);
  if (!is_given(unit_hash)) return "a unit without a serial number";
  return fmt::format("a unit whose serial number has the SHA-256 {}…", hex(unit_hash).substr(0, 12));
}

}  // namespace flexcomp::host
