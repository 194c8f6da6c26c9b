// SPDX-License-Identifier: Apache-2.0
#include "flexcomp_firmware/device.hpp"

#include "flexcomp/image.hpp"
#include "flexcomp_firmware/arithmetic.hpp"

namespace flexcomp {
namespace firmware {

namespace {

constexpr float degrees = 57.29577951F;  // of a radian

/// Scalar of binary64 bits from the wire.
Scalar scalar(std::uint64_t bits) { return from_binary64<Scalar>(double_of(bits)); }

/// Copies a text and gives its length. One that is too long for its record is left out: a part of it would be another one.
template <class Byte>
std::size_t copy_text(const char* text, Byte* to, std::size_t most) {
  std::size_t size = 0;
  if (text == nullptr) return 0;
  for (; size < most && text[size] != 0; ++size) to[size] = static_cast<Byte>(text[size]);
  return text[size] == 0 ? size : 0;
}

}  // namespace

Device::Device(const Robot& robot, const Storage& storage, const DeviceSettings& settings)
    : robot_(robot),
      settings_(settings),
      cycle_(robot, sets_, settings.control),
      store_(robot, sets_, storage, settings.store) {
  name_size_ = copy_text(settings.name, name_.data(), name_.size());
  serial_size_ = static_cast<std::uint16_t>(copy_text(settings.serial, serial_.data(), serial_.size()));
}

void Device::set_hooks(const DeviceHooks& hooks) {
  hooks_ = hooks;
  observe_ = nullptr;
  if (hooks.log == nullptr) return;
  hooks_.log = nullptr;
  observe(*this);
  hooks_.log = hooks.log;
  observe_ = observe;
}

void Device::boot() {
  store_.boot();
  if (observe_ == nullptr) return;
  const DeviceHooks hooks = hooks_;
  hooks_.log = nullptr;
  observe_(*this);
  hooks_.log = hooks.log;
  hooks.log(hooks.user, Event::booted, seen_.faults);
  if (seen_.refusal != 0) hooks.log(hooks.user, Event::image_refused, seen_.refusal);
}

void Device::poll(std::uint32_t now_ms) {
  wire::Status before;
  if (denied_) store_.status(before);
  store_.poll(now_ms);
  if (denied_ && before.state == static_cast<std::uint16_t>(wire::StoreState::working)) {
    // The end of the work is the answer to a command that came before the one that was not permitted.
    store_.status(before);
    denied_ = before.state == static_cast<std::uint16_t>(wire::StoreState::working);
  }
  if (observe_ != nullptr) observe_(*this);
}

bool Device::is_permitted(wire::Command command, Origin origin, bool& is_authorised) {
  Permit permit = Permit::allow;
  if (command != wire::Command::none && hooks_.permit != nullptr)
    permit = hooks_.permit(hooks_.user, command, origin);
  denied_ = permit == Permit::refuse;
  is_authorised = permit == Permit::authorise;
  if (denied_ && observe_ != nullptr)
    hooks_.log(hooks_.user, Event::not_authorised, static_cast<std::uint32_t>(command));
  if (denied_) return false;
  // A command clears the refusal of the one before: the same one again is told again.
  seen_.refusal = 0;
  seen_.answer = 0;
  return true;
}

wire::Answer Device::run(wire::Command command, std::uint32_t argument, Origin origin) {
  bool is_authorised = false;
  if (!is_permitted(command, origin, is_authorised)) return wire::Answer::not_authorised;
  const wire::Answer answer = store_.run(command, argument, origin, is_authorised);
  if (observe_ != nullptr && answer == wire::Answer::not_authorised)
    hooks_.log(hooks_.user, Event::not_authorised, static_cast<std::uint32_t>(command));
  if (observe_ != nullptr && answer == wire::Answer::accepted && command == wire::Command::unlock &&
      argument != 0)
    hooks_.log(hooks_.user, Event::unlocked, static_cast<std::uint32_t>(command));
  if (answer == wire::Answer::accepted && command != wire::Command::none) seen_.command = command;
  if (observe_ != nullptr) observe_(*this);
  return answer;
}

wire::Answer Device::begin_unknown(Origin origin) {
  bool is_authorised = false;
  if (!is_permitted(wire::Command::begin, origin, is_authorised)) return wire::Answer::not_authorised;
  const wire::Answer answer = store_.begin_unknown(origin);
  if (observe_ != nullptr) observe_(*this);
  return answer;
}

// Tells what has changed in the store since the last call.
void Device::observe(Device& device) {
  constexpr auto working = static_cast<std::uint16_t>(wire::StoreState::working);
  constexpr auto trial = static_cast<std::uint16_t>(wire::StoreState::trial);
  constexpr auto failed = static_cast<std::uint16_t>(wire::Answer::storage_failed);
  wire::Status now;
  device.store_.status(now);
  const Seen was = device.seen_;
  device.seen_ = {now.state,           now.answer,     now.refusal, now.faults,
                  now.active_sequence, now.active_crc, was.command};
  const DeviceHooks& hooks = device.hooks_;
  const auto tell = [&hooks](Event event, std::uint32_t detail) {
    if (hooks.log != nullptr) hooks.log(hooks.user, event, detail);
  };
  const unsigned new_faults = now.faults & ~static_cast<unsigned>(was.faults);
  if (now.refusal != 0 && now.refusal != was.refusal) tell(Event::image_refused, now.refusal);
  if ((now.answer == failed && was.answer != failed) || (new_faults & wire::fault::storage) != 0)
    tell(Event::storage_failed, static_cast<std::uint32_t>(was.command));

  const bool is_other_set = now.active_sequence != was.sequence || now.active_crc != was.crc;
  const bool has_ended = was.state == working && now.state != working && now.answer == 0;
  const std::uint32_t sequence = now.active_sequence;
  if ((new_faults & wire::fault::trial_reverted) != 0) {
    tell(Event::trial_reverted, sequence);
  } else if (is_other_set && now.state == trial && was.state != trial) {
    tell(Event::trial_begun, sequence);
  } else if (is_other_set || has_ended) {
    if (was.command == wire::Command::restore_defaults) {
      tell(Event::restored, sequence);
    } else if (was.command == wire::Command::confirm) {
      tell(is_other_set ? Event::trial_reverted : Event::trial_confirmed, sequence);
    } else if (is_other_set) {
      tell(was.command == wire::Command::rollback ? Event::rolled_back : Event::activated, sequence);
    }
  }
}

void Device::robot_record(wire::ByteOrder order, std::uint8_t* out) const {
  wire::encode(robot_, name_.data(), name_size_, order, out);
}

wire::ProbeRequest Device::with_default_context(const wire::ProbeRequest& request) const {
  const FirmwareContext context = default_context<Scalar>(robot_);
  wire::ProbeRequest out;
  out.q_rad = request.q_rad;
  out.payload_kg = to_binary64_bits(context.payload_kg);
  for (std::size_t k = 0; k < 3; ++k) out.payload_com_m[k] = to_binary64_bits(context.payload_com_m[k]);
  out.temperature_c = to_binary64_bits(context.temperature_c);
  return out;
}

wire::ProbeResponse Device::probe(const wire::ProbeRequest& request) const {
  Joints q;
  FirmwareContext context;
  for (std::size_t j = 0; j < joints; ++j) {
    q[j] = scalar(request.q_rad[j]);
    context.direction[j] = scalar(request.direction[j]);
    context.relative_speed[j] = scalar(request.relative_speed[j]);
  }
  for (std::size_t k = 0; k < 3; ++k) {
    context.payload_com_m[k] = scalar(request.payload_com_m[k]);
    context.force_n[k] = scalar(request.force_n[k]);
  }
  context.payload_kg = scalar(request.payload_kg);
  context.temperature_c = scalar(request.temperature_c);
  context.time_s = scalar(request.time_s);

  wire::ProbeResponse out;
  out.q_rad = request.q_rad;
  out.slot = store_.active_slot();
  out.sequence = store_.active_sequence();
  const FirmwareModel* model = store_.active_model();
  if (model == nullptr) {
    out.status = static_cast<std::uint16_t>(StepStatus::no_set);
    out.flags = step_flag::no_set;
    return out;
  }
  Compensated<Scalar, joints> compensated;
  corrected_command(*model, q, context, cycle_.settings().compensation, compensated);
  out.status = static_cast<std::uint16_t>(compensated.status);
  out.flags = compensated.flags;
  if (compensated.status == StepStatus::refused) return out;
  const RemainingError<Scalar> residual = remaining_error(*model, compensated.q, q, context);
  for (std::size_t j = 0; j < joints; ++j) out.q_rad[j] = to_binary64_bits(compensated.q[j]);
  out.position_m = to_binary64_bits(residual.position_m);
  out.orientation_rad = to_binary64_bits(residual.orientation_rad);
  return out;
}

wire::Capability Device::capability() const {
  wire::Capability c;
  c.joints = static_cast<std::uint16_t>(joints);
  c.scalar_bytes = static_cast<std::uint16_t>(sizeof(Scalar));
  c.schema = static_cast<std::uint16_t>((image::schema_major << 8U) | image::schema_minor);
  c.bases = (1U << basis_count) - 1U;
  c.flags = wire::capability_flag::unit | wire::capability_flag::probe_flags;
  c.terms = static_cast<std::uint16_t>(FirmwareCapacity::terms);
  c.tables = static_cast<std::uint16_t>(FirmwareCapacity::tables);
  c.values = static_cast<std::uint32_t>(FirmwareCapacity::values);
  c.image_bytes = staging_bytes;
  c.cycle_us = cycle_.settings().motion.cycle_us;
  c.fade_cycles = cycle_.output().settling_cycles();
  c.firmware = firmware_version;
  c.nominal_hash = store_.nominal_hash();
  c.name_hash = robot_.name_hash;
  c.plausible_position_m = to_binary64_bits(settings_.store.plausible_position_m);
  c.plausible_orientation_rad = to_binary64_bits(settings_.store.plausible_orientation_rad);
  c.largest_correction_rad = to_binary64_bits(cycle_.settings().compensation.largest_correction_rad);
  return c;
}

wire::Status Device::status() const {
  wire::Status s;
  store_.status(s);
  const ControlPublication& p = cycle_.publication();
  s.cycles = p.cycles.load(std::memory_order_relaxed);
  for (std::size_t k = 0; k < 6; ++k) {
    s.cycles_by_status[k] = p.cycles_by_status[k].load(std::memory_order_relaxed);
  }
  s.last_status = static_cast<std::uint16_t>(p.last_status.load(std::memory_order_relaxed));
  if (denied_) {
    s.answer = static_cast<std::uint16_t>(wire::Answer::not_authorised);
    s.refusal = 0;
    s.detail = 0;
  }
  return s;
}

wire::UnitRecord Device::unit() const {
  wire::UnitRecord r;
  const Trust& trust = store_.trust();
  r.unit_hash = robot_.unit_hash;
  r.counter = store_.counter();
  r.keys = trust.count;
  r.serial_size = serial_size_;
  r.serial = serial_;
  for (std::size_t k = 0; k < wire::listed_keys && k < trust.count; ++k) r.key_ids[k] = key_id(trust.keys[k]);
  return r;
}

wire::CertificateRecord Device::certificate() const {
  wire::CertificateRecord r;
  r.most_instructions = settings_.store.limits.instructions;
  const FirmwareCertificate* c = store_.active_certificate();
  if (c == nullptr) return r;
  for (std::size_t j = 0; j < joints; ++j) {
    r.deflection_rad[j] = to_binary64_bits(c->deflection_rad[j]);
    r.slope[j] = to_binary64_bits(c->slope[j]);
  }
  r.off_joint_rad = to_binary64_bits(c->off_joint_rad);
  r.off_joint_slope = to_binary64_bits(c->off_joint_slope);
  r.rad_per_kg = to_binary64_bits(c->rad_per_kg);
  r.rad_per_n = to_binary64_bits(c->rad_per_n);
  r.rad_per_m = to_binary64_bits(c->rad_per_m);
  r.rad_per_k = to_binary64_bits(c->rad_per_k);
  r.position_m = to_binary64_bits(c->position_m);
  r.orientation_rad = to_binary64_bits(c->orientation_rad);
  r.reach_m = to_binary64_bits(c->reach_m);
  r.instructions = c->instructions;
  r.sequence = store_.active_sequence();
  return r;
}

std::uint32_t Device::certificate_summary(std::size_t sub) const {
  const FirmwareCertificate* c = store_.active_certificate();
  if (c == nullptr) return 0;
  if (sub == 1) return c->instructions;
  float v = 0;
  if (sub == 2) {
    v = static_cast<float>(c->position_m) * 1000.0F;
  } else if (sub == 3) {
    v = static_cast<float>(c->orientation_rad) * degrees;
  } else if (sub < 4 + joints) {
    v = static_cast<float>(c->deflection_rad[sub - 4]) * degrees;
  }
  return bits32_of(v);
}

float Device::correction_deg(std::size_t joint) const {
  const ControlPublication& p = cycle_.publication();
  const std::atomic<std::uint32_t>& bits =
      joint < joints ? p.correction_rad[joint] : p.largest_correction_rad;
  return float_of(bits.load(std::memory_order_relaxed)) * degrees;
}

}  // namespace firmware
}  // namespace flexcomp
