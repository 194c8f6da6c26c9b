// SPDX-License-Identifier: Apache-2.0
#include "flexcomp_firmware/control.hpp"

#include <cmath>

#include "flexcomp/bounds.hpp"
#include "flexcomp/bytes.hpp"
#include "flexcomp_firmware/arithmetic.hpp"

namespace flexcomp {
namespace firmware {

namespace {

void count(std::atomic<std::uint32_t>& n) {
  // One writer, so a load and a store are enough; no read-modify-write that some cores would have to retry.
  n.store(n.load(std::memory_order_relaxed) + 1U, std::memory_order_relaxed);
}

Scalar sensible(Scalar v) { return is_finite(v) && v > Scalar(0) ? v : Scalar(0); }

FLEXCOMP_RARE ControlSettings sensible(ControlSettings s) {
  s.compensation.largest_correction_rad = sensible(s.compensation.largest_correction_rad);
  s.direction_band_rad = sensible(s.direction_band_rad);
  return s;
}

// No wider than sines and cosines reach, as in the model: a command beyond that is refused.
FLEXCOMP_RARE Joints limits_of(const Robot& robot, bool upper) {
  Joints limits;
  for (std::size_t j = 0; j < joints; ++j) {
    limits[j] = from_binary64<Scalar>(upper ? robot.limits[j].max_rad : robot.limits[j].min_rad);
    clamp_to(limits[j], -LargestAngle<Scalar>::value(), LargestAngle<Scalar>::value());
  }
  return limits;
}

// Where one of these comes or goes, the wanted correction may jump.
constexpr std::uint16_t event_flags =
    step_flag::refused | step_flag::no_set | step_flag::at_limit | step_flag::limited;

}  // namespace

ControlCycle::ControlCycle(const Robot& robot, ParameterSets& sets, const ControlSettings& settings)
    : sets_(sets),
      settings_(sensible(settings)),
      lower_(limits_of(robot, false)),
      upper_(limits_of(robot, true)),
      output_(lower_, upper_, settings_.compensation.largest_correction_rad, settings_.motion) {
  if (settings_.direction_band_rad > Scalar(0)) band_inverse_ = Scalar(2) / settings_.direction_band_rad;
}

// Direction of a joint by the stop operator of hysteresis (C18): it moves with the command between -1 and +1
// and stays at the end that it has reached.
void ControlCycle::track(const Joints& q) {
  if (!tracking_) {
    last_command_ = q;
    tracking_ = true;
    return;
  }
  if (settings_.direction_band_rad > Scalar(0)) {
    const Scalar per_rad = band_inverse_;
    for (std::size_t j = 0; j < joints; ++j) {
      const Scalar command = q[j];
      Scalar d = direction_[j] + (command - last_command_[j]) * per_rad;
      if (d > Scalar(1)) {
        d = Scalar(1);
      } else if (d < Scalar(-1)) {
        d = Scalar(-1);
      }
      direction_[j] = d;
      last_command_[j] = command;
    }
    return;
  }
  for (std::size_t j = 0; j < joints; ++j) {
    const Scalar move = q[j] - last_command_[j];
    if (move > Scalar(0)) direction_[j] = Scalar(1);
    if (move < Scalar(0)) direction_[j] = Scalar(-1);
    last_command_[j] = q[j];
  }
}

FLEXCOMP_RARE bool ControlCycle::is_within_limits(const Joints& q) const {
  for (std::size_t j = 0; j < joints; ++j) {
    if (!(q[j] >= lower_[j] && q[j] <= upper_[j])) return false;
  }
  return true;
}

// True where the context has changed since the last cycle by more than what may go through directly: as much
// as the offset's acceleration allows. So the noise of a force sensor is followed without delay, and no load
// makes a jump.
bool ControlCycle::context_jumped(const FirmwareContext& context) {
  Scalar force = Scalar(0);
  Scalar com = Scalar(0);
  FLEXCOMP_UNROLL
  for (std::size_t k = 0; k < 3; ++k) {
    force += std::fabs(context.force_n[k] - last_force_[k]);
    com += std::fabs(context.payload_com_m[k] - last_com_[k]);
    last_force_[k] = context.force_n[k];
    last_com_[k] = context.payload_com_m[k];
  }
  Scalar motion = Scalar(0);
  if (certificate_ != nullptr) {
    motion = force * certificate_->rad_per_n + com * certificate_->rad_per_m +
             std::fabs(context.payload_kg - last_payload_) * certificate_->rad_per_kg +
             std::fabs(context.temperature_c - last_temperature_) * certificate_->rad_per_k;
  }
  last_payload_ = context.payload_kg;
  last_temperature_ = context.temperature_c;
  return !(motion <= output_.motion_change_most());
}

void ControlCycle::publish(const StepResult& out, const FirmwareModel* model) {
  count(publication_.cycles);
  count(publication_.cycles_by_status[static_cast<std::size_t>(out.status)]);
  publication_.last_status.store(static_cast<std::uint32_t>(out.status), std::memory_order_relaxed);
  publication_.last_flags.store(out.flags, std::memory_order_relaxed);
  Scalar largest = largest_;
  for (std::size_t j = 0; j < joints; ++j) {
    const Scalar c = output_.correction()[j];
    publication_.correction_rad[j].store(bits32_of(static_cast<float>(c)), std::memory_order_relaxed);
    const Scalar magnitude = std::fabs(c);
    if (magnitude > largest) largest = magnitude;
  }
  largest_ = largest;
  // Not in a function of its own: GCC 12.2 drops a call to one that makes nothing but atomic stores.
  if (model != nullptr && model->reads_direction()) {
    for (std::size_t j = 0; j < joints; ++j)
      publication_.direction[j].store(bits32_of(static_cast<float>(direction_[j])),
                                      std::memory_order_relaxed);
  }
  publication_.largest_correction_rad.store(bits32_of(static_cast<float>(largest_)),
                                            std::memory_order_relaxed);
}

ControlCycle::Input ControlCycle::begin(const Joints& q_command_rad) {
  bool changed = false;
  const std::uint32_t index = sets_.handover.take(changed);
  if (changed) {
    is_new_set_ = true;  // an event of the next command that is used
    certificate_ = index != Handover::none ? &sets_.certificates[index] : nullptr;
  }
  FiniteCheck<Scalar> command;
  command.add(q_command_rad);
  const bool is_finite_command = command.passed();
  if (is_finite_command) track(q_command_rad);
  return {index != Handover::none ? &sets_.models[index] : nullptr, is_finite_command};
}

// What comes behind the set's answer in `out`; true at an event.
bool ControlCycle::finish(const Input& input, const Joints& q_command_rad, const FirmwareContext& context,
                          StepResult& out) {
  const bool has_set = input.model != nullptr;
  if (!input.is_finite || !has_set) {
    out.q = q_command_rad;
    out.remaining_position_m = out.remaining_orientation_rad = Scalar(0);
    out.flags = has_set ? std::uint16_t{0} : step_flag::no_set;
    if (!input.is_finite || !is_within_limits(q_command_rad)) out.flags |= step_flag::refused;
  }

  bool jumped = false;
  bool is_used = true;
  if ((out.flags & step_flag::refused) != 0) {
    is_used = settings_.on_refusal == OnRefusal::pass_through && is_within_limits(q_command_rad);
  } else if (has_set) {
    jumped = context_jumped(context);
  }
  bool event = false;
  if (is_used) {
    const std::uint16_t cause = out.flags & event_flags;
    event = jumped || is_new_set_ || cause != last_cause_;
    last_cause_ = cause;
    is_new_set_ = false;
    const Joints wanted = out.q;
    const std::uint16_t held = output_.follow(q_command_rad, event, out.q);
    if (held != 0) {
      // What is missing to the wanted command turns the tool by as much at most, and moves it by as much at the reach.
      Scalar missing = Scalar(0);
      for (std::size_t j = 0; j < joints; ++j) missing += std::fabs(out.q[j] - wanted[j]);
      out.remaining_orientation_rad += missing;
      if (certificate_ != nullptr) missing *= certificate_->reach_m;
      out.remaining_position_m += missing;
    }
    out.flags |= held;
  } else {
    output_.hold(q_command_rad, out.q);
  }
  remaining_position_ = out.remaining_position_m;
  remaining_orientation_ = out.remaining_orientation_rad;
  out.status = summary(out.flags);
  publish(out, input.model);
  return event;
}

void ControlCycle::step(const Joints& q_command_rad, const FirmwareContext& context, StepResult& out) {
  const Input input = begin(q_command_rad);
  if (input.is_finite && input.model != nullptr) {
    if (input.model->reads_direction()) {
      FirmwareContext tracked = context;
      tracked.direction = direction_;
      corrected_command(*input.model, q_command_rad, tracked, settings_.compensation, out);
    } else {
      corrected_command(*input.model, q_command_rad, context, settings_.compensation, out);
    }
  }
  finish(input, q_command_rad, context, out);
}

void ControlCycle::step_rate(const Joints& q_command_rad, const Joints& q_rate_command_rad_s,
                             const FirmwareContext& context, StepResult& out, Joints& q_rate_rad_s) {
  const Joints direction_before = direction_;
  const Joints correction_before = output_.correction();
  const bool stood = output_.is_standing();
  const Input input = begin(q_command_rad);
  FiniteCheck<Scalar> check;
  check.add(q_rate_command_rad_s);
  Joints command_rate{};
  if (check.passed()) command_rate = q_rate_command_rad_s;
  q_rate_rad_s = command_rate;
  bool is_derivative = true;
  if (input.is_finite && input.model != nullptr) {
    FirmwareContext tracked = context;
    if (input.model->reads_direction()) {
      tracked.direction = direction_;
      // While a direction turns, the correction moves by more than the derivative at fixed directions.
      is_derivative = direction_ == direction_before;
    }
    if (!corrected_rate(*input.model, q_command_rad, command_rate, tracked, settings_.compensation, out,
                        q_rate_rad_s)) {
      is_derivative = false;
    }
  } else {
    is_derivative = false;
  }
  const bool event = finish(input, q_command_rad, context, out);

  const std::uint32_t cycle_us = settings_.motion.cycle_us;
  const Scalar per_cycle = Scalar(1e6F) / static_cast<Scalar>(cycle_us != 0 ? cycle_us : 1U);
  constexpr std::uint16_t other = static_cast<std::uint16_t>(~step_flag::settling);
  is_derivative = is_derivative && !event && (out.flags & other) == 0;
  const bool stands = stood || output_.is_standing();
  const bool is_refused = (out.flags & step_flag::refused) != 0 && settings_.on_refusal == OnRefusal::hold;
  FiniteCheck<Scalar> result;
  for (std::size_t j = 0; j < joints; ++j) {
    Scalar rate = Scalar(0);
    if (is_derivative) {
      rate = q_rate_rad_s[j];
      if ((out.flags & step_flag::settling) != 0) rate += output_.offset_motion()[j] * per_cycle;
    } else {
      rate = command_rate[j] + (output_.correction()[j] - correction_before[j]) * per_cycle;
    }
    if (stands || is_refused) rate = Scalar(0);
    q_rate_rad_s[j] = rate;
    result.add(rate);
  }
  if (!result.passed()) q_rate_rad_s = {};
}

const FirmwareModel* ControlCycle::current(FirmwareContext& context) const {
  const std::uint32_t index = sets_.handover.readable();
  if (index == Handover::none) return nullptr;
  for (std::size_t j = 0; j < joints; ++j) {
    context.direction[j] =
        static_cast<Scalar>(float_of(publication_.direction[j].load(std::memory_order_relaxed)));
  }
  return &sets_.models[index];
}

}  // namespace firmware
}  // namespace flexcomp
