// SPDX-License-Identifier: Apache-2.0
/// \file
/// Output stage of the control step (docs/compensation.md, section 8): from the wanted command to one that a
/// drive can follow. It knows neither sets nor a model.
#ifndef FLEXCOMP_FIRMWARE_OUTPUT_STAGE_HPP
#define FLEXCOMP_FIRMWARE_OUTPUT_STAGE_HPP

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "flexcomp/bounds.hpp"
#include "flexcomp/detail/compiler.hpp"
#include "flexcomp/status.hpp"

namespace flexcomp {
namespace firmware {

/// An array of one value.
template <class S, std::size_t N>
constexpr std::array<S, N> all_equal(S value) {
  std::array<S, N> out{};
  for (std::size_t j = 0; j < N; ++j) out[j] = value;
  return out;
}

/// Bounds of the motion that a correction adds to a command (C19, C20).
template <class S, std::size_t N = 6>
struct MotionBounds {
  /// Rate of each joint's correction, rad/s. Ordinary programs stay below 0.6 away from singularities.
  std::array<S, N> correction_rate_rad_s = all_equal<S, N>(S(2));
  S offset_rate_rad_s = S(0.5);          ///< of the offset that an event leaves
  S offset_acceleration_rad_s2 = S(20);  ///< of the same
  std::uint32_t cycle_us = 1000;         ///< period of the control cycle, at least 1
};

/// Adds to every command q_c the correction c that follows the wanted one within bounds of motion. An event
/// (a new set, a jump of the load) leaves an offset, which returns to exactly 0 (C19); otherwise c is the
/// wanted correction itself, or follows it at the greatest rate (C20). No joint leaves its limits, no
/// correction grows beyond the largest one, and nothing that is not finite is put out. Bounded work.
template <class S, std::size_t N = 6>
class OutputStage {
 public:
  using Angles = std::array<S, N>;  ///< rad

  /// Bounds that are not finite or not above 0 are replaced by the defaults, a cycle of 0 by 1 us. The limits
  /// are finite, lower <= upper; largest_correction_rad is at least 0.
  FLEXCOMP_RARE OutputStage(const Angles& lower_rad, const Angles& upper_rad, S largest_correction_rad,
                            const MotionBounds<S, N>& bounds)
      : lower_(lower_rad), upper_(upper_rad), largest_(largest_correction_rad) {
    const MotionBounds<S, N> usual;
    const S cycle = static_cast<S>(bounds.cycle_us != 0 ? bounds.cycle_us : 1U) * S(1e-6);
    for (std::size_t j = 0; j < N; ++j) {
      rate_[j] = sensible(bounds.correction_rate_rad_s[j], usual.correction_rate_rad_s[j]) * cycle;
      output_[j] = S(0);
      clamp_to(output_[j], lower_[j], upper_[j]);
    }
    velocity_most_ = sensible(bounds.offset_rate_rad_s, usual.offset_rate_rad_s) * cycle;
    acceleration_ =
        sensible(bounds.offset_acceleration_rad_s2, usual.offset_acceleration_rad_s2) * cycle * cycle;
    deceleration_ = acceleration_ * S(0.9375);
    at_once_ = velocity_most_ < acceleration_ ? velocity_most_ : acceleration_;
    braking_ = (velocity_most_ / deceleration_ + S(2)) * velocity_most_;
  }

  /// Where the arm stands, rad: held until a command lies within the largest correction of it; false where a
  /// number is not finite or beyond a limit, which changes nothing.
  bool start(const Angles& q_standing_rad) {
    for (std::size_t j = 0; j < N; ++j) {
      if (!(q_standing_rad[j] >= lower_[j] && q_standing_rad[j] <= upper_[j])) return false;
    }
    output_ = q_standing_rad;
    state_ = State::standing;
    return true;
  }

  /// One cycle with a command that is within the joint limits. `q_rad` holds the wanted position, within the
  /// joint limits as well and no farther from the command than the largest correction, and becomes the
  /// output. `event`: the wanted correction may have jumped. Returns what holds the output back, bits of
  /// step_flag.
  ///
  /// After hold() or start() the first output is the one that stands, to the last bit. After start() a
  /// command that is farther from it than the largest correction is refused.
  std::uint16_t follow(const Angles& q_command_rad, bool event, Angles& q_rad) {
    if (state_ == State::following && !event && !settling_) {
      Angles wanted;
      bool fast = false;
      FLEXCOMP_UNROLL
      for (std::size_t j = 0; j < N; ++j) {
        wanted[j] = q_rad[j] - q_command_rad[j];
        const S step = wanted[j] - correction_[j];
        if (std::fabs(step) > rate_[j]) fast = true;
      }
      if (!fast) {
        FLEXCOMP_UNROLL
        for (std::size_t j = 0; j < N; ++j) {
          correction_[j] = wanted[j];
          output_[j] = q_rad[j];
        }
        return 0;
      }
    }
    return follow_bounded(q_command_rad, event, q_rad);
  }

  /// One cycle with a command that is not used: the last output again. Before the first command that was
  /// used: the command's finite joints as they are, and where there has been none 0, within the joint limits.
  FLEXCOMP_RARE void hold(const Angles& q_command_rad, Angles& q_rad) {
    if (state_ == State::idle) {
      for (std::size_t j = 0; j < N; ++j) {
        if (is_finite(q_command_rad[j])) output_[j] = q_command_rad[j];
      }
    } else if (state_ == State::following) {
      state_ = State::holding;
    }
    q_rad = output_;
  }

  /// True where the output stands: after start() until a command comes near, and after hold().
  bool is_standing() const { return state_ == State::standing || state_ == State::holding; }
  /// The correction that was put out for the last command that was used, rad.
  const Angles& correction() const { return correction_; }
  /// The offset of (C19), rad; exactly 0 where no event is settling.
  const Angles& offset() const { return offset_; }
  /// The offset's motion in the last cycle, rad.
  const Angles& offset_motion() const { return motion_; }
  /// Bound of that motion, rad per cycle.
  S motion_most() const { return velocity_most_; }
  /// Bound of its change, rad per cycle and cycle. What moves no joint by more is no event.
  S motion_change_most() const { return acceleration_; }
  /// Bound of the change of a joint's correction, rad per cycle.
  S correction_change_most(std::size_t joint) const { return rate_[joint]; }
  /// Control cycles within which an offset of twice the largest correction has returned.
  std::uint32_t settling_cycles() const {
    const S cycles = S(2) * largest_ / velocity_most_ + S(4) * velocity_most_ / deceleration_ + S(8);
    return cycles < S(1e9) ? static_cast<std::uint32_t>(cycles) : 1000000000U;
  }

 private:
  FLEXCOMP_RARE static S sensible(S v, S otherwise) { return is_finite(v) && v > S(0) ? v : otherwise; }

  enum class State : std::uint8_t {
    idle,      ///< no command has been used
    standing,  ///< at output_, until a command comes near
    holding,   ///< at output_, until a command is used
    following
  };

  FLEXCOMP_RARE std::uint16_t follow_bounded(const Angles& q_command_rad, bool event, Angles& q_rad) {
    std::uint16_t flags = 0;
    const bool resumed = state_ != State::following;
    if (resumed && !resume(q_command_rad, q_rad)) return step_flag::refused;
    if (event || resumed) {
      for (std::size_t j = 0; j < N; ++j) offset_[j] = correction_[j] - (q_rad[j] - q_command_rad[j]);
      settling_ = true;
    }
    if (resumed) {
      // The arm stands: nothing moves in this cycle.
      settling_ = greatest_of(offset_) > S(0);
      q_rad = output_;
      return settling_ ? step_flag::settling : std::uint16_t{0};
    }
    if (settling_ && advance_offset()) flags = step_flag::settling;
    Angles from;
    Angles step;
    S share = S(1);
    for (std::size_t j = 0; j < N; ++j) {
      const S q_command = q_command_rad[j];
      // The last correction, and the target; both within the joint limits, which come before the rate.
      S start = q_command + correction_[j];
      if (clamp_to(start, lower_[j], upper_[j])) flags |= step_flag::at_limit;
      // Only after a hold may a correction be larger than the largest one: then it does not grow.
      S target = q_rad[j] + offset_[j];
      S reach = std::fabs(start - q_command);
      if (reach < largest_) reach = largest_;
      if (clamp_to(target, q_command - reach, q_command + reach)) flags |= step_flag::limited;
      if (clamp_to(target, lower_[j], upper_[j])) flags |= step_flag::at_limit;
      const S way = target - start;
      if (std::fabs(way) > share * rate_[j] && std::fabs(way) * share > rate_[j])
        share = rate_[j] / std::fabs(way);
      from[j] = start;
      step[j] = way;
      q_rad[j] = target;
    }
    if (share < S(1)) {
      flags |= step_flag::rate_limited;
      for (std::size_t j = 0; j < N; ++j) {
        q_rad[j] = from[j] + share * step[j];
        clamp_to(q_rad[j], lower_[j], upper_[j]);
      }
    }
    for (std::size_t j = 0; j < N; ++j) {
      output_[j] = q_rad[j];
      correction_[j] = q_rad[j] - q_command_rad[j];
    }
    return flags;
  }

  /// Takes up the first command, or the first one after start() or hold(): the correction is what is missing
  /// to the output that stands. False after start() where that is more than the largest correction.
  bool resume(const Angles& q_command_rad, Angles& q_rad) {
    if (state_ == State::idle) {
      output_ = q_command_rad;
      correction_ = {};
    } else {
      Angles missing;
      for (std::size_t j = 0; j < N; ++j) missing[j] = output_[j] - q_command_rad[j];
      if (state_ == State::standing && !(greatest_of(missing) <= largest_)) {
        q_rad = output_;
        return false;
      }
      correction_ = missing;
    }
    motion_ = {};
    state_ = State::following;
    return true;
  }

  /// One cycle of the offset's return (C19); true where it is not 0 yet.
  bool advance_offset() {
    const S distance = greatest_of(offset_);
    S toward = S(1);  // wanted motion, as a share of the offset
    if (distance > at_once_) {
      S speed = velocity_most_;
      if (distance < braking_) {
        // The most of which the offset comes to 0 in n cycles, each slower by the deceleration.
        using std::sqrt;
        const S unit = distance / deceleration_;
        const S n = static_cast<S>(static_cast<std::int32_t>(sqrt(S(0.25) + S(2) * unit) + S(0.5)));
        const S most = (unit / n + S(0.5) * (n - S(1))) * deceleration_;
        if (most < speed) speed = most;
      }
      toward = speed / distance;
    }
    Angles change;
    for (std::size_t j = 0; j < N; ++j) change[j] = -toward * offset_[j] - motion_[j];
    const bool follows = !scale_to_limit(change, acceleration_);
    bool left = false;
    for (std::size_t j = 0; j < N; ++j) {
      motion_[j] = follows ? -toward * offset_[j] : motion_[j] + change[j];
      offset_[j] += motion_[j];
      if (offset_[j] < S(0) || offset_[j] > S(0)) left = true;
    }
    // An offset of 0 whose motion has not ended is brought to rest by the next cycle.
    settling_ = left || greatest_of(motion_) > S(0);
    return left;
  }

  Angles lower_;
  Angles upper_;
  Angles rate_{};
  Angles correction_{};
  Angles output_{};
  Angles offset_{};
  Angles motion_{};
  S largest_;
  S velocity_most_;
  S acceleration_;
  S deceleration_;
  S at_once_;
  S braking_;
  State state_ = State::idle;
  bool settling_ = false;
};

}  // namespace firmware
}  // namespace flexcomp

#endif
