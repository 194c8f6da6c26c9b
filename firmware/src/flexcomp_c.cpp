// SPDX-License-Identifier: Apache-2.0
// The C interface: builds every object in the caller's memory and forwards the calls.
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <new>

#include "flexcomp.h"
#include "flexcomp_firmware/arithmetic.hpp"
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

  static fw::Permit permit(void* user, flexcomp::wire::Command command, fw::Origin origin) {
    const flexcomp_hooks& h = static_cast<Arm*>(user)->asked;
    const unsigned answer =
        h.permit(h.user, static_cast<unsigned>(command), origin <= local_staging ? 1U : 0U);
    if (answer == FLEXCOMP_REFUSE) return fw::Permit::refuse;
    return answer == FLEXCOMP_AUTHORISE ? fw::Permit::authorise : fw::Permit::allow;
  }
  static int check(void* user, const std::uint8_t* key, const std::uint8_t* signature,
                   const std::uint8_t* message, std::uint32_t size) {
    const flexcomp_trust& t = static_cast<Arm*>(user)->trust;
    return t.check(t.user, key, signature, message, size);
  }
  static void log(void* user, fw::Event event, std::uint32_t detail) {
    const flexcomp_hooks& h = static_cast<Arm*>(user)->asked;
    h.log(h.user, static_cast<unsigned>(event), detail);
  }

  /// A number that no other CAN node of this arm has.
  fw::Origin next_origin() { return ++origins; }

  /// Who stages by flexcomp_stage_begin().
  static constexpr fw::Origin local_staging = fw::nobody + 1;

  const flexcomp_storage hooks;
  flexcomp_hooks asked{};
  flexcomp_trust trust{};
  fw::Device device;
  const fw::FirmwareContext context;
  fw::Origin origins = local_staging;
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

/// Client that a Modbus object is to the store: by its memory, so that another init there ends what the object before
/// it staged. Above all numbers of Arm::next_origin().
fw::Origin origin_of(const void* memory) {
  return static_cast<fw::Origin>(reinterpret_cast<std::uintptr_t>(memory) / 8) | 0x80000000U;
}

struct Rtu {
  Rtu(Arm& arm, std::uint8_t unit, std::uint32_t gap_us, flexcomp_send send, void* user)
      : server(arm.device, origin_of(this)), line(server, unit, gap_us, {user, send}) {
    server.disconnect();
  }
  fw::ModbusServer server;
  fw::ModbusRtu line;
};

struct Tcp {
  Tcp(Arm& arm, std::uint8_t c_unit, flexcomp_send send, void* user)
      : unit(c_unit),
        transmit{user, send},
        server(arm.device, origin_of(this)),
        stream(server, unit, transmit) {
    server.disconnect();
  }
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

bool are_finite(const fw::Scalar* values, std::size_t count) {
  for (std::size_t k = 0; k < count; ++k) {
    if (!flexcomp::is_finite(values[k])) return false;
  }
  return true;
}

/// True where all members between name and serial number, which are doubles, are finite.
bool all_finite(const flexcomp_robot& robot) {
  constexpr std::size_t first = offsetof(flexcomp_robot, links), end = offsetof(flexcomp_robot, serial);
  static_assert((end - first) % sizeof(double) == 0, "only doubles");
  const unsigned char* bytes = reinterpret_cast<const unsigned char*>(&robot) + first;
  for (std::size_t k = 0; k < (end - first) / sizeof(double); ++k) {
    double v;
    std::memcpy(&v, bytes + k * sizeof v, sizeof v);
    if (!flexcomp::is_finite(v)) return false;
  }
  return true;
}

flexcomp::Sha256Digest hash_of(const char* text) { return flexcomp::name_hash(text, std::strlen(text)); }

bool take_robot(const flexcomp_robot& from, fw::Robot& to) {
  if (from.name == nullptr || from.name[0] == 0 || !all_finite(from)) return false;
  to.name_hash = hash_of(from.name);
  if (from.serial != nullptr && from.serial[0] != 0) to.unit_hash = hash_of(from.serial);
  for (std::size_t j = 0; j < fw::joints; ++j) {
    const flexcomp_link& link = from.links[j];
    to.links[j] = {link.theta_rad, link.d_m, link.a_m, link.alpha_rad, link.beta_rad};
    to.limits[j] = {from.min_rad[j], from.max_rad[j]};
    const fw::Scalar low = scalar(from.min_rad[j]), high = scalar(from.max_rad[j]);
    const fw::Scalar most = flexcomp::LargestAngle<fw::Scalar>::value();
    if (!(low < high && -most <= low && high <= most)) return false;
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
  if (!(scalar(from.payload_kg) >= fw::Scalar(0))) return false;
  to.reference_temperature_c = from.reference_temperature_c;
  return norm > fw::Scalar(0.998F) && norm < fw::Scalar(1.002F);
}

/// Greatest slope near singularities up to which the law of damping (C9) was measured to keep what it promises.
constexpr fw::Scalar most_steepest = fw::Scalar(200);

bool is_above_zero(fw::Scalar v) { return flexcomp::is_finite(v) && v > fw::Scalar(0); }

bool is_sensible(const flexcomp_settings& s) {
  if (!is_above_zero(s.steepest) || s.steepest > most_steepest) return false;
  for (const fw::Scalar rate : s.correction_rate_rad_s) {
    if (!is_above_zero(rate)) return false;
  }
  // A C program may have put any number there, which no C++ enumeration may hold.
  std::uint32_t on_refusal = 0;
  static_assert(sizeof on_refusal >= sizeof s.on_refusal, "room for an enumeration of C");
  std::memcpy(&on_refusal, &s.on_refusal, sizeof s.on_refusal);
  const auto is_not_below_zero = [](fw::Scalar v) { return flexcomp::is_finite(v) && v >= fw::Scalar(0); };
  return s.cycle_us != 0 && is_above_zero(s.offset_rate_rad_s) &&
         is_above_zero(s.offset_acceleration_rad_s2) && is_not_below_zero(s.largest_correction_rad) &&
         is_not_below_zero(s.direction_band_rad) && is_above_zero(s.plausible_position_m) &&
         is_above_zero(s.plausible_orientation_rad) && s.plausible_orientation_rad < fw::Scalar(1.5707963F) &&
         (on_refusal == FLEXCOMP_PASS_THROUGH || on_refusal == FLEXCOMP_HOLD_LAST_OUTPUT);
}

fw::FirmwareContext context_from(const flexcomp_context& from) {
  fw::FirmwareContext c;
  c.payload_kg = from.payload_kg;
  for (std::size_t k = 0; k < 3; ++k) {
    c.payload_com_m[k] = from.payload_com_m[k];
    c.force_n[k] = from.force_n[k];
  }
  c.temperature_c = from.temperature_c;
  c.time_s = from.time_s;
  for (std::size_t j = 0; j < fw::joints; ++j) c.relative_speed[j] = from.relative_speed[j];
  return c;
}

// A C array and a std::array have the same layout.
static_assert(sizeof(fw::Joints) == sizeof(flexcomp_real[FLEXCOMP_JOINTS]), "nothing but the numbers");
const fw::Joints& joints_of(const flexcomp_real* q) { return *reinterpret_cast<const fw::Joints*>(q); }

/// What is computed at readings beside the step: the set in use and the context with the tracked directions. The model is
/// null where there is no set; `is_valid` is false where a number is not finite.
struct AtReadings {
  AtReadings(const Arm& arm, const flexcomp_real* readings, const flexcomp_context* from)
      : context(from != nullptr ? context_from(*from) : arm.context), q(joints_of(readings)) {
    model = arm.device.cycle().current(context);
    is_valid = flexcomp::detail::is_finite_context(context);
    for (const fw::Scalar reading : q) {
      const fw::Scalar most = flexcomp::LargestAngle<fw::Scalar>::value();
      if (!(reading <= most && -reading <= most)) is_valid = false;
    }
  }
  fw::FirmwareContext context;
  const fw::Joints q;
  const fw::FirmwareModel* model;
  bool is_valid;
};

/// Hamilton quaternion (w, x, y, z), w >= 0, of a rotation matrix: from its largest component (Shepperd).
template <class Matrix>
void quaternion_of(const Matrix& r, flexcomp_real* wxyz) {
  const fw::Scalar one = fw::Scalar(1);
  const fw::Scalar four_squares[4] = {one + r(0, 0) + r(1, 1) + r(2, 2), one + r(0, 0) - r(1, 1) - r(2, 2),
                                      one - r(0, 0) + r(1, 1) - r(2, 2), one - r(0, 0) - r(1, 1) + r(2, 2)};
  std::size_t k = 0;
  for (std::size_t i = 1; i < 4; ++i) {
    if (four_squares[i] > four_squares[k]) k = i;
  }
  const fw::Scalar x = r(2, 1) - r(1, 2), y = r(0, 2) - r(2, 0), z = r(1, 0) - r(0, 1);
  const fw::Scalar xy = r(1, 0) + r(0, 1), xz = r(0, 2) + r(2, 0), yz = r(2, 1) + r(1, 2);
  const fw::Scalar products[4][4] = {{four_squares[0], x, y, z},
                                     {x, four_squares[1], xy, xz},
                                     {y, xy, four_squares[2], yz},
                                     {z, xz, yz, four_squares[3]}};
  fw::Scalar scale = fw::Scalar(0.5F) / std::sqrt(four_squares[k]);
  if (products[k][0] < fw::Scalar(0)) scale = -scale;
  for (std::size_t i = 0; i < 4; ++i) wxyz[i] = products[k][i] * scale;
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
  settings->struct_size = sizeof *settings;
  settings->largest_correction_rad = d.control.compensation.largest_correction_rad;
  settings->steepest = d.control.compensation.steepest;
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
  a = {l.value_rad, l.slope,    l.scale,         l.direction_rad, l.compliance_rad_per_nm, l.rad_per_kg,
       l.rad_per_n, l.load_rad, l.rad_per_k,     l.total_slope,   l.instructions,          r.payload_kg,
       r.com_m,     r.force_n,  r.temperature_k, l.link_slope};
}

flexcomp_arm* flexcomp_init_checked(void* memory, size_t size, const flexcomp_robot* robot,
                                    const flexcomp_settings* settings, const flexcomp_storage* storage,
                                    unsigned* error, size_t real_bytes, size_t joints, size_t terms,
                                    size_t tables, size_t table_values, size_t staging_bytes,
                                    size_t struct_bytes) {
  unsigned nowhere;
  if (error == nullptr) error = &nowhere;
  const size_t library[] = {FLEXCOMP_BUILD_};
  const size_t program[] = {real_bytes, joints, terms, tables, table_values, staging_bytes, struct_bytes};
  *error = real_bytes != library[0]                             ? FLEXCOMP_INIT_OTHER_SCALAR
           : struct_bytes != library[6]                         ? FLEXCOMP_INIT_OTHER_STRUCTS
           : std::memcmp(library, program, sizeof library) != 0 ? FLEXCOMP_INIT_OTHER_CAPACITY
                                                                : FLEXCOMP_INIT_DONE;
  if (*error != FLEXCOMP_INIT_DONE) return nullptr;
  fw::Robot nominal;
  flexcomp_settings s;
  flexcomp_settings_default(&s);
  if (settings != nullptr && settings->struct_size == sizeof s) s = *settings;
  if (!fits<Arm>(memory, size)) {
    *error = FLEXCOMP_INIT_MEMORY;
  } else if (robot == nullptr || !take_robot(*robot, nominal)) {
    *error = FLEXCOMP_INIT_ROBOT;
  } else if ((settings != nullptr && settings->struct_size != sizeof s) || !is_sensible(s)) {
    *error = FLEXCOMP_INIT_SETTINGS;
  }
  if (*error != FLEXCOMP_INIT_DONE) return nullptr;
  const flexcomp_storage none = flexcomp_storage();
  fw::DeviceSettings d;
  d.control.compensation.largest_correction_rad = s.largest_correction_rad;
  d.control.compensation.steepest = s.steepest;
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
  d.store.limits = {a.value_rad,    a.slope,     a.scale,    a.direction_rad, a.compliance_rad_per_nm,
                    a.rad_per_kg,   a.rad_per_n, a.load_rad, a.rad_per_k,     a.total_slope,
                    a.instructions, a.link_slope};
  d.store.ranges = {a.payload_kg, a.com_m, a.force_n, a.temperature_k};
  d.name = robot->name;
  d.serial = robot->serial;
  return reinterpret_cast<flexcomp_arm*>(new (memory) Arm(nominal, storage != nullptr ? *storage : none, d));
}

const char* flexcomp_init_error_text(unsigned error) {
  switch (error) {
    case FLEXCOMP_INIT_DONE:
      return "done";
    case FLEXCOMP_INIT_MEMORY:
      return "the memory is missing, too small or not aligned to 8 bytes";
    case FLEXCOMP_INIT_ROBOT:
      return "the robot is not valid";
    case FLEXCOMP_INIT_SETTINGS:
      return "a setting is out of range, or the settings do not begin with flexcomp_settings_default";
    case FLEXCOMP_INIT_OTHER_SCALAR:
      return "the program is compiled with another FLEXCOMP_SCALAR than the library";
    case FLEXCOMP_INIT_OTHER_CAPACITY:
      return "the program is compiled with other capacities of flexcomp_config.h than the library";
    case FLEXCOMP_INIT_OTHER_STRUCTS:
      return "the program is compiled with another version of flexcomp.h, or another layout, than the "
             "library";
    default:
      return "unknown reason";
  }
}

void flexcomp_set_hooks(flexcomp_arm* fc, const flexcomp_hooks* hooks) {
  Arm& arm = arm_of(fc);
  arm.asked = hooks != nullptr ? *hooks : flexcomp_hooks();
  fw::DeviceHooks d;
  d.user = &arm;
  if (arm.asked.permit != nullptr) d.permit = Arm::permit;
  if (arm.asked.log != nullptr) d.log = Arm::log;
  arm.device.set_hooks(d);
}

int flexcomp_set_trust(flexcomp_arm* fc, const flexcomp_trust* trust) {
  Arm& arm = arm_of(fc);
  if (trust == nullptr || trust->check == nullptr || trust->keys == nullptr || trust->count == 0 ||
      trust->count > 0xFFFF || !flexcomp::is_given(arm.device.robot().unit_hash)) {
    return 0;
  }
  if (!arm.device.set_trust({&arm, trust->keys, static_cast<std::uint16_t>(trust->count), Arm::check}))
    return 0;
  arm.trust = *trust;
  return 1;
}

unsigned flexcomp_boot(flexcomp_arm* fc) {
  fw::Device& device = arm_of(fc).device;
  device.boot();
  return device.store().faults();
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
  const fw::Joints& q = joints_of(q_command_rad);
  fw::StepResult result;
  if (context == nullptr) {
    arm.device.step(q, arm.context, result);
  } else {
    arm.device.step(q, context_from(*context), result);
  }
  FLEXCOMP_UNROLL
  for (std::size_t j = 0; j < fw::joints; ++j) q_corrected_rad[j] = result.q[j];
  return static_cast<flexcomp_status>(result.status);
}

flexcomp_status flexcomp_step_rate(flexcomp_arm* fc, const flexcomp_real q_command_rad[FLEXCOMP_JOINTS],
                                   const flexcomp_real q_rate_command_rad_s[FLEXCOMP_JOINTS],
                                   const flexcomp_context* context,
                                   flexcomp_real q_corrected_rad[FLEXCOMP_JOINTS],
                                   flexcomp_real q_rate_corrected_rad_s[FLEXCOMP_JOINTS]) {
  Arm& arm = arm_of(fc);
  fw::StepResult result;
  fw::Joints rate;
  const fw::Joints& q = joints_of(q_command_rad);
  const fw::Joints& q_rate = joints_of(q_rate_command_rad_s);
  if (context == nullptr) {
    arm.device.step_rate(q, q_rate, arm.context, result, rate);
  } else {
    arm.device.step_rate(q, q_rate, context_from(*context), result, rate);
  }
  for (std::size_t j = 0; j < fw::joints; ++j) {
    q_corrected_rad[j] = result.q[j];
    q_rate_corrected_rad_s[j] = rate[j];
  }
  return static_cast<flexcomp_status>(result.status);
}

int flexcomp_get_diagnostics(const flexcomp_arm* fc, flexcomp_diagnostics* diagnostics) {
  if (diagnostics == nullptr || diagnostics->struct_size != sizeof *diagnostics) return 0;
  const fw::ControlCycle& cycle = arm_of(fc).device.cycle();
  const fw::ControlPublication& p = cycle.publication();
  diagnostics->cycles = p.cycles.load(std::memory_order_relaxed);
  for (std::size_t k = 0; k < 6; ++k)
    diagnostics->cycles_by_status[k] = p.cycles_by_status[k].load(std::memory_order_relaxed);
  diagnostics->status = static_cast<flexcomp_status>(p.last_status.load(std::memory_order_relaxed));
  diagnostics->flags = p.last_flags.load(std::memory_order_relaxed);
  diagnostics->remaining_position_m = cycle.remaining_position_m();
  diagnostics->remaining_orientation_rad = cycle.remaining_orientation_rad();
  for (std::size_t j = 0; j < fw::joints; ++j) {
    diagnostics->correction_rad[j] = cycle.output().correction()[j];
    diagnostics->offset_rad[j] = cycle.output().offset()[j];
    diagnostics->direction[j] = cycle.direction(j);
  }
  return 1;
}

int flexcomp_uncorrect(const flexcomp_arm* fc, const flexcomp_real q_reading_rad[FLEXCOMP_JOINTS],
                       const flexcomp_context* context, flexcomp_real q_command_rad[FLEXCOMP_JOINTS]) {
  const Arm& arm = arm_of(fc);
  const AtReadings at(arm, q_reading_rad, context);
  fw::Joints q = at.q;
  bool found = at.is_valid;
  if (at.is_valid && at.model != nullptr) {
    found = fw::nominal_command(*at.model, at.q, at.context, arm.device.cycle().settings().compensation, q);
  }
  for (std::size_t j = 0; j < fw::joints; ++j) q_command_rad[j] = q[j];
  return found ? 1 : 0;
}

int flexcomp_tool_pose(const flexcomp_arm* fc, const flexcomp_real q_reading_rad[FLEXCOMP_JOINTS],
                       const flexcomp_context* context, flexcomp_real xyz_m[3], flexcomp_real wxyz[4]) {
  const AtReadings at(arm_of(fc), q_reading_rad, context);
  if (!at.is_valid || at.model == nullptr) return 0;
  const flexcomp::Pose<fw::Scalar> pose = fw::tool_pose(*at.model, at.q, at.context);
  // Loads that are finite may move it by what is not.
  if (!are_finite(pose.position.data(), 3) || !are_finite(pose.rotation.data(), 9)) return 0;
  for (int k = 0; k < 3; ++k) xyz_m[k] = pose.position[k];
  quaternion_of(pose.rotation, wxyz);
  return 1;
}

int flexcomp_joint_loads(const flexcomp_arm* fc, const flexcomp_real q_reading_rad[FLEXCOMP_JOINTS],
                         const flexcomp_context* context, flexcomp_real torque_nm[FLEXCOMP_JOINTS],
                         flexcomp_real deflection_rad[FLEXCOMP_JOINTS]) {
  const AtReadings at(arm_of(fc), q_reading_rad, context);
  if (!at.is_valid || at.model == nullptr) return 0;
  const flexcomp::JointLoads<fw::Scalar, fw::joints> loads = fw::loads_of_joints(*at.model, at.q, at.context);
  if (!are_finite(loads.torque_nm.data(), fw::joints) || !are_finite(loads.deflection_rad.data(), fw::joints))
    return 0;
  for (std::size_t j = 0; j < fw::joints; ++j) {
    torque_nm[j] = loads.torque_nm[j];
    deflection_rad[j] = loads.deflection_rad[j];
  }
  return 1;
}

unsigned flexcomp_stage_begin(flexcomp_arm* fc, uint32_t bytes) {
  return static_cast<unsigned>(
      arm_of(fc).device.run(flexcomp::wire::Command::begin, bytes, Arm::local_staging));
}

unsigned flexcomp_stage_write(flexcomp_arm* fc, uint32_t offset, const uint8_t* bytes, uint32_t size) {
  if (bytes == nullptr) return static_cast<unsigned>(flexcomp::wire::Answer::bad_argument);
  return static_cast<unsigned>(arm_of(fc).device.store().write(offset, bytes, size, Arm::local_staging));
}

unsigned flexcomp_stage_verify(flexcomp_arm* fc) {
  return static_cast<unsigned>(arm_of(fc).device.run(flexcomp::wire::Command::verify, 0, Arm::local_staging));
}

unsigned flexcomp_stage_commit(flexcomp_arm* fc) {
  return static_cast<unsigned>(arm_of(fc).device.run(flexcomp::wire::Command::commit, 0, Arm::local_staging));
}

unsigned flexcomp_stage_commit_trial(flexcomp_arm* fc, uint32_t cycles) {
  return static_cast<unsigned>(
      arm_of(fc).device.run(flexcomp::wire::Command::commit_trial, cycles, Arm::local_staging));
}

unsigned flexcomp_stage_abort(flexcomp_arm* fc) {
  return static_cast<unsigned>(arm_of(fc).device.run(flexcomp::wire::Command::abort, 0, Arm::local_staging));
}

void flexcomp_poll(flexcomp_arm* fc, uint32_t now_ms) { arm_of(fc).device.poll(now_ms); }

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
  return static_cast<unsigned>(arm_of(fc).device.run(c, 0, fw::nobody));
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

void flexcomp_can_set_memory(flexcomp_can* can, flexcomp_can_load load, flexcomp_can_save save, void* user) {
  can_of(can).node.set_memory({user, load, save});
}

int flexcomp_can_set_channel(flexcomp_can* can, unsigned request_id, unsigned answer_id) {
  return can_of(can).node.set_channel(request_id, answer_id) ? 1 : 0;
}

unsigned flexcomp_can_channel(const flexcomp_can* can) {
  const std::uint32_t id = reinterpret_cast<const Can*>(can)->node.channel_request();
  return (id & flexcomp::wire::canopen::not_valid) == 0 ? id : 0U;
}

void flexcomp_can_set_block_size(flexcomp_can* can, unsigned frames) {
  can_of(can).node.set_block_size(static_cast<std::uint8_t>(frames < 63 ? frames : 63));
}

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

void flexcomp_rtu_line_error(flexcomp_rtu* rtu, int overrun) { rtu_of(rtu).line.line_error(overrun != 0); }

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
