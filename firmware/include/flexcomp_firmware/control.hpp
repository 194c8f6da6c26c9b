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
#include "flexcomp_firmware/output_stage.hpp"

namespace flexcomp {
namespace firmware {

/// The two prepared sets with their certificates, and their handover.
struct ParameterSets {
  std::array<FirmwareModel, 2> models{};              ///< one is used, the other may be prepared
  std::array<FirmwareCertificate, 2> certificates{};  ///< of the models, by which they were admitted
  Handover handover{};                                ///< which one is used
};

/// Output for a command that is refused: not finite, beyond a joint limit, or with a context that is not
/// finite.
enum class OnRefusal : std::uint8_t {
  /// The command, if it is within the joint limits (so its context is not finite), while the correction
  /// returns to 0 as after any event; any other command is held as by `hold`.
  pass_through = 0,
  hold = 1,  ///< the last output stands
};

/// Settings of the step.
struct ControlSettings {
  CompensationSettings<Scalar> compensation{};  ///< of compensate()
  /// Bounds of the motion of the correction, and the period of the cycle (C19, C20).
  MotionBounds<Scalar, joints> motion{};
  /// Band of (C18), rad: motion against the last direction after which a joint counts as reversed. Within it
  /// the direction moves linearly from -1 to +1, so that a reversal never makes the command step.
  Scalar direction_band_rad = Scalar(1e-4);
  OnRefusal on_refusal = OnRefusal::hold;  ///< output for a refused command
};

/// Result of a step.
using StepResult = Compensated<Scalar, joints>;

/// State of the cycle for the background: single words, each written by the cycle alone.
struct ControlPublication {
  std::atomic<std::uint32_t> cycles{0};                             ///< since the start, wraps
  std::array<std::atomic<std::uint32_t>, 6> cycles_by_status{};     ///< by StepStatus, wrap
  std::atomic<std::uint32_t> last_status{0};                        ///< StepStatus
  std::atomic<std::uint32_t> last_flags{0};                         ///< bits of step_flag
  std::array<std::atomic<std::uint32_t>, joints> correction_rad{};  ///< binary32 bits
  std::atomic<std::uint32_t> largest_correction_rad{0};  ///< binary32 bits, of any joint since the start
  /// Tracked directions (C18), binary32 bits; kept up only for a set that reads them.
  std::array<std::atomic<std::uint32_t>, joints> direction{};
};

/// State and step of the control cycle. One thread or interrupt calls step(); nothing here is shared but the
/// handover and the publication.
class ControlCycle {
 public:
  /// Limits of the joints are the robot's, no wider than sines and cosines reach. A negative or non-finite
  /// band or largest correction is replaced by 0, which corrects nothing; for bounds of motion see
  /// OutputStage.
  ControlCycle(const Robot& robot, ParameterSets& sets, const ControlSettings& settings);

  /// Where the arm stands, rad: the output until a command lies within the largest correction of it, which is
  /// then taken up without any motion. Before the first step, or from the context of step() to begin anew.
  /// False where a number is not finite or beyond a limit.
  bool start(const Joints& q_standing_rad) { return output_.start(q_standing_rad); }

  /// One control cycle. Directions are tracked from the commands (C18); `context.direction` is not used, but
  /// must be finite.
  ///
  /// The active set is read once, at the start; no cycle evaluates two sets. What it wants goes through the
  /// OutputStage: at an event (another set, a jump of the context, a limit, a refusal, power-up) the output
  /// does not jump, and the difference returns to exactly 0 (C19); otherwise it follows within the rate of
  /// each joint (C20).
  ///
  /// The output is finite whatever comes in. A command with a NaN leaves no trace in directions and
  /// correction. Bounded work on any input.
  void step(const Joints& q_command_rad, const FirmwareContext& context, StepResult& out);

  /// step() with the rate of the output, rad/s, for feed-forward.
  ///
  /// Where nothing holds back it is the derivative (C22) along the rate of the command; where only an offset settles, that
  /// and the offset's motion. Everywhere else it is what was put out: the command's rate and the change of the correction
  /// since the last cycle; 0 where the output stands. A joint's rate that is not finite makes all count as 0. Always finite.
  void step_rate(const Joints& q_command_rad, const Joints& q_rate_command_rad_s,
                 const FirmwareContext& context, StepResult& out, Joints& q_rate_rad_s);

  /// The set that is in use, or null, with the directions as tracked in `context`: for what is computed beside the step.
  /// Both contexts, also at the same time; of the background's the model is valid until the store's next poll or command,
  /// of the cycle's until the next step.
  const FirmwareModel* current(FirmwareContext& context) const;

  /// Error that the last step left, with what the output stage held back; 0 where refused. Of the cycle.
  Scalar remaining_position_m() const { return remaining_position_; }
  /// The same of orientation.
  Scalar remaining_orientation_rad() const { return remaining_orientation_; }

  /// State for the background.
  const ControlPublication& publication() const { return publication_; }
  /// Settings in use.
  const ControlSettings& settings() const { return settings_; }
  /// Direction of a joint as tracked, -1 … 1; 0 until it has moved.
  Scalar direction(std::size_t joint) const { return direction_[joint]; }
  /// Where the command goes out, with its bounds.
  const OutputStage<Scalar, joints>& output() const { return output_; }

 private:
  /// What a step knows before anything is computed.
  struct Input {
    const FirmwareModel* model;  ///< null: no set
    bool is_finite;              ///< the command
  };
  Input begin(const Joints& q_command_rad);
  bool finish(const Input& input, const Joints& q_command_rad, const FirmwareContext& context,
              StepResult& out);
  void track(const Joints& q);
  bool is_within_limits(const Joints& q) const;
  bool context_jumped(const FirmwareContext& context);
  void publish(const StepResult& out, const FirmwareModel* model);

  ParameterSets& sets_;
  ControlSettings settings_;
  Joints lower_{};
  Joints upper_{};
  OutputStage<Scalar, joints> output_;
  const FirmwareCertificate* certificate_ = nullptr;  ///< of the set in use
  Scalar band_inverse_ = Scalar(0);
  Joints direction_{};
  Joints last_command_{};
  // Of the last command that was used, but for time and motion.
  std::array<Scalar, 3> last_com_{};
  std::array<Scalar, 3> last_force_{};
  Scalar last_payload_ = Scalar(0);
  Scalar last_temperature_ = Scalar(0);
  Scalar largest_ = Scalar(0);
  Scalar remaining_position_ = Scalar(0);
  Scalar remaining_orientation_ = Scalar(0);
  std::uint16_t last_cause_ = 0;
  bool tracking_ = false;
  bool is_new_set_ = false;
  ControlPublication publication_{};
};

}  // namespace firmware
}  // namespace flexcomp

#endif
