// SPDX-License-Identifier: Apache-2.0
#include "flexcomp_firmware/store.hpp"

#include <array>
#include <cstring>

#include "flexcomp/crc32.hpp"
#include "flexcomp_firmware/arithmetic.hpp"

namespace flexcomp {
namespace firmware {

using wire::Answer;
using wire::Command;
using wire::StoreState;

namespace {

constexpr std::uint32_t chunk_bytes = 256;  ///< most bytes per call
/// A sequence that is farther ahead of the active one is a mistake: it would leave no numbers for those that follow.
constexpr std::uint32_t most_ahead = 0x10000U;
/// A client that has been silent for so long gives way to another.
constexpr std::uint32_t silent_ms = 3000;
/// For so long, one that was told to wait comes before the one that it waits for.
constexpr std::uint32_t precedence_ms = 2000;
/// An unlock or a signed command holds for so long.
constexpr std::uint32_t permission_ms = 10000;
constexpr unsigned most_readings = 3;     ///< of what may be a disturbed reading
constexpr unsigned most_calls = 1000000;  ///< of a hook that is busy, at the start
// Of one slice of a check. The instructions are those of a Cortex-M7.
constexpr std::uint32_t checksum_bytes = 1024;  ///< 10 instructions each
constexpr unsigned records_at_once = 16;        ///< terms; a table counts for as many
constexpr unsigned bounds_at_once = 4;          ///< terms; a part of a grid counts for as many
constexpr std::uint32_t probe_poses = 32;       ///< one at a time

std::uint32_t rounded_up(std::uint32_t size) {
  return (size + Slots::unit_bytes - 1U) / Slots::unit_bytes * Slots::unit_bytes;
}

/// Joint readings spread evenly over the limits: multiples of g^-1 … g^-6 with
/// g^7 = g + 1 (Roberts' sequence), in 32-bit integers, so that the poses are the same on every target.
Scalar spread(std::uint32_t pose, std::size_t joint) {
  constexpr std::uint32_t step[joints] = {0xE60E2B73U, 0xCEBD76D9U, 0xB9C9AA3BU,
                                          0xA6F5777FU, 0x9609C71FU, 0x86D516E5U};
  return static_cast<Scalar>((pose * step[joint]) >> 8U) * Scalar(1.0F / 16777216.0F);
}

/// The first basis that this controller does not evaluate, in an image whose records are valid up to there.
/// It reads the heads of the records only: a second instance of visit_image() would take flash.
std::uint32_t unknown_basis(const std::uint8_t* bytes, std::uint32_t size) {
  constexpr std::size_t head = image::record_head_bytes;
  for (std::size_t at = image::header_bytes; at + head + image::term_bytes <= size;
       at += head + load_u16(bytes + at + 2)) {
    const std::uint8_t basis = bytes[at + head + 2];
    if (load_u16(bytes + at) == image::record_term && basis >= basis_count) return basis;
  }
  return 0;
}

/// Serial number arithmetic (RFC 1982): true where a follows b by less than half of all numbers.
bool is_ahead(std::uint32_t a, std::uint32_t b) { return a != b && a - b < 0x80000000U; }

/// A length in units of 1e-6, for the detail word; saturates.
std::uint32_t micro(Scalar v) {
  if (!(v < Scalar(4000))) return 0xFFFFFFFFU;
  return v > Scalar(0) ? static_cast<std::uint32_t>(v * Scalar(1e6F)) : 0U;
}

}  // namespace

Store::Store(const Robot& robot, ParameterSets& sets, const Storage& storage, const StoreSettings& settings)
    : robot_(robot),
      nominal_hash_(flexcomp::nominal_hash(robot)),
      sets_(sets),
      slots_(storage),
      settings_(settings) {}

Answer Store::answer(Answer a, std::uint32_t detail) {
  answer_ = a;
  detail_ = detail;
  refusal_ = Refusal::none;
  return a;
}

Answer Store::refuse(Refusal r, std::uint32_t detail) {
  answer_ = Answer::refused;
  detail_ = detail;
  refusal_ = r;
  return Answer::refused;
}

void Store::release() {
  owner_ = nobody;
  announced_ = 0;
  staged_ = 0;
  length_known_ = true;
  state_ = StoreState::idle;
}

// --- start --------------------------------------------------------------------------------------------

void Store::erase_at_start(unsigned slot) {
  if (!slots_.is_erasable()) return;
  for (unsigned n = 0; n < most_calls; ++n) {
    const StorageResult r = slots_.erase(slot);
    if (r == StorageResult::busy) continue;
    if (r == StorageResult::failed) faults_ |= wire::fault::storage;
    break;
  }
}

/// Reads a sealed image into the staging memory, which must be idle, and prepares it in model set.index.
bool Store::load(const StoredSet& set) {
  for (unsigned reading = 0; reading < most_readings; ++reading) {
    if (slots_.read(set.slot, 0, staging_.data(), set.bytes) != StorageResult::done) {
      faults_ |= wire::fault::storage;
      continue;
    }
    begin_check(set.bytes, set.index);
    purpose_ = Purpose::start;
    Refusal r = Refusal::none;
    std::uint32_t detail = 0;
    while (!check_slice(r, detail)) {
    }
    if (r == Refusal::none) return is_in_staging(set);
    refuse(r, detail);
  }
  return false;
}

/// True where the image that was checked is the one that the seal was written for.
bool Store::is_in_staging(const StoredSet& set) const {
  return header_.sequence == set.sequence && load_u32(staging_.data() + set.bytes - 4) == set.crc;
}

void Store::boot() {
  has_booted_ = true;
  std::array<StoredSet, 2> found{};
  slots_.survey(found);
  const StoredSet &a = found[0], &b = found[1];
  // Sets of before there were generations have none: their sequences tell.
  const bool second =
      b.generation != a.generation ? b.generation > a.generation : is_ahead(b.sequence, a.sequence);
  const unsigned newest = second ? 1 : 0;
  bool damaged = false;
  for (const unsigned slot : {newest, newest ^ 1U}) {
    StoredSet& set = found[slot];
    if (!slots_.is_counted(set)) continue;
    if (active_.index != Handover::none) {
      // The other slot is checked for a later rollback, which prepares its model again.
      set.index = 1;
      if (load(set)) previous_ = set;
      continue;
    }
    set.index = 0;
    if (load(set)) {
      make_active(set);
      if (damaged) faults_ |= wire::fault::older_slot;
    } else {
      damaged = true;
    }
  }
  previous_.index = Handover::none;
  settle_start(found);
  if (active_.index == Handover::none) {
    faults_ |= wire::fault::no_valid_set;
  } else {
    answer(Answer::accepted);
  }
}

/// A seal of a set, or without one a mark in a slot, however long the memory takes; false where it fails.
bool Store::add_at_start(StoredSet* set, unsigned slot) {
  StorageResult r = StorageResult::busy;
  for (unsigned n = 0; n < most_calls && r == StorageResult::busy; ++n) {
    r = set != nullptr ? slots_.add_seal(*set) : slots_.add_mark(slot);
  }
  return r == StorageResult::done;
}

/// Makes the choice of this start that of every later one, before anything follows from it.
void Store::settle_start(const std::array<StoredSet, 2>& found) {
  if (!slots_.is_writable()) return;
  if (active_.slot != wire::no_slot) {
    // Marks that do not suffice to void this set may be all that is left of a restore that was cut.
    const unsigned other = active_.slot ^ 1U;
    const unsigned against = slots_.marks_against(active_);
    const unsigned wanted = active_.seals < Slots::enough_seals ? active_.seals + 2U : active_.seals;
    if (against != 0 && found[other].seals == 0) erase_at_start(other);
    // Those that are there may all be marginal; two that are whole outlast a mark that is.
    while (active_.seals < wanted && add_at_start(&active_, 0)) {
    }
  }
  // What may be a seal at another start must not count then.
  for (unsigned slot = 0; slot < 2; ++slot) {
    if (slot == active_.slot || slot == previous_.slot) continue;
    // As it was read when the choice was made: it may read otherwise by now.
    StoredSet seen = found[slot];
    const bool is_sealed = seen.seals != 0;
    // A sealed set that this firmware refuses keeps its place where there is no other.
    if (is_sealed && active_.slot == wire::no_slot && slots_.is_counted(seen)) continue;
    const std::uint32_t commit = slots_.begun(slot);
    if (!is_sealed || commit > seen.generation) seen.generation = commit;
    if (seen.generation <= active_.generation) continue;
    slots_.note_generation(seen.generation);
    bool is_void = true;
    while (is_void && slots_.marks_against(seen) < Slots::enough_marks)
      is_void = add_at_start(nullptr, slot ^ 1U);
    if (!is_void) erase_at_start(slot);
  }
}

// --- checks -------------------------------------------------------------------------------------------

/// Index of a model that the cycle neither uses nor may use next.
bool Store::free_model(std::uint32_t& index) const {
  if (!sets_.handover.settled()) return false;
  const std::uint32_t used = sets_.handover.in_use();
  index = used == 0 ? 1 : 0;
  return true;
}

void Store::begin_check(std::uint32_t size, std::uint32_t index) {
  check_ = Check::header;
  check_bytes_ = size;
  check_index_ = index;
  progress_ = 0;
}

/// The next slice of the check of what is in the staging memory; true where it was the last one, `r` is then the verdict.
bool Store::check_slice(Refusal& r, std::uint32_t& detail) {
  FirmwareModel& model = sets_.models[check_index_];
  const std::uint8_t* image = staging_.data();
  detail = 0;
  switch (check_) {
    case Check::header:
      is_command_ = check_signature_ != nullptr && purpose_ == Purpose::verify &&
                    looks_like_command(image, check_bytes_);
      if (is_command_) {
        check_ = Check::signature;
        return check_signature_(*this, true, r);
      }
      r = read_header(image, check_bytes_, header_);
      if (r == Refusal::none && header_.joints != joints) r = Refusal::wrong_nominal;
      if (r == Refusal::schema) detail = header_.schema_major;
      if (r == Refusal::truncated || r == Refusal::bad_length) detail = header_.total_bytes;
      if (r != Refusal::none) return true;
      check_crc_ = 0;
      check_ = Check::checksum;
      return false;
    case Check::checksum: {
      const std::uint32_t end = check_bytes_ - std::uint32_t{image::crc_bytes};
      const std::uint32_t size = end - progress_ < checksum_bytes ? end - progress_ : checksum_bytes;
      check_crc_ = crc32(image + progress_, size, check_crc_);
      progress_ += size;
      if (progress_ != end) return false;
      r = check_crc_ != load_u32(image + end) ? Refusal::checksum
                                              : check_binding(header_, nominal_hash_, robot_.name_hash);
      if (r == Refusal::none) r = check_unit(image, check_bytes_, robot_.unit_hash);
      if (r != Refusal::none || (check_signature_ != nullptr && check_signature_(*this, true, r)))
        return true;
      begin_model(robot_, model);
      cursor_ = {};
      check_ = check_signature_ != nullptr ? Check::signature : Check::records;
      return false;
    }
    case Check::signature:
      if (!check_signature_(*this, false, r)) return false;
      check_ = Check::records;
      return r != Refusal::none || is_command_;
    case Check::records:
      for (unsigned n = 0; n < records_at_once && !at_end(cursor_, check_bytes_); ++n) {
        if (load_u16(image + cursor_.at) == image::record_table) {
          if (n != 0) break;
          n = records_at_once;
        }
        r = add_record(image, check_bytes_, cursor_, model);
        if (r == Refusal::unknown_basis) detail = unknown_basis(image, check_bytes_);
        if (r == Refusal::too_many_terms) detail = FirmwareCapacity::terms;
        if (r == Refusal::table_too_large) detail = FirmwareCapacity::values;
        if (r != Refusal::none) return true;
      }
      if (at_end(cursor_, check_bytes_)) check_ = Check::chain;
      return false;
    case Check::chain:
      r = check_counts(header_, cursor_);
      if (r != Refusal::none) return true;
      finish_chain(model);
      check_ = Check::derivatives;
      return false;
    case Check::derivatives:
      finish_bounds(model);
      check_ = Check::size;
      return false;
    case Check::size:
      finish_size(model);
      // Before anything is evaluated: a probe pose takes a share of this.
      detail = step_instructions(model);
      if (detail > settings_.limits.instructions) {
        r = Refusal::too_costly;
        return true;
      }
      progress_ = 0;
      check_ = Check::probes;
      return false;
    case Check::probes:
      r = plausible(model, ++progress_, detail) ? Refusal::none : Refusal::implausible;
      if (r != Refusal::none) return true;
      if (progress_ != probe_poses) return false;
      admission_.begin(model, settings_.limits, declared_ranges(settings_.ranges, robot_));
      check_ = Check::bounds;
      return false;
    case Check::bounds:
      for (unsigned n = 0; n < bounds_at_once; ++n) {
        if (admission_.at_table(model)) {
          if (n != 0) return false;
          n = bounds_at_once;
        }
        if (admission_.advance(model)) continue;
        check_ = Check::verdict;
        break;
      }
      return false;
    case Check::verdict:
      r = admission_.finish(model, sets_.certificates[check_index_], detail);
      return true;
  }
  return true;
}

bool Store::set_trust(const Trust& trust) {
  if (has_booted_) return false;
  trust_ = trust;
  check_signature_ = trust.count != 0 ? check_signature : nullptr;
  return true;
}

bool Store::check_signature(Store& store, bool begins, Refusal& r) {
  if (!begins) {
    const bool is_late = store.now_ms_ - store.signature_since_ms_ >= store.settings_.staging_timeout_ms;
    if (store.signature_.advance(store.trust_, r)) return true;
    if (is_late) r = Refusal::wrong_signature;
    return is_late;
  }
  store.signature_since_ms_ = store.now_ms_;
  r = store.begin_signature();
  return r != Refusal::none;
}

/// Whether what is in the staging memory has a signature that could count here: bound to this unit, by a trusted key, with a counter
/// that was not used.
Refusal Store::begin_signature() {
  const std::uint8_t* bytes = staging_.data();
  const std::uint8_t* id = nullptr;
  std::uint32_t end = signing::command_signature;
  Signed what = Signed::command;
  if (is_command_) {
    SignedCommand command;
    const Refusal r = decode(bytes, check_bytes_, command);
    if (r != Refusal::none) return r;
    if (command.unit_hash != robot_.unit_hash) return Refusal::wrong_unit;
    if (command.active_crc != active_.crc) return Refusal::stale_sequence;
    check_counter_ = command.counter;
    id = bytes + signing::command_key_id;
  } else {
    const std::uint8_t* record = signature_of(bytes, check_bytes_);
    if (record == nullptr || load_u32(record) != signing::ed25519 ||
        bound_unit(bytes, check_bytes_) == nullptr)
      return Refusal::not_signed;
    check_counter_ = load_u64(record + signing::record_counter);
    id = record + signing::record_key_id;
    end = static_cast<std::uint32_t>(signature_offset(check_bytes_));
    what = Signed::set;
  }
  const bool is_new = purpose_ == Purpose::verify || purpose_ == Purpose::commit;
  if (is_new && check_counter_ <= slots_.counter()) return Refusal::counter_used;
  return signature_.begin(trust_, what, bytes, end, id);
}

/// True where the set moves the tool by no more than the plausible change at one of the probe poses, which are spread over
/// the joint limits.
bool Store::plausible(const FirmwareModel& model, std::uint32_t pose, std::uint32_t& detail) const {
  FirmwareContext context = default_context<Scalar>(robot_);
  Joints q;
  for (std::size_t j = 0; j < joints; ++j) {
    const Scalar low = from_binary64<Scalar>(robot_.limits[j].min_rad);
    const Scalar high = from_binary64<Scalar>(robot_.limits[j].max_rad);
    q[j] = low + (high - low) * spread(pose, j);
    context.direction[j] = ((pose * 0x9E3779B9U) >> (8U + j)) & 1U ? Scalar(1) : Scalar(-1);
    context.relative_speed[j] = context.direction[j];
  }
  const RemainingError<Scalar> change = remaining_error(model, q, q, context);
  if (!(change.position_m <= settings_.plausible_position_m)) {
    detail = micro(change.position_m);
    return false;
  }
  if (change.is_beyond_right_angle || !(change.orientation_rad <= settings_.plausible_orientation_rad)) {
    detail = micro(change.orientation_rad);
    return false;
  }
  return true;
}

/// Ends a check in the background: what was verified is kept, committed or, of a rollback, made active.
void Store::checked(Refusal r, std::uint32_t detail) {
  if (purpose_ == Purpose::rollback) {
    if (r != Refusal::none || !is_in_staging(incoming_)) {
      previous_ = StoredSet{};
      finish(Answer::no_previous);
      return;
    }
    begin_commit();
    return;
  }
  if (is_command_ && r == Refusal::none) {
    permission_ = {owner_,  static_cast<Command>(load_u16(staging_.data() + signing::command_number)),
                   0,       true,
                   now_ms_, active_.crc};
    slots_.note_counter(check_counter_);
    job_ = Job::keep_counter;
    return;
  }
  const std::uint32_t ahead = header_.sequence - active_.sequence;
  if (r == Refusal::none &&
      (header_.sequence == 0 || (active_.sequence != 0 && (ahead == 0 || ahead > most_ahead)))) {
    r = header_.sequence != 0 && is_ahead(header_.sequence, active_.sequence) ? Refusal::sequence_too_far
                                                                              : Refusal::stale_sequence;
    detail = active_.sequence;
  }
  if (r != Refusal::none) {
    job_ = Job::none;
    release();
    refuse(r, detail);
    return;
  }
  incoming_.index = check_index_;
  incoming_.bytes = check_bytes_;
  incoming_.sequence = header_.sequence;
  incoming_.crc = load_u32(staging_.data() + check_bytes_ - 4);
  touched_ = true;
  if (purpose_ == Purpose::commit) {
    begin_commit();
    return;
  }
  job_ = Job::none;
  state_ = StoreState::verified;
  answer(Answer::accepted);
}

// --- staging ------------------------------------------------------------------------------------------

/// Whether a client that would begin a transfer has to wait for another one: each gets its turn, whoever hogs.
bool Store::must_wait(Origin origin) {
  const auto passed = [this](std::uint32_t since_ms) { return now_ms_ - since_ms; };
  if (waiting_ != nobody && passed(waiting_ms_) >= precedence_ms) waiting_ = nobody;
  const bool is_free = state_ == StoreState::idle || owns(origin);
  const bool has_stalled =
      (!touched_ && passed(touched_ms_) >= silent_ms) || passed(began_ms_) >= settings_.staging_timeout_ms;
  if (is_free && waiting_ != nobody && waiting_ != origin && origin == last_owner_) {
    release();
    return true;
  }
  if (!is_free && !has_stalled) {
    waiting_ = origin;
    waiting_ms_ = now_ms_;
    return true;
  }
  if (waiting_ == origin) waiting_ = nobody;
  return false;
}

Answer Store::begin(std::uint32_t length, Origin origin) {
  if (state_ == StoreState::trial) return answer(Answer::wrong_state);
  if (state_ == StoreState::working || must_wait(origin)) return answer(Answer::busy);
  if (state_ == StoreState::idle || !owns(origin)) began_ms_ = now_ms_;
  last_owner_ = origin;
  release();
  if (length > staging_bytes) return refuse(Refusal::too_long, staging_bytes);
  if (length == 0) return answer(Answer::bad_argument);
  state_ = StoreState::receiving;
  owner_ = origin;
  announced_ = length;
  touched_ = true;
  // Memory is written in whole units: the padding of the last one must not be bytes of an earlier image.
  std::memset(staging_.data(), 0xFF, staging_.size());
  return answer(Answer::accepted);
}

Answer Store::begin_unknown(Origin origin) {
  const Answer a = begin(staging_bytes, origin);
  length_known_ = a != Answer::accepted;
  return a;
}

Answer Store::write(std::uint32_t offset, const std::uint8_t* bytes, std::uint32_t size, Origin origin) {
  if (state_ != StoreState::idle && !owns(origin)) return answer(Answer::busy);
  if (state_ != StoreState::receiving) return answer(Answer::wrong_state);
  if (offset > staged_) return answer(Answer::bad_argument, staged_);
  if (offset > announced_ || size > announced_ - offset) {
    if (!length_known_) return refuse(Refusal::too_long, staging_bytes);
    return answer(Answer::bad_argument, announced_);
  }
  std::memcpy(staging_.data() + offset, bytes, size);
  // What has arrived before is no progress.
  if (offset + size > staged_) {
    staged_ = offset + size;
    touched_ = true;
  }
  return answer(Answer::accepted);
}

Answer Store::end(Origin origin) {
  if (state_ != StoreState::receiving || !owns(origin)) return answer(Answer::wrong_state);
  if (!length_known_) {
    announced_ = staged_;
    length_known_ = true;
  }
  if (staged_ != announced_) return answer(Answer::incomplete, staged_);
  return answer(Answer::accepted);
}

Answer Store::verify(Origin origin) {
  if (is_verifying() && owns(origin)) return answer(Answer::accepted);
  if (state_ == StoreState::working) return answer(Answer::busy);
  if (state_ != StoreState::receiving && state_ != StoreState::verified) return answer(Answer::wrong_state);
  if (!owns(origin)) return answer(Answer::busy);
  if (state_ == StoreState::verified) return answer(Answer::accepted);
  if (!length_known_ || staged_ != announced_) return answer(Answer::incomplete, staged_);
  std::uint32_t index = 0;
  if (!free_model(index)) return answer(Answer::busy);
  begin_check(announced_, index);
  purpose_ = Purpose::verify;
  job_ = Job::check;
  state_ = StoreState::working;
  return answer(Answer::accepted);
}

Answer Store::drop(Origin origin) {
  if (is_checking() && owns(origin)) {
    finish(Answer::accepted);
    return Answer::accepted;
  }
  if (state_ == StoreState::working ||
      (state_ != StoreState::idle && state_ != StoreState::trial && !owns(origin))) {
    return answer(Answer::busy);
  }
  if (state_ == StoreState::trial) return answer(Answer::wrong_state);
  release();
  return answer(Answer::accepted);
}

void Store::disconnect(Origin origin) {
  if (!owns(origin)) return;
  if (state_ == StoreState::receiving || state_ == StoreState::verified || is_verifying()) {
    job_ = Job::none;
    release();
  }
}

// --- commands that write non-volatile memory ----------------------------------------------------------

Answer Store::commit(Origin origin, bool trial, std::uint32_t cycles) {
  // A client that asked for verify may ask for commit before that has ended: it then follows by itself.
  const bool checking = is_verifying() && owns(origin);
  if (checking && check_ != Check::header && is_command_) return answer(Answer::wrong_state);
  const bool unverified = state_ == StoreState::receiving || checking;
  if (checking) {
    touched_ = true;
  } else if (unverified) {
    const Answer a = verify(origin);
    if (a != Answer::accepted) return a;
  } else {
    if (state_ == StoreState::working) return answer(Answer::busy);
    if (state_ != StoreState::verified) return answer(Answer::wrong_state);
    if (!owns(origin)) return answer(Answer::busy);
  }
  if (!slots_.is_readable() || !slots_.is_erasable() || !slots_.is_writable()) {
    finish(Answer::storage_failed);
    return Answer::storage_failed;
  }
  job_trial_ = trial;
  job_rollback_ = false;
  job_trial_cycles_ = cycles != 0 ? cycles : settings_.trial_cycles;
  if (job_trial_cycles_ == 0) job_trial_cycles_ = 1;
  if (unverified) {
    purpose_ = Purpose::commit;
  } else {
    begin_commit();
  }
  return answer(Answer::accepted);
}

/// Starts to write what was verified.
void Store::begin_commit() {
  incoming_.slot = slots_.target(active_.slot);
  incoming_.seals = 0;
  incoming_.generation = slots_.next_generation();
  state_ = StoreState::working;
  job_ = active_.slot == wire::no_slot ? Job::erase : Job::check_active;
  progress_ = 0;
  check_crc_ = 0;
  faults_ = static_cast<std::uint16_t>(faults_ & ~wire::fault::trial_reverted);
  // From here on the other slot holds nothing that a rollback could use.
  previous_ = StoredSet{};
}

Answer Store::confirm() {
  if (state_ == StoreState::working) return answer(Answer::busy);
  if (state_ != StoreState::trial) {
    const bool late = state_ == StoreState::idle && (faults_ & wire::fault::trial_reverted) != 0;
    return answer(late ? Answer::reverted : Answer::wrong_state);
  }
  if (!sets_.handover.settled()) return answer(Answer::busy);
  sets_.handover.confirm();
  state_ = StoreState::working;
  job_ = Job::await_confirm;
  return answer(Answer::accepted);
}

Answer Store::rollback() {
  if (state_ == StoreState::working) return answer(Answer::busy);
  if (state_ == StoreState::trial) {
    // The trial has no seal, so nothing needs to be erased.
    make_active(previous_);
    previous_ = StoredSet{};
    state_ = StoreState::idle;
    return answer(Answer::accepted);
  }
  if (state_ != StoreState::idle) return answer(Answer::busy);
  if (previous_.slot == wire::no_slot) return answer(Answer::no_previous);
  if (!slots_.is_erasable() || !slots_.is_writable()) return answer(Answer::storage_failed);
  std::uint32_t index = 0;
  if (!free_model(index)) return answer(Answer::busy);
  job_trial_ = false;
  job_rollback_ = true;
  incoming_ = previous_;
  incoming_.index = index;
  state_ = StoreState::working;
  job_ = Job::load;
  progress_ = 0;
  return answer(Answer::accepted);
}

Answer Store::restore() {
  if (state_ == StoreState::trial) return answer(Answer::wrong_state);
  if (state_ != StoreState::idle) return answer(Answer::busy);
  if (!slots_.is_erasable()) return answer(Answer::storage_failed);
  state_ = StoreState::working;
  incoming_ = StoredSet{};
  incoming_.slot = slots_.target(active_.slot);
  job_ = Job::clear_other;
  previous_ = StoredSet{};
  return answer(Answer::accepted);
}

/// An unlock in two steps, so that no single frame, and none that was recorded, opens what destroys sets.
Answer Store::unlock(std::uint32_t argument, Origin origin) {
  if (trust_.count != 0) return answer(Answer::not_authorised, wire::needs_signature);
  if (!has_polled_) return answer(Answer::busy);
  if (argument == 0) {
    // With the generation a number that was recorded does not come again once its command has been carried out.
    const std::uint32_t seed[4] = {++challenges_, now_ms_, slots_.generation(),
                                   load_u32(robot_.unit_hash.data())};
    std::uint8_t bytes[sizeof seed];
    std::memcpy(bytes, seed, sizeof seed);
    permission_ = {origin, Command::none, crc32(bytes, sizeof bytes) | 1U, false, now_ms_, active_.crc};
    return answer(Answer::accepted, permission_.challenge);
  }
  // The answer may be lost: the right number may come again.
  if (permission_.origin == origin && permission_.challenge == argument &&
      now_ms_ - permission_.since_ms < permission_ms) {
    permission_.is_given = true;
    return answer(Answer::accepted);
  }
  permission_ = Permission{};
  return answer(Answer::not_authorised, wire::needs_unlock);
}

/// Whether a client may run a command that destroys sets.
bool Store::has_permission(Command command, Origin origin) const {
  return permission_.origin == origin && permission_.is_given && permission_.active_crc == active_.crc &&
         now_ms_ - permission_.since_ms < permission_ms &&
         (permission_.command == command || (permission_.command == Command::none && trust_.count == 0));
}

Answer Store::run(Command command, std::uint32_t argument, Origin origin, bool is_authorised) {
  watch_trial();
  const bool destroys =
      command == Command::restore_defaults || (command == Command::rollback && state_ != StoreState::trial);
  if (destroys && origin != nobody && !is_authorised && !has_permission(command, origin))
    return answer(Answer::not_authorised, trust_.count != 0 ? wire::needs_signature : wire::needs_unlock);
  const Answer a = execute(command, argument, origin);
  // It is for one command, and for the next one.
  if (permission_.origin == origin && command != Command::none && command != Command::unlock &&
      a != Answer::busy)
    permission_ = Permission{};
  return a;
}

Answer Store::execute(Command command, std::uint32_t argument, Origin origin) {
  switch (command) {
    case Command::none:
      break;
    case Command::begin:
      return begin(argument, origin);
    case Command::verify:
      return verify(origin);
    case Command::commit:
      return commit(origin, false, 0);
    case Command::commit_trial:
      return commit(origin, true, argument);
    case Command::confirm:
      return confirm();
    case Command::rollback:
      return rollback();
    case Command::abort:
      return drop(origin);
    case Command::restore_defaults:
      return restore();
    case Command::unlock:
      return unlock(argument, origin);
  }
  return answer(Answer::unknown_command, static_cast<std::uint32_t>(command));
}

// --- background ---------------------------------------------------------------------------------------

void Store::make_active(const StoredSet& set) {
  sets_.handover.activate(set.index);
  active_ = set;
  if (set.index != Handover::none) {
    faults_ = static_cast<std::uint16_t>(faults_ & ~(wire::fault::no_valid_set | wire::fault::older_slot));
  } else {
    faults_ |= wire::fault::no_valid_set;
  }
}

void Store::finish(Answer a) {
  job_ = Job::none;
  release();
  answer(a);
}

void Store::fail() {
  faults_ |= wire::fault::storage;
  finish(Answer::storage_failed);
}

/// Records that a trial has run out in the cycle.
void Store::watch_trial() {
  if (state_ != StoreState::trial || !sets_.handover.settled() || !sets_.handover.reverted()) return;
  // The cycle has reverted by itself: there is no request to post.
  active_ = previous_;
  previous_ = StoredSet{};
  if (active_.index == Handover::none) faults_ |= wire::fault::no_valid_set;
  faults_ |= wire::fault::trial_reverted;
  finish(Answer::reverted);
}

void Store::work() {
  StorageResult r = StorageResult::done;
  switch (job_) {
    case Job::none:
      return;
    case Job::load: {
      const std::uint32_t left = incoming_.bytes - progress_;
      const std::uint32_t size = left < chunk_bytes ? left : chunk_bytes;
      if (slots_.read(incoming_.slot, progress_, staging_.data() + progress_, size) != StorageResult::done) {
        faults_ |= wire::fault::storage;
        previous_ = StoredSet{};
        finish(Answer::no_previous);
        return;
      }
      progress_ += size;
      if (progress_ != incoming_.bytes) return;
      begin_check(incoming_.bytes, incoming_.index);
      purpose_ = Purpose::rollback;
      job_ = Job::check;
      return;
    }
    case Job::check: {
      Refusal verdict = Refusal::none;
      std::uint32_t detail = 0;
      if (check_slice(verdict, detail)) checked(verdict, detail);
      return;
    }
    case Job::keep_counter:
      // It is used up also where the command never comes.
      r = slots_.keep_counter(active_.slot == wire::no_slot ? 0U : active_.slot);
      if (r == StorageResult::done) finish(Answer::accepted);
      if (r == StorageResult::failed) permission_ = Permission{};
      break;
    case Job::check_active: {
      // Until now the other slot may hold the only set that can still be read.
      std::uint8_t chunk[chunk_bytes];
      const std::uint32_t end = active_.bytes - std::uint32_t{image::crc_bytes};
      const std::uint32_t size = end - progress_ < chunk_bytes ? end - progress_ : chunk_bytes;
      r = slots_.read(active_.slot, progress_, chunk, size);
      if (r != StorageResult::done) break;
      check_crc_ = crc32(chunk, size, check_crc_);
      progress_ += size;
      if (progress_ != end) break;
      progress_ = 0;
      r = check_crc_ == active_.crc ? StorageResult::done : StorageResult::failed;
      if (r == StorageResult::done) job_ = Job::erase;
      break;
    }
    case Job::erase:
      r = slots_.erase(incoming_.slot);
      if (r == StorageResult::failed) break;
      if (r == StorageResult::done) job_ = Job::announce;
      break;
    case Job::announce: {
      // Used up, also where a trial ends without a confirm.
      if (check_signature_ != nullptr) slots_.note_counter(check_counter_);
      r = slots_.announce(incoming_);
      if (r == StorageResult::done) job_ = Job::write;
      break;
    }
    case Job::write: {
      const std::uint32_t end = rounded_up(incoming_.bytes);
      const std::uint32_t size = end - progress_ < chunk_bytes ? end - progress_ : chunk_bytes;
      r = slots_.write(incoming_.slot, progress_, staging_.data() + progress_, size);
      if (r == StorageResult::done) progress_ += size;
      if (progress_ == end) {
        progress_ = 0;
        job_ = Job::compare;
      }
      break;
    }
    case Job::compare: {
      std::uint8_t chunk[chunk_bytes];
      const std::uint32_t left = incoming_.bytes - progress_;
      const std::uint32_t size = left < chunk_bytes ? left : chunk_bytes;
      r = slots_.read(incoming_.slot, progress_, chunk, size);
      if (r == StorageResult::busy) r = StorageResult::failed;
      if (r == StorageResult::done && std::memcmp(chunk, staging_.data() + progress_, size) != 0) {
        r = StorageResult::failed;
      }
      if (r != StorageResult::done) break;
      progress_ += size;
      if (progress_ != incoming_.bytes) break;
      if (!job_trial_) {
        job_ = Job::seal;
        break;
      }
      previous_ = active_;
      sets_.handover.activate_on_trial(incoming_.index, active_.index, job_trial_cycles_);
      active_ = incoming_;
      finish(Answer::accepted);
      state_ = StoreState::trial;
      break;
    }
    case Job::await_confirm:
      if (!sets_.handover.settled()) return;
      if (sets_.handover.reverted()) {
        state_ = StoreState::trial;
        job_ = Job::none;
        watch_trial();
        return;
      }
      job_trial_ = true;
      job_ = Job::seal;
      break;
    case Job::seal:
      r = slots_.add_seal(incoming_);
      // With one seal the set counts, and the next start adds another.
      if (r == StorageResult::failed && incoming_.seals != 0)
        r = StorageResult::done;
      else if (r == StorageResult::done && incoming_.seals < Slots::enough_seals)
        break;
      if (r == StorageResult::failed) {
        // It may be incomplete: the active set must be the one that the next start would load.
        if (job_trial_) {
          make_active(previous_);
          previous_ = StoredSet{};
        }
        progress_ = 0;
        job_ = Job::void_incoming;
        return;
      }
      if (r != StorageResult::done) break;
      faults_ = 0;
      if (job_rollback_) {
        job_ = active_.slot == wire::no_slot ? Job::none : Job::drop_left;
        make_active(incoming_);
        previous_ = StoredSet{};
        if (job_ == Job::none) finish(Answer::accepted);
        break;
      }
      if (job_trial_) {
        active_ = incoming_;
      } else {
        previous_ = active_;
        make_active(incoming_);
      }
      previous_.index = Handover::none;
      finish(Answer::accepted);
      break;
    case Job::void_incoming:
      r = slots_.add_mark(incoming_.slot ^ 1U);
      if (r == StorageResult::busy) break;
      if (r == StorageResult::failed || ++progress_ == Slots::enough_marks) job_ = Job::drop_incoming;
      r = StorageResult::done;
      break;
    case Job::drop_incoming:
      r = slots_.erase(incoming_.slot);
      if (r == StorageResult::done) r = StorageResult::failed;  // the commit has failed in any case
      break;
    case Job::drop_left:
      r = slots_.erase(active_.slot ^ 1U);
      if (r == StorageResult::busy) break;
      if (r == StorageResult::failed) faults_ |= wire::fault::storage;
      finish(Answer::accepted);
      return;
    case Job::clear_other:
      r = slots_.erase(incoming_.slot);
      if (r != StorageResult::done) break;
      progress_ = 0;
      // Without a set the marks are there for the counter alone.
      job_ = active_.slot == wire::no_slot && slots_.counter() == 0 ? Job::clear_active : Job::void_active;
      break;
    case Job::void_active:
      r = slots_.add_mark(incoming_.slot);
      if (r == StorageResult::done && ++progress_ == Slots::enough_marks) job_ = Job::clear_active;
      break;
    case Job::clear_active:
      r = slots_.erase(incoming_.slot ^ 1U);
      if (r != StorageResult::done) break;
      make_active(StoredSet{});
      faults_ = wire::fault::no_valid_set;
      finish(Answer::accepted);
      break;
  }
  if (r == StorageResult::failed) fail();
}

void Store::poll(std::uint32_t now_ms) {
  now_ms_ = now_ms;
  has_polled_ = true;
  if (touched_) {
    touched_ = false;
    touched_ms_ = now_ms;
  }
  watch_trial();
  if (state_ == StoreState::working) {
    work();
  } else if ((state_ == StoreState::receiving || state_ == StoreState::verified) &&
             now_ms - touched_ms_ >= settings_.staging_timeout_ms) {
    release();
  }
}

bool Store::read_active(std::uint32_t offset, std::uint8_t* to, std::uint32_t size) {
  if (active_.slot == wire::no_slot || !slots_.is_readable()) return false;
  // Rollback and restore are erasing just this slot.
  if (job_ == Job::clear_active) return false;
  if (offset > active_.bytes || size > active_.bytes - offset) return false;
  if (slots_.read(active_.slot, offset, to, size) != StorageResult::done) {
    faults_ |= wire::fault::storage;
    return false;
  }
  return true;
}

/// The model that answers: after a trial that ran out a moment ago, the one that the cycle already uses.
std::uint32_t Store::used_model() const {
  return sets_.handover.settled() ? sets_.handover.in_use() : active_.index;
}

const FirmwareModel* Store::active_model() const {
  const std::uint32_t index = used_model();
  return index == Handover::none ? nullptr : &sets_.models[index];
}

const FirmwareCertificate* Store::active_certificate() const {
  const std::uint32_t index = used_model();
  return index == Handover::none ? nullptr : &sets_.certificates[index];
}

void Store::status(wire::Status& out) const {
  out.state = static_cast<std::uint16_t>(state_);
  out.answer = static_cast<std::uint16_t>(answer_);
  out.refusal = static_cast<std::uint16_t>(refusal_);
  out.faults = faults_;
  out.detail = detail_;
  out.active_slot = active_.slot;
  out.settled = sets_.handover.settled() ? 1 : 0;
  out.active_sequence = active_.sequence;
  out.active_bytes = active_.bytes;
  out.active_crc = active_.crc;
  out.previous_sequence = previous_.sequence;
  out.announced_bytes = announced_;
  out.staged_bytes = staged_;
  out.trial_cycles_left = sets_.handover.trial_cycles_left();
}

}  // namespace firmware
}  // namespace flexcomp
