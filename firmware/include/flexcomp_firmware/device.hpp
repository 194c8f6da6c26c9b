// SPDX-License-Identifier: Apache-2.0
/// \file
/// The controller's side of the wire without a bus: parameter store, control cycle and probe behind the
/// records of flexcomp/wire/store_state.hpp. The bus servers talk to this.
#ifndef FLEXCOMP_FIRMWARE_DEVICE_HPP
#define FLEXCOMP_FIRMWARE_DEVICE_HPP

#include <array>
#include <cstdint>

#include "flexcomp/wire/robot_record.hpp"
#include "flexcomp/wire/store_state.hpp"
#include "flexcomp_firmware/config.hpp"
#include "flexcomp_firmware/control.hpp"
#include "flexcomp_firmware/store.hpp"

namespace flexcomp {
namespace firmware {

struct DeviceSettings {
  ControlSettings control{};
  StoreSettings store{};
  std::uint32_t cycle_us = 1000;  ///< period of the control cycle, told to clients
  /// The robot's name (UTF-8), told to clients; copied. The set's binding is by its hash in the robot. May be
  /// null.
  const char* name = nullptr;
};

/// One arm. step() belongs to the control cycle's thread or interrupt, everything else to the background's
/// one.
class Device {
 public:
  Device(const Robot& robot, const Storage& storage, const DeviceSettings& settings);
  Device(const Device&) = delete;
  Device& operator=(const Device&) = delete;

  void step(const Joints& q_command_rad, const FirmwareContext& context, StepResult& out) {
    cycle_.step(q_command_rad, context, out);
  }
  StepResult step(const Joints& q_command_rad, const FirmwareContext& context) {
    StepResult out;
    step(q_command_rad, context, out);
    return out;
  }

  /// What the active set makes of one command, with an empty state (no fade; directions from the request):
  /// compensate() of the core and nothing else, so that it equals the host's answer to the last bit.
  wire::ProbeResponse probe(const wire::ProbeRequest& request) const;

  /// The request's joint command with the robot's default context.
  wire::ProbeRequest with_default_context(const wire::ProbeRequest& request) const;

  wire::Capability capability() const;
  wire::Status status() const;

  /// The arm that this controller was built for, into `out` (wire::robot_record_bytes).
  void robot_record(wire::ByteOrder order, std::uint8_t* out) const;

  /// Correction of a joint in the last control cycle; of any joint since the start for joint = 6. deg.
  float correction_deg(std::size_t joint) const;

  Store& store() { return store_; }
  const Store& store() const { return store_; }
  const ControlCycle& cycle() const { return cycle_; }
  const Robot& robot() const { return robot_; }
  const DeviceSettings& settings() const { return settings_; }

 private:
  const Robot robot_;
  const DeviceSettings settings_;
  std::array<char, wire::robot_name_bytes> name_{};
  std::size_t name_size_ = 0;
  ParameterSets sets_{};
  ControlCycle cycle_;
  Store store_;
};

}  // namespace firmware
}  // namespace flexcomp

#endif
