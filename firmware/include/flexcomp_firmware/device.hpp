// SPDX-License-Identifier: Apache-2.0
/// \file
/// One arm without a bus: parameter store, control cycle and probe, by the records of
/// flexcomp/wire/store_state.hpp. The bus servers call it.
#ifndef FLEXCOMP_FIRMWARE_DEVICE_HPP
#define FLEXCOMP_FIRMWARE_DEVICE_HPP

#include <array>
#include <cstdint>

#include "flexcomp/wire/certificate_record.hpp"
#include "flexcomp/wire/robot_record.hpp"
#include "flexcomp/wire/store_state.hpp"
#include "flexcomp_firmware/config.hpp"
#include "flexcomp_firmware/control.hpp"
#include "flexcomp_firmware/store.hpp"

namespace flexcomp {
namespace firmware {

/// Settings of a device.
struct DeviceSettings {
  ControlSettings control{};  ///< of the step; clients are told its period
  StoreSettings store{};      ///< of the parameter store
  /// The robot's name (UTF-8), told to clients; copied. The set's binding is by its hash in the robot. May be
  /// null.
  const char* name = nullptr;
};

/// One arm. step() is for the thread or interrupt of the control cycle, everything else for the background.
class Device {
 public:
  /// Copies robot and settings; without boot() of the store there is no set.
  Device(const Robot& robot, const Storage& storage, const DeviceSettings& settings);
  Device(const Device&) = delete;
  Device& operator=(const Device&) = delete;

  /// ControlCycle::start().
  bool start(const Joints& q_standing_rad) { return cycle_.start(q_standing_rad); }

  /// ControlCycle::step().
  void step(const Joints& q_command_rad, const FirmwareContext& context, StepResult& out) {
    cycle_.step(q_command_rad, context, out);
  }
  /// step() by value.
  StepResult step(const Joints& q_command_rad, const FirmwareContext& context) {
    StepResult out;
    step(q_command_rad, context, out);
    return out;
  }

  /// Compensation of one command by the active set, with an empty state (directions from the request; no
  /// output stage): compensate() of the core and nothing else, so that it equals the host's answer to the
  /// last bit.
  wire::ProbeResponse probe(const wire::ProbeRequest& request) const;

  /// The request's joint command with the robot's default context.
  wire::ProbeRequest with_default_context(const wire::ProbeRequest& request) const;

  /// Capability record.
  wire::Capability capability() const;
  /// Status record.
  wire::Status status() const;

  /// Certificate record of the active set.
  wire::CertificateRecord certificate() const;
  /// Value of 0x2005 (canopen_objects.hpp), sub-index 1 … 9, a real as binary32 bits; 0 without a set.
  std::uint32_t certificate_summary(std::size_t sub) const;

  /// Writes the robot record into `out`, of wire::robot_record_bytes.
  void robot_record(wire::ByteOrder order, std::uint8_t* out) const;

  /// Correction of a joint in the last control cycle; of any joint since the start for joint = 6. deg.
  float correction_deg(std::size_t joint) const;

  Store& store() { return store_; }                             ///< parameter store
  const Store& store() const { return store_; }                 ///< parameter store
  const ControlCycle& cycle() const { return cycle_; }          ///< control cycle
  const Robot& robot() const { return robot_; }                 ///< nominal robot
  const DeviceSettings& settings() const { return settings_; }  ///< as given

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
