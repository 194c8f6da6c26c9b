// SPDX-License-Identifier: Apache-2.0
/// \file
/// Outcomes of the core: every function that can fail returns one; nothing throws.
#ifndef FLEXCOMP_STATUS_HPP
#define FLEXCOMP_STATUS_HPP

#include <cstdint>

namespace flexcomp {

/// Reason for which a parameter set, an image or a model was refused. Numbers are on the wire: add, never
/// change.
enum class Refusal : std::uint8_t {
  none = 0,              ///< accepted
  truncated = 1,         ///< fewer bytes than a header, or than the header announces
  bad_magic = 2,         ///< not a flexcomp image
  schema = 3,            ///< a schema major version that this build does not know
  bad_length = 4,        ///< lengths in header and records do not add up
  checksum = 5,          ///< CRC-32 differs
  wrong_robot = 6,       ///< made for a robot of another name
  wrong_nominal = 7,     ///< made for another nominal geometry
  unknown_record = 8,    ///< a record type that this build does not know
  unknown_basis = 9,     ///< a basis id that this build does not evaluate
  bad_place = 10,        ///< a place that the chain does not have, or that is never pushed
  bad_value = 11,        ///< a non-finite number, a joint or table index out of range
  too_many_terms = 12,   ///< more terms than the controller holds
  table_too_large = 13,  ///< more table values than the controller holds
  implausible = 14,      ///< moves the tool farther than the plausibility limit
  mounting = 15,         ///< link_gravity where gravity is not along the axis of joint 1
  too_long = 16,         ///< longer than the staging memory
  stale_sequence = 17,   ///< a sequence number not above the active one
  // Admission (admission.hpp); the detail is the index of the term among those that are not constant.
  too_large = 18,              ///< a value, a reversal or a growth per kelvin beyond what an arm has
  too_steep = 19,              ///< changes faster with a reading than an arm does
  too_compliant = 20,          ///< gives way to load or force by more than an arm does
  not_allowed_covariate = 21,  ///< follows time or speed
  too_costly = 22,             ///< a step would take too many instructions; the detail is their number
  sequence_too_far = 23,       ///< a sequence number more than 65,536 above the active one
  // Who may (signature.hpp).
  wrong_unit = 24,       ///< made for the unit with another serial number
  not_signed = 25,       ///< without a signature, or not bound to a unit, where only signed sets are accepted
  unknown_key = 26,      ///< signed with a key that is not trusted
  wrong_signature = 27,  ///< the signature does not belong to these bytes
  counter_used = 28,     ///< a counter not above the highest one that was accepted: sent before, or older
};

/// Result of one joint command (docs/compensation.md, C17). Numbers are on the wire: add, never change.
enum class StepStatus : std::uint8_t {
  ok = 0,  ///< corrected
  near_singular =
      1,  ///< corrected, but damped near a singularity (C9): what remains is orientation before position
  limited = 2,   ///< the correction was scaled to the largest one allowed
  at_limit = 3,  ///< a corrected joint is at its limit
  no_set = 4,    ///< no valid parameter set: the command was passed through
  refused = 5,   ///< the command was not finite or beyond a joint limit: passed through
};

/// Lower-case name of a status as in files (`ok near_singular limited at_limit no_set refused`).
inline const char* name(StepStatus s) {
  switch (s) {
    case StepStatus::ok:
      return "ok";
    case StepStatus::near_singular:
      return "near_singular";
    case StepStatus::limited:
      return "limited";
    case StepStatus::at_limit:
      return "at_limit";
    case StepStatus::no_set:
      return "no_set";
    case StepStatus::refused:
      return "refused";
  }
  return "unknown";
}

/// What holds a step back (docs/compensation.md, section 8), as bits; 0 where nothing does. Numbers are on the wire:
/// add, never change.
namespace step_flag {
constexpr std::uint16_t refused = 1U << 0U;       ///< the command or its context was not used
constexpr std::uint16_t no_set = 1U << 1U;        ///< no valid parameter set
constexpr std::uint16_t at_limit = 1U << 2U;      ///< a corrected joint is at its limit
constexpr std::uint16_t limited = 1U << 3U;       ///< the correction was scaled to the largest one allowed
constexpr std::uint16_t rate_limited = 1U << 4U;  ///< the correction follows at its greatest rate
constexpr std::uint16_t settling = 1U << 5U;  ///< the difference that an event left has not returned to 0 yet
constexpr std::uint16_t not_converged = 1U << 6U;  ///< the last iterate was still above its tolerance
constexpr std::uint16_t near_singular = 1U << 7U;  ///< damped or scaled near a singularity (C9, C10)
constexpr unsigned count = 8;                      ///< bits that have a meaning
}  // namespace step_flag

/// The summary of a set of flags: the first that holds of refused, no_set, at_limit, limited (also for rate_limited,
/// settling, not_converged), near_singular, ok.
constexpr StepStatus summary(std::uint16_t flags) {
  if ((flags & step_flag::refused) != 0) return StepStatus::refused;
  if ((flags & step_flag::no_set) != 0) return StepStatus::no_set;
  if ((flags & step_flag::at_limit) != 0) return StepStatus::at_limit;
  constexpr unsigned held_back =
      step_flag::limited | step_flag::rate_limited | step_flag::settling | step_flag::not_converged;
  if ((flags & held_back) != 0) return StepStatus::limited;
  return (flags & step_flag::near_singular) != 0 ? StepStatus::near_singular : StepStatus::ok;
}

/// Word of the flag of bit `bit` as in files, lower case (`rate_limited`).
inline const char* flag_name(unsigned bit) {
  constexpr const char* words[step_flag::count] = {"refused",       "no_set",       "at_limit",
                                                   "limited",       "rate_limited", "settling",
                                                   "not_converged", "near_singular"};
  return bit < step_flag::count ? words[bit] : "unknown";
}

/// Message in English, lower case, without a full stop.
inline const char* text(Refusal r) {
  switch (r) {
    case Refusal::none:
      return "accepted";
    case Refusal::truncated:
      return "the image is truncated";
    case Refusal::bad_magic:
      return "not a flexcomp parameter image";
    case Refusal::schema:
      return "the image's schema is not known to this controller";
    case Refusal::bad_length:
      return "the image's lengths do not add up";
    case Refusal::checksum:
      return "the image's checksum is wrong";
    case Refusal::wrong_robot:
      return "the image is for another robot";
    case Refusal::wrong_nominal:
      return "the image is for another nominal geometry";
    case Refusal::unknown_record:
      return "the image has a record type that is not known";
    case Refusal::unknown_basis:
      return "the image has a basis that the controller does not evaluate";
    case Refusal::bad_place:
      return "the image has a term at a place that the controller does not have";
    case Refusal::bad_value:
      return "the image has a value or an index out of range";
    case Refusal::too_many_terms:
      return "the image has more terms than the controller holds";
    case Refusal::table_too_large:
      return "the image has more table values than the controller holds";
    case Refusal::implausible:
      return "the image would move the tool farther than is plausible";
    case Refusal::mounting:
      return "link_gravity needs gravity along the axis of joint 1";
    case Refusal::too_long:
      return "the image is longer than the staging memory";
    case Refusal::stale_sequence:
      return "the image's sequence is not above the active one";
    case Refusal::too_large:
      return "the image has a term that is larger than on any arm";
    case Refusal::too_steep:
      return "the image has a term that changes faster with a joint's reading than on any arm";
    case Refusal::too_compliant:
      return "the image has a term that gives way to loads more than any arm";
    case Refusal::not_allowed_covariate:
      return "the image has a term that follows time or speed";
    case Refusal::too_costly:
      return "the image takes more instructions in a control cycle than are allowed";
    case Refusal::sequence_too_far:
      return "the sequence number is more than 65,536 above that of the active set";
    case Refusal::wrong_unit:
      return "it is for another unit: the serial number differs";
    case Refusal::not_signed:
      return "the controller accepts only what is signed";
    case Refusal::unknown_key:
      return "it is signed with a key that the controller does not trust";
    case Refusal::wrong_signature:
      return "the signature is wrong";
    case Refusal::counter_used:
      return "its counter is not above the highest one that the controller has accepted";
  }
  return "unknown refusal";
}

}  // namespace flexcomp

#endif
