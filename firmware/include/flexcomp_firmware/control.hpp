// SPDX-License-Identifier: Apache-2.0
/// \file
/// The control cycle's step: joint command and context in, corrected joint command out.
#ifndef FLEXCOMP_FIRMWARE_CONTROL_HPP
#define FLEXCOMP_FIRMWARE_CONTROL_HPP

#include <array>
#include <atomic>
#include <cstdint>

#include "flexcomp/compensate.hpp"
#include "flexcomp/status.hpp"
#include "flexcomp_firmware/config.hpp"
#include "flexcomp_firmware/handover.hpp"

namespace flexcomp {
namespace firmware {

/// The two prepared sets and the word by which they change hands.
struct ParameterSets {
  std::array<FirmwareModel, 2> models{};
  Handover handover{};
};

/// What the step does with a command that it refuses (not finite, beyond a joint limit, or with a context
/// that is not finite).
enum class OnRefusal : std::uint8_t {
  pass_through = 0,          ///< the correction fades out to zero
  hold_last_correction = 1,  ///< the last correction is kept on top of the command
};

struct ControlSettings {
  CompensationSettings<Scalar> compensation{};
  /// Cycles over which the correction moves from the old set's to the new one's; 0: at once.
  std::uint32_t fade_cycles = 1000;
  /// Motion against the last direction after which a joint's direction counts as reversed, rad. Within the
  /// band the direction moves linearly from -1 to +1, so that a reversal never makes the command step.
  Scalar direction_band_rad = Scalar(1e-4);
  OnRefusal on_refusal = OnRefusal::pass_through;
};

using StepResult = Compensated<Scalar, joints>;

/// What the cycle tells the background: single words, each written by the cycle alone.
struct ControlPublication {
  std::atomic<std::uint32_t> cycles{0};
  std::array<std::atomic<std::uint32_t>, 6> cycles_by_status{};
  std::atomic<std::uint32_t> last_status{0};
  std::array<std::atomic<std::uint32_t>, joints> correction_rad{};  ///< binary32 bits
  std::atomic<std::uint32_t> largest_correction_rad{0};  ///< binary32 bits, of any joint since the start
};

/// State and step of the control cycle. One thread or interrupt calls step(); nothing here is shared but the
/// handover and the publication.
class ControlCycle {
 public:
  /// Limits of the joints are the robot's. Settings that are not sensible (a negative or non-finite band or
  /// largest correction) are replaced by 0: no correction rather than a wild one.
  ControlCycle(const Robot& robot, ParameterSets& sets, const ControlSettings& settings);

  /// One control cycle. The step tracks the directions from the commands and takes no notice of
  /// `context.direction` (which must be finite all the same).
  ///
  /// A set is taken at the start and used to the end. When the set changes, the difference between the
  /// correction of the cycle before and the new set's is kept and decays to zero over fade_cycles, as v^2 (3
  /// - 2 v) with v from 1 to 0. So a change of set moves the command by at most 1.5 / fade_cycles of that
  /// difference per cycle, and no cycle evaluates two sets. The same holds where the status changes between
  /// corrected and passed through.
  ///
  /// A command that is not finite is returned as it came (or with the last correction on its finite joints),
  /// and leaves directions, correction and fade as they were. Bounded work on any input.
  void step(const Joints& q_command_rad, const FirmwareContext& context, StepResult& out);

  const ControlPublication& publication() const { return publication_; }
  const ControlSettings& settings() const { return settings_; }
  /// Direction of a joint as tracked, -1 … 1; 0 until it has moved.
  Scalar direction(std::size_t joint) const { return direction_[joint]; }

 private:
  enum class Source : std::uint8_t { pass, set, hold };

  void track(const Joints& q);
  void correct(const FirmwareModel& model, const Joints& q_command_rad, const FirmwareContext& context,
               StepResult& out) const;
  Scalar within_limits(std::size_t joint, Scalar q_command, Scalar q) const;
  void publish(StepStatus status);

  ParameterSets& sets_;
  ControlSettings settings_;
  Joints lower_{};
  Joints upper_{};
  Scalar fade_step_ = Scalar(0);
  Scalar band_inverse_ = Scalar(0);
  Joints direction_{};
  Joints last_command_{};
  Joints correction_{};   ///< of the last cycle, rad
  Joints fade_offset_{};  ///< difference that decays, rad
  std::uint32_t fade_left_ = 0;
  Source source_ = Source::pass;
  bool tracking_ = false;
  Scalar largest_ = Scalar(0);
  ControlPublication publication_{};
};

}  // namespace firmware
}  // namespace flexcomp

#endif
