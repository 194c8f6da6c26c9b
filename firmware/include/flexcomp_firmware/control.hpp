// SPDX-License-Identifier: Apache-2.0
/// \file
/// The step of the control cycle (docs/compensation.md, section 8): joint command and context in, corrected
/// command out.
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

/// The two prepared sets and their handover.
struct ParameterSets {
  std::array<FirmwareModel, 2> models{};  ///< one is used, the other may be prepared
  Handover handover{};                    ///< which one is used
};

/// Output for a command that is refused: not finite, beyond a joint limit, or with a context that is not
/// finite.
enum class OnRefusal : std::uint8_t {
  pass_through = 0,          ///< the correction fades out to zero
  hold_last_correction = 1,  ///< the last correction is added to the command
};

/// Settings of the step.
struct ControlSettings {
  CompensationSettings<Scalar> compensation{};  ///< of compensate()
  /// Cycles of the fade (C19) from the old set's correction to the new one's; 0: at once.
  std::uint32_t fade_cycles = 1000;
  /// Band of (C18), rad: motion against the last direction after which a joint counts as reversed. Within it
  /// the direction moves linearly from -1 to +1, so that a reversal never makes the command step.
  Scalar direction_band_rad = Scalar(1e-4);
  OnRefusal on_refusal = OnRefusal::pass_through;  ///< output for a refused command
};

/// Result of a step.
using StepResult = Compensated<Scalar, joints>;

/// State of the cycle for the background: single words, each written by the cycle alone.
struct ControlPublication {
  std::atomic<std::uint32_t> cycles{0};                             ///< since the start, wraps
  std::array<std::atomic<std::uint32_t>, 6> cycles_by_status{};     ///< by StepStatus, wrap
  std::atomic<std::uint32_t> last_status{0};                        ///< StepStatus
  std::array<std::atomic<std::uint32_t>, joints> correction_rad{};  ///< binary32 bits
  std::atomic<std::uint32_t> largest_correction_rad{0};  ///< binary32 bits, of any joint since the start
};

/// State and step of the control cycle. One thread or interrupt calls step(); nothing here is shared but the
/// handover and the publication.
class ControlCycle {
 public:
  /// Limits of the joints are the robot's. A negative or non-finite band or largest correction
  /// is replaced by 0, which corrects nothing.
  ControlCycle(const Robot& robot, ParameterSets& sets, const ControlSettings& settings);

  /// One control cycle. Directions are tracked from the commands (C18); `context.direction` is not used, but
  /// must be finite.
  ///
  /// The active set is read once, at the start. When it changes, the difference between the correction of the
  /// cycle before and the new set's decays to zero over fade_cycles, as v^2 (3 - 2 v) with v from 1 to 0
  /// (C19). So a change of set moves the command by at most 1.5 / fade_cycles of that difference per cycle,
  /// and no cycle evaluates two sets. The same holds where the status changes between corrected and passed
  /// through.
  ///
  /// A command that is not finite is returned as it came (or with the last correction on its finite joints),
  /// and leaves directions, correction and fade as they were. Bounded work on any input.
  void step(const Joints& q_command_rad, const FirmwareContext& context, StepResult& out);

  /// State for the background.
  const ControlPublication& publication() const { return publication_; }
  /// Settings in use.
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
