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
#include "flexcomp/wire/unit_record.hpp"
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
  /// The unit's serial number (UTF-8), told to clients; copied. The binding is by its hash in the robot. May be null.
  const char* serial = nullptr;
};

/// What the hook `log` is told.
enum class Event : std::uint8_t {
  booted = 1,           ///< detail: bits of wire::fault
  image_refused = 2,    ///< detail: Refusal
  activated = 3,        ///< a committed set; detail: its sequence
  trial_begun = 4,      ///< detail: sequence of the set on trial
  trial_confirmed = 5,  ///< detail: its sequence
  trial_reverted =
      6,  ///< not confirmed, or not written; detail: sequence of the set that is active again, 0: none
  rolled_back = 7,      ///< detail: sequence of the set that is active then, 0: none
  restored = 8,         ///< both slots are erased; detail: 0
  storage_failed = 9,   ///< detail: the last command that was accepted (wire::Command), 0 at the start
  not_authorised = 10,  ///< `permit` refused, or no unlock or signature; detail: wire::Command
  unlocked = 11,        ///< a client may roll back or restore now; detail: wire::Command::unlock
};

/// Answer of the hook `permit`.
enum class Permit : std::uint8_t {
  refuse = 0,    ///< the command is answered `not_authorised`
  allow = 1,     ///< nothing speaks against it
  authorise = 2  ///< the same; and where it would need an unlock or a signature, this takes their place
};

/// What a device asks and tells, in the background. None of them may call back.
struct DeviceHooks {
  void* user = nullptr;  ///< given to both
  /// Asked for each command of a client. Null: all are allowed.
  Permit (*permit)(void* user, wire::Command command, Origin origin) = nullptr;
  /// Told what has happened, from within the call in which it did.
  void (*log)(void* user, Event event, std::uint32_t detail) = nullptr;
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

  /// ControlCycle::step_rate().
  void step_rate(const Joints& q_command_rad, const Joints& q_rate_command_rad_s,
                 const FirmwareContext& context, StepResult& out, Joints& q_rate_rad_s) {
    cycle_.step_rate(q_command_rad, q_rate_command_rad_s, context, out, q_rate_rad_s);
  }

  /// Who is asked and told from now on; before boot() to hear of the start.
  void set_hooks(const DeviceHooks& hooks);
  /// Store::boot().
  void boot();
  /// Store::poll().
  void poll(std::uint32_t now_ms);
  /// Store::run(), where the hook permits it. Buses and local control pass here.
  wire::Answer run(wire::Command command, std::uint32_t argument, Origin origin);
  /// Store::begin_unknown(), where the hook permits wire::Command::begin.
  wire::Answer begin_unknown(Origin origin);

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

  /// Store::set_trust(): before boot().
  bool set_trust(const Trust& trust) { return store_.set_trust(trust); }
  /// Unit record.
  wire::UnitRecord unit() const;

  /// Certificate record of the active set.
  wire::CertificateRecord certificate() const;
  /// Value of 0x2005 (canopen_objects.hpp), sub-index 1 … 9, a real as binary32 bits; 0 without a set.
  std::uint32_t certificate_summary(std::size_t sub) const;

  /// Writes the robot record into `out`, of wire::robot_record_bytes.
  void robot_record(wire::ByteOrder order, std::uint8_t* out) const;

  /// Writes `size` bytes of the little-endian robot record, from `offset` on.
  void robot_record_part(std::uint32_t offset, std::uint8_t* out, std::uint32_t size) const {
    wire::encode_part(robot_, name_.data(), name_size_, offset, out, size);
  }

  /// Correction of a joint in the last control cycle; of any joint since the start for joint = 6. deg.
  float correction_deg(std::size_t joint) const;

  Store& store() { return store_; }                             ///< parameter store
  const Store& store() const { return store_; }                 ///< parameter store
  const ControlCycle& cycle() const { return cycle_; }          ///< control cycle
  const Robot& robot() const { return robot_; }                 ///< nominal robot
  const DeviceSettings& settings() const { return settings_; }  ///< as given

 private:
  /// What the hook `log` has been told of.
  struct Seen {
    std::uint16_t state = 0, answer = 0, refusal = 0, faults = 0;
    std::uint32_t sequence = 0, crc = 0;
    wire::Command command = wire::Command::none;  ///< the last one that was accepted
  };
  bool is_permitted(wire::Command command, Origin origin, bool& is_authorised);
  static void observe(Device& device);

  const Robot robot_;
  const DeviceSettings settings_;
  std::array<char, wire::robot_name_bytes> name_{};
  std::size_t name_size_ = 0;
  std::array<std::uint8_t, wire::serial_bytes> serial_{};
  std::uint16_t serial_size_ = 0;
  ParameterSets sets_{};
  ControlCycle cycle_;
  Store store_;
  DeviceHooks hooks_{};
  void (*observe_)(Device& device) = nullptr;  ///< null without `log`: what it needs is then not linked
  Seen seen_{};
  bool denied_ = false;  ///< the last command was not permitted
};

}  // namespace firmware
}  // namespace flexcomp

#endif
