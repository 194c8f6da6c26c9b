// SPDX-License-Identifier: Apache-2.0
// The C interface: builds every object in the caller's memory and forwards the calls.
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <new>

#include "flexcomp.h"
#include "flexcomp_firmware/canopen.hpp"
#include "flexcomp_firmware/device.hpp"
#include "flexcomp_firmware/modbus.hpp"

namespace fw = flexcomp::firmware;

namespace {

/// A device and the C hooks that it calls.
struct Arm {
  Arm(const fw::Robot& robot, const flexcomp_storage& c_storage, const fw::DeviceSettings& settings)
      : hooks(c_storage),
        device(robot, storage(), settings),
        context(flexcomp::default_context<fw::Scalar>(robot)) {}

  fw::Storage storage() {
    fw::Storage s;
    s.user = this;
    if (hooks.read != nullptr) s.read = read;
    if (hooks.erase != nullptr) s.erase = erase;
    if (hooks.write != nullptr) s.write = write;
    return s;
  }

  static fw::StorageResult result(flexcomp_storage_result r) {
    if (r == FLEXCOMP_STORAGE_DONE) return fw::StorageResult::done;
    return r == FLEXCOMP_STORAGE_BUSY ? fw::StorageResult::busy : fw::StorageResult::failed;
  }
  static fw::StorageResult read(void* user, unsigned slot, std::uint32_t offset, std::uint8_t* to,
                                std::uint32_t size) {
    const flexcomp_storage& h = static_cast<Arm*>(user)->hooks;
    return result(h.read(h.user, slot, offset, to, size));
  }
  static fw::StorageResult erase(void* user, unsigned slot) {
    const flexcomp_storage& h = static_cast<Arm*>(user)->hooks;
    return result(h.erase(h.user, slot));
  }
  static fw::StorageResult write(void* user, unsigned slot, std::uint32_t offset, const std::uint8_t* from,
                                 std::uint32_t size) {
    const flexcomp_storage& h = static_cast<Arm*>(user)->hooks;
    return result(h.write(h.user, slot, offset, from, size));
  }

  /// A number that no other bus object of this arm has.
  fw::Origin next_origin() { return ++origins; }

  const flexcomp_storage hooks;
  fw::Device device;
  const fw::FirmwareContext context;
  fw::Origin origins = fw::nobody;
};

struct Can {
  Can(Arm& arm, const fw::CanopenSettings& settings, flexcomp_can_send c_send, void* c_user)
      : send(c_send), user(c_user), node(arm.device, arm.next_origin(), settings, {this, transmit}) {}
  static bool transmit(void* self, std::uint16_t id, const std::uint8_t* bytes, std::uint8_t size) {
    const Can* can = static_cast<Can*>(self);
    return can->send(can->user, id, bytes, size) != 0;
  }
  flexcomp_can_send send;
  void* user;
  fw::CanopenNode node;
};

struct Rtu {
  Rtu(Arm& arm, std::uint8_t unit, std::uint32_t gap_us, flexcomp_send send, void* user)
      : server(arm.device, arm.next_origin()), line(server, unit, gap_us, {user, send}) {}
  fw::ModbusServer server;
  fw::ModbusRtu line;
};

struct Tcp {
  Tcp(Arm& arm, std::uint8_t c_unit, flexcomp_send send, void* user)
      : unit(c_unit),
        transmit{user, send},
        server(arm.device, arm.next_origin()),
        stream(server, unit, transmit) {}
  std::uint8_t unit;
  fw::Transmit transmit;
  fw::ModbusServer server;
  fw::ModbusTcp stream;
};

static_assert(sizeof(Arm) <= FLEXCOMP_MEMORY_BYTES, "FLEXCOMP_MEMORY_BYTES is too small");
static_assert(sizeof(Can) <= FLEXCOMP_CAN_BYTES, "FLEXCOMP_CAN_BYTES is too small");
static_assert(sizeof(Rtu) <= FLEXCOMP_RTU_BYTES, "FLEXCOMP_RTU_BYTES is too small");
static_assert(sizeof(Tcp) <= FLEXCOMP_TCP_BYTES, "FLEXCOMP_TCP_BYTES is too small");
static_assert(alignof(Arm) <= 8 && alignof(Can) <= 8 && alignof(Rtu) <= 8 && alignof(Tcp) <= 8,
              "aligned to 8 bytes");
static_assert(FLEXCOMP_JOINTS == fw::joints, "six joints");

template <class T>
bool fits(const void* memory, std::size_t size) {
  return memory != nullptr && size >= sizeof(T) && reinterpret_cast<std::uintptr_t>(memory) % alignof(T) == 0;
}

Arm& arm_of(flexcomp_arm* fc) { return *reinterpret_cast<Arm*>(fc); }
const Arm& arm_of(const flexcomp_arm* fc) { return *reinterpret_cast<const Arm*>(fc); }
Can& can_of(flexcomp_can* can) { return *reinterpret_cast<Can*>(can); }
Rtu& rtu_of(flexcomp_rtu* rtu) { return *reinterpret_cast<Rtu*>(rtu); }
Tcp& tcp_of(flexcomp_tcp* tcp) { return *reinterpret_cast<Tcp*>(tcp); }

/// The geometry is double on every target and the M4F has no double arithmetic: numbers are compared as bits
/// or as the target's scalar.
fw::Scalar scalar(double v) { return flexcomp::from_binary64<fw::Scalar>(v); }

/// True where all members after the name, which are doubles, are finite.
bool all_finite(const flexcomp_robot& robot) {
  constexpr std::size_t first = offsetof(flexcomp_robot, links);
  static_assert((sizeof robot - first) % sizeof(double) == 0, "only doubles");
  const unsigned char* bytes = reinterpret_cast<const unsigned char*>(&robot) + first;
  for (std::size_t k = 0; k < (sizeof robot - first) / sizeof(double); ++k) {
    double v;
    std::memcpy(&v, bytes + k * sizeof v, sizeof v);
    if (!flexcomp::is_finite(v)) return false;
  }
  return true;
}

bool take_robot(const flexcomp_robot& from, fw::Robot& to) {
  if (from.name == nullptr || from.name[0] == 0 || !all_finite(from)) return false;
  std::size_t length = 0;
  while (from.name[length] != 0) ++length;
  to.name_hash = flexcomp::name_hash(from.name, length);
  for (std::size_t j = 0; j < fw::joints; ++j) {
    const flexcomp_link& link = from.links[j];
    to.links[j] = {link.theta_rad, link.d_m, link.a_m, link.alpha_rad, link.beta_rad};
    to.limits[j] = {from.min_rad[j], from.max_rad[j]};
    if (!(scalar(from.min_rad[j]) < scalar(from.max_rad[j]))) return false;
  }
  for (std::size_t k = 0; k < 3; ++k) {
    to.gravity_m_s2[k] = from.gravity_m_s2[k];
    to.tool_xyz_m[k] = from.tool_xyz_m[k];
    to.payload_com_m[k] = from.payload_com_m[k];
  }
  fw::Scalar norm = fw::Scalar(0);
  for (std::size_t k = 0; k < 4; ++k) {
    to.tool_wxyz[k] = from.tool_wxyz[k];
    norm += scalar(from.tool_wxyz[k]) * scalar(from.tool_wxyz[k]);
  }
  to.payload_kg = from.payload_kg;
  to.reference_temperature_c = from.reference_temperature_c;
  return norm > fw::Scalar(0.998F) && norm < fw::Scalar(1.002F);
}

bool is_above_zero(fw::Scalar v) { return flexcomp::is_finite(v) && v > fw::Scalar(0); }

bool has_bounded_motion(const flexcomp_settings& s) {
  for (const fw::Scalar rate : s.correction_rate_rad_s) {
    if (!is_above_zero(rate)) return false;
  }
  return s.cycle_us != 0 && is_above_zero(s.offset_rate_rad_s) && is_above_zero(s.offset_acceleration_rad_s2);
}

namespace step_flag = flexcomp::step_flag;
static_assert(FLEXCOMP_FLAG_REFUSED == step_flag::refused && FLEXCOMP_FLAG_NO_SET == step_flag::no_set &&
                  FLEXCOMP_FLAG_AT_LIMIT == step_flag::at_limit &&
                  FLEXCOMP_FLAG_LIMITED == step_flag::limited &&
                  FLEXCOMP_FLAG_RATE_LIMITED == step_flag::rate_limited &&
                  FLEXCOMP_FLAG_SETTLING == step_flag::settling &&
                  FLEXCOMP_FLAG_NOT_CONVERGED == step_flag::not_converged &&
                  FLEXCOMP_FLAG_NEAR_SINGULAR == step_flag::near_singular,
              "one numbering of the flags");

}  // namespace

extern "C" {

void flexcomp_robot_default(flexcomp_robot* robot) {
  const fw::Robot nominal;
  *robot = flexcomp_robot();
  for (std::size_t j = 0; j < fw::joints; ++j) {
    robot->min_rad[j] = nominal.limits[j].min_rad;
    robot->max_rad[j] = nominal.limits[j].max_rad;
  }
  for (std::size_t k = 0; k < 3; ++k) robot->gravity_m_s2[k] = nominal.gravity_m_s2[k];
  for (std::size_t k = 0; k < 4; ++k) robot->tool_wxyz[k] = nominal.tool_wxyz[k];
  robot->reference_temperature_c = nominal.reference_temperature_c;
}

void flexcomp_settings_default(flexcomp_settings* settings) {
  const fw::DeviceSettings d;
  settings->largest_correction_rad = d.control.compensation.largest_correction_rad;
  settings->direction_band_rad = d.control.direction_band_rad;
  settings->plausible_position_m = d.store.plausible_position_m;
  settings->plausible_orientation_rad = d.store.plausible_orientation_rad;
  for (std::size_t j = 0; j < fw::joints; ++j)
    settings->correction_rate_rad_s[j] = d.control.motion.correction_rate_rad_s[j];
  settings->offset_rate_rad_s = d.control.motion.offset_rate_rad_s;
  settings->offset_acceleration_rad_s2 = d.control.motion.offset_acceleration_rad_s2;
  settings->trial_cycles = d.store.trial_cycles;
  settings->staging_timeout_ms = d.store.staging_timeout_ms;
  settings->cycle_us = d.control.motion.cycle_us;
  settings->on_refusal = FLEXCOMP_HOLD_LAST_OUTPUT;
  flexcomp_admission& a = settings->admission;
  const flexcomp::AdmissionLimits<fw::Scalar>& l = d.store.limits;
  const flexcomp::AdmissionRanges<fw::Scalar>& r = d.store.ranges;
  a = {l.value_rad,    l.slope,      l.scale,    l.direction_rad, l.compliance_rad_per_nm,
       l.rad_per_kg,   l.rad_per_n,  l.load_rad, l.rad_per_k,     l.total_slope,
       l.instructions, r.payload_kg, r.com_m,    r.force_n,       r.temperature_k};
}

flexcomp_arm* flexcomp_init(void* memory, size_t size, const flexcomp_robot* robot,
                            const flexcomp_settings* settings, const flexcomp_storage* storage) {
  fw::Robot nominal;
  if (!fits<Arm>(memory, size) || robot == nullptr || !take_robot(*robot, nominal)) return nullptr;
  flexcomp_settings s;
  flexcomp_settings_default(&s);
  if (settings != nullptr) s = *settings;
  if (!has_bounded_motion(s)) return nullptr;
  const flexcomp_storage none = flexcomp_storage();
  fw::DeviceSettings d;
  d.control.compensation.largest_correction_rad = s.largest_correction_rad;
  d.control.direction_band_rad = s.direction_band_rad;
  for (std::size_t j = 0; j < fw::joints; ++j)
    d.control.motion.correction_rate_rad_s[j] = s.correction_rate_rad_s[j];
  d.control.motion.offset_rate_rad_s = s.offset_rate_rad_s;
  d.control.motion.offset_acceleration_rad_s2 = s.offset_acceleration_rad_s2;
  d.control.motion.cycle_us = s.cycle_us;
  d.control.on_refusal =
      s.on_refusal == FLEXCOMP_PASS_THROUGH ? fw::OnRefusal::pass_through : fw::OnRefusal::hold;
  d.store.plausible_position_m = s.plausible_position_m;
  d.store.plausible_orientation_rad = s.plausible_orientation_rad;
  d.store.trial_cycles = s.trial_cycles;
  d.store.staging_timeout_ms = s.staging_timeout_ms;
  const flexcomp_admission& a = s.admission;
  d.store.limits = {a.value_rad,   a.slope,     a.scale,    a.direction_rad, a.compliance_rad_per_nm,
                    a.rad_per_kg,  a.rad_per_n, a.load_rad, a.rad_per_k,     a.total_slope,
                    a.instructions};
  d.store.ranges = {a.payload_kg, a.com_m, a.force_n, a.temperature_k};
  d.name = robot->name;
  return reinterpret_cast<flexcomp_arm*>(new (memory) Arm(nominal, storage != nullptr ? *storage : none, d));
}

unsigned flexcomp_boot(flexcomp_arm* fc) {
  fw::Store& store = arm_of(fc).device.store();
  store.boot();
  return store.faults();
}

void flexcomp_context_default(const flexcomp_arm* fc, flexcomp_context* context) {
  const fw::FirmwareContext& c = arm_of(fc).context;
  *context = flexcomp_context();
  context->payload_kg = c.payload_kg;
  for (std::size_t k = 0; k < 3; ++k) context->payload_com_m[k] = c.payload_com_m[k];
  context->temperature_c = c.temperature_c;
}

int flexcomp_start(flexcomp_arm* fc, const flexcomp_real q_standing_rad[FLEXCOMP_JOINTS]) {
  return arm_of(fc).device.start(*reinterpret_cast<const fw::Joints*>(q_standing_rad)) ? 1 : 0;
}

uint32_t flexcomp_step_flags(const flexcomp_arm* fc) {
  return arm_of(fc).device.cycle().publication().last_flags.load(std::memory_order_relaxed);
}

flexcomp_status flexcomp_step(flexcomp_arm* fc, const flexcomp_real q_command_rad[FLEXCOMP_JOINTS],
                              const flexcomp_context* context,
                              flexcomp_real q_corrected_rad[FLEXCOMP_JOINTS]) {
  Arm& arm = arm_of(fc);
  // A C array and a std::array have the same layout.
  static_assert(sizeof(fw::Joints) == sizeof(flexcomp_real[FLEXCOMP_JOINTS]), "nothing but the numbers");
  const fw::Joints& q = *reinterpret_cast<const fw::Joints*>(q_command_rad);
  fw::StepResult result;
  if (context == nullptr) {
    arm.device.step(q, arm.context, result);
  } else {
    fw::FirmwareContext c;
    c.payload_kg = context->payload_kg;
    for (std::size_t k = 0; k < 3; ++k) {
      c.payload_com_m[k] = context->payload_com_m[k];
      c.force_n[k] = context->force_n[k];
    }
    c.temperature_c = context->temperature_c;
    c.time_s = context->time_s;
    for (std::size_t j = 0; j < fw::joints; ++j) c.relative_speed[j] = context->relative_speed[j];
    arm.device.step(q, c, result);
  }
  FLEXCOMP_UNROLL
  for (std::size_t j = 0; j < fw::joints; ++j) q_corrected_rad[j] = result.q[j];
  return static_cast<flexcomp_status>(result.status);
}

void flexcomp_poll(flexcomp_arm* fc, uint32_t now_ms) { arm_of(fc).device.store().poll(now_ms); }

void flexcomp_get_state(const flexcomp_arm* fc, flexcomp_state* state) {
  const flexcomp::wire::Status s = arm_of(fc).device.status();
  state->active_sequence = s.active_sequence;
  state->previous_sequence = s.previous_sequence;
  state->active_bytes = s.active_bytes;
  state->trial_cycles_left = s.trial_cycles_left;
  state->cycles = s.cycles;
  state->detail = s.detail;
  state->store = s.state;
  state->answer = s.answer;
  state->refusal = s.refusal;
  state->faults = s.faults;
}

unsigned flexcomp_command(flexcomp_arm* fc, unsigned command) {
  const flexcomp::wire::Command c =
      command <= 0xFFFFU ? static_cast<flexcomp::wire::Command>(command) : flexcomp::wire::Command::none;
  return static_cast<unsigned>(arm_of(fc).device.store().run(c, 0, fw::nobody));
}

const char* flexcomp_status_text(flexcomp_status status) {
  return flexcomp::name(static_cast<flexcomp::StepStatus>(status));
}

const char* flexcomp_answer_text(unsigned answer) {
  return flexcomp::wire::text(static_cast<flexcomp::wire::Answer>(answer <= 0xFFFFU ? answer : 0xFFFFU));
}

const char* flexcomp_refusal_text(unsigned refusal) {
  return flexcomp::text(static_cast<flexcomp::Refusal>(refusal <= 0xFFU ? refusal : 0xFFU));
}

const char* flexcomp_version(void) { return fw::firmware_version_text; }

flexcomp_can* flexcomp_can_init(void* memory, size_t size, flexcomp_arm* fc, unsigned node,
                                uint16_t heartbeat_ms, flexcomp_can_send send, void* user) {
  if (!fits<Can>(memory, size) || fc == nullptr || node < 1 || node > 127 || send == nullptr) return nullptr;
  fw::CanopenSettings settings;
  settings.node = static_cast<std::uint8_t>(node);
  settings.heartbeat_ms = heartbeat_ms;
  return reinterpret_cast<flexcomp_can*>(new (memory) Can(arm_of(fc), settings, send, user));
}

void flexcomp_can_receive(flexcomp_can* can, uint16_t id, const uint8_t* bytes, size_t size) {
  can_of(can).node.receive(id, bytes, size);
}

void flexcomp_can_poll(flexcomp_can* can, uint32_t now_ms) { can_of(can).node.poll(now_ms); }

flexcomp_rtu* flexcomp_rtu_init(void* memory, size_t size, flexcomp_arm* fc, unsigned unit, uint32_t gap_us,
                                flexcomp_send send, void* user) {
  if (!fits<Rtu>(memory, size) || fc == nullptr || unit < 1 || unit > 247 || send == nullptr) return nullptr;
  return reinterpret_cast<flexcomp_rtu*>(
      new (memory) Rtu(arm_of(fc), static_cast<std::uint8_t>(unit), gap_us, send, user));
}

void flexcomp_rtu_receive(flexcomp_rtu* rtu, const uint8_t* bytes, size_t size, uint32_t now_us) {
  rtu_of(rtu).line.receive(bytes, size, now_us);
}

void flexcomp_rtu_poll(flexcomp_rtu* rtu, uint32_t now_us) { rtu_of(rtu).line.poll(now_us); }

flexcomp_tcp* flexcomp_tcp_init(void* memory, size_t size, flexcomp_arm* fc, unsigned unit,
                                flexcomp_send send, void* user) {
  if (!fits<Tcp>(memory, size) || fc == nullptr || unit > 255 || send == nullptr) return nullptr;
  return reinterpret_cast<flexcomp_tcp*>(new (memory)
                                             Tcp(arm_of(fc), static_cast<std::uint8_t>(unit), send, user));
}

int flexcomp_tcp_receive(flexcomp_tcp* tcp, const uint8_t* bytes, size_t size) {
  return tcp_of(tcp).stream.receive(bytes, size) ? 1 : 0;
}

void flexcomp_tcp_reset(flexcomp_tcp* tcp) {
  Tcp& t = tcp_of(tcp);
  t.server.disconnect();
  t.stream = fw::ModbusTcp(t.server, t.unit, t.transmit);
}

}  // extern "C"
