// SPDX-License-Identifier: Apache-2.0
#include "flexcomp_firmware/control.hpp"

#include <cstring>

#include "flexcomp/bounds.hpp"
#include "flexcomp/bytes.hpp"
#include "flexcomp_firmware/arithmetic.hpp"

namespace flexcomp {
namespace firmware {

namespace {

std::uint32_t float_bits(float v) {
  std::uint32_t bits;
  std::memcpy(&bits, &v, sizeof bits);
  return bits;
}

void count(std::atomic<std::uint32_t>& n) {
  // One writer, so a load and a store are enough; no read-modify-write that some cores would have to retry.
  n.store(n.load(std::memory_order_relaxed) + 1U, std::memory_order_relaxed);
}

Scalar sensible(Scalar v) { return is_finite(v) && v > Scalar(0) ? v : Scalar(0); }

}  // namespace

ControlCycle::ControlCycle(const Robot& robot, ParameterSets& sets, const ControlSettings& settings)
    : sets_(sets), settings_(settings) {
  settings_.compensation.largest_correction_rad = sensible(settings.compensation.largest_correction_rad);
  settings_.direction_band_rad = sensible(settings.direction_band_rad);
  for (std::size_t j = 0; j < joints; ++j) {
    lower_[j] = from_binary64<Scalar>(robot.limits[j].min_rad);
    upper_[j] = from_binary64<Scalar>(robot.limits[j].max_rad);
  }
  if (settings_.fade_cycles != 0) fade_step_ = Scalar(1) / static_cast<Scalar>(settings_.fade_cycles);
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

// Joint limits of (C20): a fading or constant correction must not move a joint beyond a limit that the
// command respects.
Scalar ControlCycle::within_limits(std::size_t joint, Scalar q_command, Scalar q) const {
  const Scalar low = q_command < lower_[joint] ? q_command : lower_[joint];
  const Scalar high = q_command > upper_[joint] ? q_command : upper_[joint];
  clamp_to(q, low, high);
  return q;
}

void ControlCycle::publish(StepStatus status) {
  count(publication_.cycles);
  count(publication_.cycles_by_status[static_cast<std::size_t>(status)]);
  publication_.last_status.store(static_cast<std::uint32_t>(status), std::memory_order_relaxed);
  Scalar largest = largest_;
  for (std::size_t j = 0; j < joints; ++j) {
    const Scalar c = correction_[j];
    publication_.correction_rad[j].store(float_bits(static_cast<float>(c)), std::memory_order_relaxed);
    const Scalar magnitude = c < Scalar(0) ? -c : c;
    if (magnitude > largest) largest = magnitude;
  }
  largest_ = largest;
  publication_.largest_correction_rad.store(float_bits(static_cast<float>(largest_)),
                                            std::memory_order_relaxed);
}

void ControlCycle::correct(const FirmwareModel& model, const Joints& q_command_rad,
                           const FirmwareContext& context, StepResult& out) const {
  if (!model.reads_direction()) {
    corrected_command(model, q_command_rad, context, settings_.compensation, out);
    return;
  }
  FirmwareContext tracked = context;
  tracked.direction = direction_;
  corrected_command(model, q_command_rad, tracked, settings_.compensation, out);
}

void ControlCycle::step(const Joints& q_command_rad, const FirmwareContext& context, StepResult& out) {
  bool changed = false;
  const std::uint32_t index = sets_.handover.take(changed);
  FiniteCheck<Scalar> command;
  command.add(q_command_rad);
  if (!command.passed()) {
    out.q = q_command_rad;
    out.status = StepStatus::refused;
    if (changed) source_ = Source::hold;  // the change of set is faded in by the next command that is finite
    if (settings_.on_refusal == OnRefusal::hold_last_correction) {
      for (std::size_t j = 0; j < joints; ++j) {
        if (is_finite(out.q[j])) out.q[j] = within_limits(j, out.q[j], out.q[j] + correction_[j]);
      }
    }
    publish(out.status);
    return;
  }
  track(q_command_rad);
  if (index == Handover::none) {
    out.q = q_command_rad;
    out.status = StepStatus::no_set;
  } else {
    correct(sets_.models[index], q_command_rad, context, out);
  }
  Source source = Source::pass;
  if (out.status < StepStatus::no_set) {
    source = Source::set;
  } else if (out.status == StepStatus::refused && settings_.on_refusal == OnRefusal::hold_last_correction) {
    source = Source::hold;
  }

  if (source == Source::hold) {
    for (std::size_t j = 0; j < joints; ++j) {
      out.q[j] = within_limits(j, q_command_rad[j], q_command_rad[j] + correction_[j]);
    }
    fade_left_ = 0;
  } else {
    if (changed || source != source_) {
      for (std::size_t j = 0; j < joints; ++j)
        fade_offset_[j] = correction_[j] - (out.q[j] - q_command_rad[j]);
      fade_left_ = settings_.fade_cycles;
    }
    if (fade_left_ != 0) {
      const Scalar v = static_cast<Scalar>(fade_left_) * fade_step_;
      const Scalar weight = v * v * (Scalar(3) - Scalar(2) * v);
      for (std::size_t j = 0; j < joints; ++j) {
        // The offset adds to a correction that changes as the arm moves: the sum is limited again (C20).
        const Scalar largest = settings_.compensation.largest_correction_rad;
        const Scalar least = q_command_rad[j] - largest;
        const Scalar most = q_command_rad[j] + largest;
        Scalar q = out.q[j] + fade_offset_[j] * weight;
        if (clamp_to(q, least, most) && source == Source::set && out.status != StepStatus::at_limit)
          out.status = StepStatus::limited;
        out.q[j] = within_limits(j, q_command_rad[j], q);
        if (source == Source::set && (out.q[j] < q || out.q[j] > q)) out.status = StepStatus::at_limit;
      }
      --fade_left_;
    }
    FLEXCOMP_UNROLL
    for (std::size_t j = 0; j < joints; ++j) correction_[j] = out.q[j] - q_command_rad[j];
  }
  source_ = source;
  publish(out.status);
}

}  // namespace firmware
}  // namespace flexcomp
