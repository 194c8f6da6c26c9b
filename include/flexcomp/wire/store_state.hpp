// SPDX-License-Identifier: Apache-2.0
/// \file
/// Protocol of the parameter store, the same on every bus: numbers of states, commands and answers, and four
/// records. modbus_map.hpp and canopen_objects.hpp have their places on a bus.
///
/// A record is a sequence of fields without gaps, every field an even number of bytes. On Modbus a field is
/// big-endian in consecutive registers (a binary64 takes four, most significant first, "ABCD EFGH"); on
/// CANopen it is little-endian. Offsets in bytes are thus the same on both; a register offset is half of it.
/// Hashes are bytes in order on both. Reals are binary64 in SI units and travel as bits, so that what the
/// host sends is what the controller computes with, to the last bit.
///
///     capability, 128 bytes                       status, 96 bytes
///       0 u16 protocol (major << 8 | minor)         0 u16 state (StoreState)
///       2 u16 joints                                2 u16 answer to the last command (Answer)
///       4 u16 bytes of the scalar: 4, 8             4 u16 refusal of the last command (flexcomp::Refusal)
///       6 u16 image schema (major << 8 | minor)     6 u16 faults (bits, namespace fault)
///       8 u32 bases, bit 1 << id                    8 u32 detail of the refusal or answer
///      12 u32 flags (bits, capability_flag)         12 u16 slot of the active set: 0, 1, or 0xFFFF for none
///      16 u16 terms that are not constant          14 u16 1: the control cycle runs what is requested
///      18 u16 tables                               16 u32 sequence of the active set, 0 for none
///      20 u32 table values                         20 u32 bytes of the active image
///      24 u32 longest image, bytes                 24 u32 CRC-32 of the active image (its last word)
///      28 u32 control cycle, us                    28 u32 sequence that rollback returns to, 0 for none
///      32 u32 settling, control cycles             32 u32 bytes announced for the staged image
///      36 u32 firmware (major<<16|minor<<8|patch)  36 u32 bytes staged so far
///      40 nominal hash, 32 bytes                   40 u32 control cycles until a trial reverts, 0: no trial
///      72 hash of the robot's name, 32 bytes       44 u32 control cycles since the start (wraps)
///     104 f64 plausible position change, m         48 u32 x 6 control cycles by StepStatus 0 … 5 (wrap)
///     112 f64 plausible orientation change, rad    72 u16 StepStatus of the last control cycle
///     120 f64 largest correction of a joint, rad   74 22 bytes 0, reserved
///
///     probe request, 216 bytes                    probe response, 72 bytes
///       0 f64 x 6 joint command, rad                0 f64 x 6 corrected joint command, rad
///      48 f64 payload mass, kg                     48 f64 position that is still missed, m
///      56 f64 x 3 its centre of mass in F6, m      56 f64 orientation that is still missed, rad
///      80 f64 x 3 external force in F0, N          64 u16 StepStatus
///     104 f64 temperature, deg C                   66 u16 slot of the set that answered, 0xFFFF for none
///     112 f64 time, s                              68 u32 sequence of that set, 0 for none
///     120 f64 x 6 direction of joint (+1, -1, 0)
///     168 f64 x 6 relative speed of joint
///
/// Where the probe's status is `no_set` or `refused` the command comes back unchanged and both residuals are
/// 0. All that holds of an answer, as bits (flexcomp::step_flag), is a u16 of its own beside the response: Modbus register
/// 0x03A4, CANopen object 0x2020:3, where the capability has capability_flag::probe_flags.
///
/// A refusal by admission (Refusal::too_large and after) has in its detail the index of the term among those that are not
/// constant, from 0, in the order of the image; Refusal::too_costly the number of instructions.
///
/// rollback (but out of a trial) and restore_defaults over a bus need one of three: the integrator's word; where no key is
/// trusted (unit_record.hpp) an unlock; where one is, a signed command (signature.hpp): begin, its bytes and verify as for a
/// set, and then the command itself from the same client, before any other. An unlock: the command `unlock` with argument
/// 0, whose answer has a number in `detail`, the command `unlock` with that number as its argument, and then the command
/// itself, from the same client within 10 s. What is missing is answered `not_authorised`.
///
/// Another client's begin is answered `busy` while the bytes of a transfer go on arriving. It takes over from one that has been
/// silent for 3 s or has gone on for the time of an abandoned transfer; who is told to wait comes before whom he
/// waits for.
///
/// Taking in a set: begin(bytes) -> the bytes -> verify -> commit (or commit_trial, then confirm). verify and the
/// commands that write to non-volatile memory (commit, commit_trial, confirm, rollback, restore_defaults) are answered
/// when they are accepted and then run in the background: the state is `working` until they end, and answer,
/// refusal and detail then tell how. A client polls the status until the state is no longer `working`: after verify
/// it is `verified`, or `idle` with the refusal. A commit that comes while its client's verify is still working
/// follows by itself where the set is good; abort, and the end of the connection, give a verify up.
#ifndef FLEXCOMP_WIRE_STORE_STATE_HPP
#define FLEXCOMP_WIRE_STORE_STATE_HPP

#include <array>
#include <cstddef>
#include <cstdint>

#include "flexcomp/bytes.hpp"

namespace flexcomp {
namespace wire {

/// Version of this protocol. A host refuses another major number; a higher minor number only adds.
constexpr std::uint16_t protocol_version = 0x0101;
/// Joints of an arm in the records.
constexpr std::size_t joints = 6;

/// State of the parameter store. Numbers are on the wire: add, never change.
enum class StoreState : std::uint16_t {
  idle = 0,       ///< nothing staged
  receiving = 1,  ///< bytes are coming in
  verified = 2,   ///< staged in full, checked and prepared; waits for commit
  working = 3,    ///< a set is checked, or non-volatile memory is written
  trial = 4,      ///< a committed set runs on trial: confirm it or it reverts by itself
};

/// Commands, with their argument (u32; 0 where none is named). Numbers are on the wire: add, never change.
enum class Command : std::uint16_t {
  none = 0,          ///< does nothing
  begin = 1,         ///< announces an image; argument: its length in bytes
  verify = 2,        ///< checks the staged image and prepares it, in the background
  commit = 3,        ///< writes it to the inactive slot and activates it; verifies first where needed
  commit_trial = 4,  ///< the same, but reverts unless confirmed; argument: control cycles, 0 = as configured
  confirm = 5,       ///< makes the set on trial permanent
  rollback = 6,      ///< activates the set in the other slot, or ends the trial; the slot left is erased
  abort = 7,         ///< discards what is staged
  restore_defaults = 8,  ///< erases both slots; commands are passed through from then on
  unlock = 9,            ///< of what destroys sets; argument: 0, then the number in `detail`
};

/// How the last command ended. Numbers are on the wire: add, never change.
enum class Answer : std::uint16_t {
  accepted = 0,     ///< done, or being worked on
  refused = 1,      ///< the image was refused; `refusal` says why
  wrong_state = 2,  ///< not in this state of the store
  busy = 3,  ///< transfer of another client, write in progress, or the cycle has not taken the last set yet
  not_authorised = 4,   ///< by local control, or without unlock or signature
  storage_failed = 5,   ///< non-volatile memory could not be erased, written or read back
  incomplete = 6,       ///< fewer bytes were staged than announced; detail: how many
  no_previous = 7,      ///< nothing to roll back to
  unknown_command = 8,  ///< not a Command
  bad_argument = 9,     ///< length 0, or bytes that leave a gap or exceed the announced length
  reverted = 10,        ///< the trial ran out before it was confirmed
};

/// Detail of Answer::not_authorised: the command was not unlocked.
constexpr std::uint32_t needs_unlock = 1;
/// Detail of Answer::not_authorised: the command was not signed, and the controller trusts a key.
constexpr std::uint32_t needs_signature = 2;

/// Bits of the status field `faults`. None of them stops the robot.
namespace fault {
constexpr std::uint16_t no_valid_set = 1;  ///< no slot held a set that this controller accepts: pass-through
constexpr std::uint16_t older_slot = 2;    ///< the newest slot was damaged or refused; the other one runs
constexpr std::uint16_t storage = 4;       ///< non-volatile memory failed to read, erase or write
constexpr std::uint16_t trial_reverted = 8;  ///< a set on trial was not confirmed in time
}  // namespace fault

/// Bits of the capability record's `flags`.
namespace capability_flag {
constexpr std::uint32_t unit =
    1;  ///< there is a unit record, and rollback and restore_defaults are not for everybody
constexpr std::uint32_t probe_flags = 2;  ///< the flags of a probe's answer can be read
}  // namespace capability_flag

/// Slot of a set that is in none.
constexpr std::uint16_t no_slot = 0xFFFF;

/// Capability record, 128 bytes: identity and limits of the controller; see the table at the top.
struct Capability {
  std::uint16_t protocol = protocol_version;    ///< major << 8 | minor
  std::uint16_t joints = 0;                     ///< of the arm
  std::uint16_t scalar_bytes = 0;               ///< 4 float, 8 double
  std::uint16_t schema = 0;                     ///< of images, major << 8 | minor
  std::uint32_t bases = 0;                      ///< bit 1 << id of Basis
  std::uint32_t flags = 0;                      ///< bits of namespace capability_flag
  std::uint16_t terms = 0;                      ///< that are not constant
  std::uint16_t tables = 0;                     ///< most tables
  std::uint32_t values = 0;                     ///< most table values
  std::uint32_t image_bytes = 0;                ///< longest image
  std::uint32_t cycle_us = 0;                   ///< period of the control cycle
  std::uint32_t fade_cycles = 0;                ///< within which a change of set has settled (C19)
  std::uint32_t firmware = 0;                   ///< major << 16 | minor << 8 | patch
  std::array<std::uint8_t, 32> nominal_hash{};  ///< of the geometry
  std::array<std::uint8_t, 32> name_hash{};     ///< of the robot's name
  std::uint64_t plausible_position_m = 0;       ///< binary64 bits
  std::uint64_t plausible_orientation_rad = 0;  ///< binary64 bits
  std::uint64_t largest_correction_rad = 0;     ///< binary64 bits
};
constexpr std::size_t capability_bytes = 128;  ///< size of the capability record

/// Status record, 96 bytes: state of store and control cycle; see the table at the top.
struct Status {
  std::uint16_t state = 0;                          ///< StoreState
  std::uint16_t answer = 0;                         ///< Answer to the last command
  std::uint16_t refusal = 0;                        ///< Refusal of the last command
  std::uint16_t faults = 0;                         ///< bits of namespace fault
  std::uint32_t detail = 0;                         ///< of the refusal or answer
  std::uint16_t active_slot = no_slot;              ///< 0, 1 or no_slot
  std::uint16_t settled = 0;                        ///< 1: the cycle runs what is requested
  std::uint32_t active_sequence = 0;                ///< 0: none
  std::uint32_t active_bytes = 0;                   ///< of the active image
  std::uint32_t active_crc = 0;                     ///< CRC-32 of the active image
  std::uint32_t previous_sequence = 0;              ///< that rollback returns to, 0: none
  std::uint32_t announced_bytes = 0;                ///< of the staged image
  std::uint32_t staged_bytes = 0;                   ///< so far
  std::uint32_t trial_cycles_left = 0;              ///< 0: no trial
  std::uint32_t cycles = 0;                         ///< since the start, wraps
  std::array<std::uint32_t, 6> cycles_by_status{};  ///< by StepStatus, wrap
  std::uint16_t last_status = 0;                    ///< StepStatus of the last cycle
};
constexpr std::size_t status_bytes = 96;  ///< size of the status record

/// Probe request record, 216 bytes: a joint command and its context; reals as binary64 bits.
struct ProbeRequest {
  std::array<std::uint64_t, joints> q_rad{};           ///< joint command
  std::uint64_t payload_kg = 0;                        ///< mass of the payload
  std::array<std::uint64_t, 3> payload_com_m{};        ///< its centre of mass in F6
  std::array<std::uint64_t, 3> force_n{};              ///< external, in F0
  std::uint64_t temperature_c = 0;                     ///< of the arm
  std::uint64_t time_s = 0;                            ///< as in Context
  std::array<std::uint64_t, joints> direction{};       ///< +1, -1 or 0 of each joint
  std::array<std::uint64_t, joints> relative_speed{};  ///< of each joint
};
constexpr std::size_t probe_request_bytes = 216;  ///< size of the probe request record

/// Probe response record, 72 bytes: the corrected command; reals as binary64 bits.
struct ProbeResponse {
  std::array<std::uint64_t, joints> q_rad{};  ///< corrected joint command
  std::uint64_t position_m = 0;               ///< remaining error
  std::uint64_t orientation_rad = 0;          ///< remaining error
  std::uint16_t status = 0;                   ///< StepStatus
  std::uint16_t slot = no_slot;               ///< of the set that answered, or no_slot
  std::uint32_t sequence = 0;                 ///< of that set, 0: none
  std::uint16_t flags = 0;                    ///< bits of step_flag; beside the record, not in it
};
constexpr std::size_t probe_response_bytes = 72;  ///< size of the probe response record

/// Order of the bytes of a field.
enum class ByteOrder {
  little,  ///< CANopen
  big      ///< Modbus
};

namespace detail {

/// Visits the fields of a record in the order of the tables above.
template <class Record, class Visitor>
void visit_capability(Record& r, Visitor&& v) {
  v(r.protocol), v(r.joints), v(r.scalar_bytes), v(r.schema), v(r.bases), v(r.flags), v(r.terms), v(r.tables);
  v(r.values), v(r.image_bytes), v(r.cycle_us), v(r.fade_cycles), v(r.firmware);
  v.bytes(r.nominal_hash.data(), 32), v.bytes(r.name_hash.data(), 32);
  v(r.plausible_position_m), v(r.plausible_orientation_rad), v(r.largest_correction_rad);
}

template <class Record, class Visitor>
void visit_status(Record& r, Visitor&& v) {
  v(r.state), v(r.answer), v(r.refusal), v(r.faults), v(r.detail), v(r.active_slot), v(r.settled);
  v(r.active_sequence), v(r.active_bytes), v(r.active_crc), v(r.previous_sequence), v(r.announced_bytes);
  v(r.staged_bytes), v(r.trial_cycles_left), v(r.cycles);
  for (auto& n : r.cycles_by_status) v(n);
  v(r.last_status), v.skip(22);
}

template <class Record, class Visitor>
void visit_probe_request(Record& r, Visitor&& v) {
  for (auto& q : r.q_rad) v(q);
  v(r.payload_kg);
  for (auto& x : r.payload_com_m) v(x);
  for (auto& f : r.force_n) v(f);
  v(r.temperature_c), v(r.time_s);
  for (auto& d : r.direction) v(d);
  for (auto& u : r.relative_speed) v(u);
}

template <class Record, class Visitor>
void visit_probe_response(Record& r, Visitor&& v) {
  for (auto& q : r.q_rad) v(q);
  v(r.position_m), v(r.orientation_rad), v(r.status), v(r.slot), v(r.sequence);
}

class Writer {
 public:
  Writer(std::uint8_t* out, ByteOrder order) : p_(out), order_(order) {}
  template <class T>
  void operator()(T value) {
    for (std::size_t k = 0; k < sizeof(T); ++k) {
      const std::size_t shift = 8 * (order_ == ByteOrder::little ? k : sizeof(T) - 1 - k);
      p_[k] = static_cast<std::uint8_t>(static_cast<std::uint64_t>(value) >> shift);
    }
    p_ += sizeof(T);
  }
  void bytes(const std::uint8_t* from, std::size_t size) {
    for (std::size_t k = 0; k < size; ++k) *p_++ = from[k];
  }
  void skip(std::size_t size) {
    for (std::size_t k = 0; k < size; ++k) *p_++ = 0;
  }

 private:
  std::uint8_t* p_;
  ByteOrder order_;
};

class Reader {
 public:
  Reader(const std::uint8_t* in, ByteOrder order) : p_(in), order_(order) {}
  template <class T>
  void operator()(T& value) {
    std::uint64_t bits = 0;
    for (std::size_t k = 0; k < sizeof(T); ++k) {
      const std::size_t shift = 8 * (order_ == ByteOrder::little ? k : sizeof(T) - 1 - k);
      bits |= static_cast<std::uint64_t>(p_[k]) << shift;
    }
    value = static_cast<T>(bits);
    p_ += sizeof(T);
  }
  void bytes(std::uint8_t* to, std::size_t size) {
    for (std::size_t k = 0; k < size; ++k) to[k] = *p_++;
  }
  void skip(std::size_t size) { p_ += size; }

 private:
  const std::uint8_t* p_;
  ByteOrder order_;
};

}  // namespace detail

/// Writes a record into `out`, of at least capability_bytes.
inline void encode(const Capability& r, ByteOrder order, std::uint8_t* out) {
  detail::visit_capability(r, detail::Writer(out, order));
}
/// Writes a record into `out`, of at least status_bytes.
inline void encode(const Status& r, ByteOrder order, std::uint8_t* out) {
  detail::visit_status(r, detail::Writer(out, order));
}
/// Writes a record into `out`, of at least probe_request_bytes.
inline void encode(const ProbeRequest& r, ByteOrder order, std::uint8_t* out) {
  detail::visit_probe_request(r, detail::Writer(out, order));
}
/// Writes a record into `out`, of at least probe_response_bytes.
inline void encode(const ProbeResponse& r, ByteOrder order, std::uint8_t* out) {
  detail::visit_probe_response(r, detail::Writer(out, order));
}

/// Reads a record from `in`, of at least capability_bytes.
inline void decode(const std::uint8_t* in, ByteOrder order, Capability& r) {
  detail::visit_capability(r, detail::Reader(in, order));
}
/// Reads a record from `in`, of at least status_bytes.
inline void decode(const std::uint8_t* in, ByteOrder order, Status& r) {
  detail::visit_status(r, detail::Reader(in, order));
}
/// Reads a record from `in`, of at least probe_request_bytes.
inline void decode(const std::uint8_t* in, ByteOrder order, ProbeRequest& r) {
  detail::visit_probe_request(r, detail::Reader(in, order));
}
/// Reads a record from `in`, of at least probe_response_bytes.
inline void decode(const std::uint8_t* in, ByteOrder order, ProbeResponse& r) {
  detail::visit_probe_response(r, detail::Reader(in, order));
}

/// Message in English, lower case, without a full stop.
inline const char* text(Answer a) {
  switch (a) {
    case Answer::accepted:
      return "accepted";
    case Answer::refused:
      return "the image was refused";
    case Answer::wrong_state:
      return "not possible in the present state of the parameter store";
    case Answer::busy:
      return "the parameter store is busy";
    case Answer::not_authorised:
      return "not authorised at the controller";
    case Answer::storage_failed:
      return "the controller's non-volatile memory failed";
    case Answer::incomplete:
      return "fewer bytes arrived than were announced";
    case Answer::no_previous:
      return "there is no previous set to roll back to";
    case Answer::unknown_command:
      return "the command is not known to this controller";
    case Answer::bad_argument:
      return "the argument or the offset is out of range";
    case Answer::reverted:
      return "the set on trial was not confirmed in time and has reverted";
  }
  return "unknown answer";
}

/// Lower-case name of a state.
inline const char* name(StoreState s) {
  switch (s) {
    case StoreState::idle:
      return "idle";
    case StoreState::receiving:
      return "receiving";
    case StoreState::verified:
      return "verified";
    case StoreState::working:
      return "working";
    case StoreState::trial:
      return "trial";
  }
  return "unknown";
}

}  // namespace wire
}  // namespace flexcomp

#endif
