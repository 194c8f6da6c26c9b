// SPDX-License-Identifier: Apache-2.0
#include "flexcomp_firmware/slots.hpp"

#include <cstring>

#include "flexcomp/bytes.hpp"
#include "flexcomp/crc32.hpp"

namespace flexcomp {
namespace firmware {

namespace {

constexpr std::uint32_t seal_bytes = Slots::unit_bytes;
constexpr unsigned most_seals = 5;
constexpr std::uint32_t begin_offset = slot_bytes - (most_seals + 1U) * seal_bytes;
constexpr std::uint32_t marks_offset = staging_bytes;
constexpr std::uint32_t seal_offset(unsigned copy) { return slot_bytes - (copy + 1U) * seal_bytes; }
constexpr std::uint32_t shortest_image = image::header_bytes + image::crc_bytes;
constexpr std::uint8_t seal_magic[4] = {'F', 'L', 'X', 'S'};
constexpr std::uint8_t mark_magic[4] = {'F', 'L', 'X', 'M'};
constexpr std::uint8_t begin_magic[4] = {'F', 'L', 'X', 'B'};

bool is_erased(const std::uint8_t* unit) {
  for (std::uint32_t k = 0; k < Slots::unit_bytes; ++k) {
    if (unit[k] != 0xFF) return false;
  }
  return true;
}

bool is_whole(const std::uint8_t* unit, const std::uint8_t* magic) {
  constexpr std::uint32_t end = Slots::unit_bytes - 4;
  return std::memcmp(unit, magic, 4) == 0 && crc32(unit, end) == load_u32(unit + end);
}

}  // namespace

bool Slots::read_unit(unsigned slot, std::uint32_t offset, std::uint8_t* unit) const {
  return read(slot, offset, unit, unit_bytes) == StorageResult::done;
}

/// A unit that holds a generation and the counter.
void Slots::make_unit(const std::uint8_t* magic, std::uint32_t generation, std::uint8_t* unit) const {
  std::memset(unit, 0, unit_bytes);
  std::memcpy(unit, magic, 4);
  store_u32(unit + 4, generation);
  store_u64(unit + 8, counter_);
  store_u32(unit + unit_bytes - 4, crc32(unit, unit_bytes - 4));
}

/// Writes a unit and reads it back. A unit that the power has cut may only look erased: then it fails.
StorageResult Slots::write_unit(unsigned slot, std::uint32_t offset, const std::uint8_t* unit) const {
  const StorageResult r = write(slot, offset, unit, unit_bytes);
  if (r != StorageResult::done) return r;
  std::uint8_t back[unit_bytes];
  return read_unit(slot, offset, back) && std::memcmp(back, unit, unit_bytes) == 0 ? r
                                                                                   : StorageResult::failed;
}

bool Slots::read_seals(unsigned slot, StoredSet& set) {
  for (unsigned copy = 0; copy < most_seals; ++copy) {
    std::uint8_t seal[seal_bytes];
    if (!read_unit(slot, seal_offset(copy), seal) || !is_whole(seal, seal_magic)) continue;
    const StoredSet found = {Handover::none,
                             static_cast<std::uint16_t>(slot),
                             load_u32(seal + 8),
                             load_u32(seal + 4),
                             load_u32(seal + 12),
                             load_u32(seal + 16),
                             1};
    if (found.bytes < shortest_image || found.bytes > staging_bytes) continue;
    note_counter_in(slot, load_u64(seal + 20));
    if (set.seals == 0) set = found;
    // Others than the first can only be what is left of an erase.
    if (found.crc == set.crc && found.generation == set.generation && set.seals < most_seals && copy != 0 &&
        found.sequence == set.sequence && set.slot == slot) {
      ++set.seals;
    }
  }
  return set.seals != 0;
}

StorageResult Slots::add_seal(StoredSet& set) {
  std::uint8_t seal[seal_bytes] = {};
  std::memcpy(seal, seal_magic, sizeof seal_magic);
  store_u32(seal + 4, set.bytes);
  store_u32(seal + 8, set.sequence);
  store_u32(seal + 12, set.crc);
  store_u32(seal + 16, set.generation);
  store_u64(seal + 20, counter_);
  store_u32(seal + seal_bytes - 4, crc32(seal, seal_bytes - 4));
  for (unsigned copy = 0; copy < most_seals; ++copy) {
    std::uint8_t there[seal_bytes];
    if (!read_unit(set.slot, seal_offset(copy), there) || !is_erased(there)) continue;
    const StorageResult r = write_unit(set.slot, seal_offset(copy), seal);
    if (r == StorageResult::done) {
      ++set.seals;
      counter_in_[set.slot] = counter_;
    }
    if (r != StorageResult::failed) return r;
  }
  return StorageResult::failed;
}

void Slots::read_marks(unsigned slot) {
  static_assert(most_marks == (begin_offset - marks_offset) / unit_bytes, "a place for each mark");
  Marks& marks = marks_[slot];
  marks = Marks{};
  for (unsigned k = 0; k < most_marks; ++k) {
    std::uint8_t mark[unit_bytes];
    const bool is_read = read_unit(slot, marks_offset + k * unit_bytes, mark);
    if (is_read && is_erased(mark)) continue;
    marks.next = static_cast<std::uint8_t>(k + 1);
    if (!is_read || !is_whole(mark, mark_magic)) continue;
    marks.generation[k] = load_u32(mark + 4);
    note_generation(marks.generation[k]);
    note_counter_in(slot, load_u64(mark + 8));
  }
}

unsigned Slots::marks_against(const StoredSet& set) const {
  unsigned count = 0;
  for (const std::uint32_t generation : marks_[set.slot ^ 1U].generation) {
    if (generation != 0 && generation >= set.generation) ++count;
  }
  return count;
}

void Slots::note_counter_in(unsigned slot, std::uint64_t seen) {
  if (seen > counter_in_[slot]) counter_in_[slot] = seen;
  note_counter(seen);
}

StorageResult Slots::keep_counter(unsigned slot) {
  if (counter_in_[slot] >= counter_ || marks_[slot].next >= most_notes) return StorageResult::done;
  return add_mark(slot, 0);
}

StorageResult Slots::add_mark(unsigned slot, std::uint32_t generation) {
  std::uint8_t mark[unit_bytes];
  make_unit(mark_magic, generation, mark);
  Marks& marks = marks_[slot];
  while (marks.next < most_marks) {
    const unsigned k = marks.next;
    const StorageResult r = write_unit(slot, marks_offset + k * unit_bytes, mark);
    if (r == StorageResult::busy) return r;
    ++marks.next;
    if (r == StorageResult::failed) continue;
    marks.generation[k] = generation;
    counter_in_[slot] = counter_;
    return r;
  }
  return StorageResult::failed;
}

std::uint32_t Slots::begun(unsigned slot) {
  std::uint8_t unit[unit_bytes];
  if (!read_unit(slot, begin_offset, unit) || !is_whole(unit, begin_magic)) return 0;
  note_counter_in(slot, load_u64(unit + 8));
  return load_u32(unit + 4);
}

bool Slots::is_counted(const StoredSet& set) const {
  const unsigned against = marks_against(set);
  return set.seals != 0 && (against == 0 || (against == 1 && set.seals > 1));
}

StorageResult Slots::announce(const StoredSet& set) {
  std::uint8_t unit[unit_bytes];
  make_unit(begin_magic, set.generation, unit);
  const StorageResult r = write_unit(set.slot, begin_offset, unit);
  if (r == StorageResult::done) counter_in_[set.slot] = counter_;
  return r;
}

StorageResult Slots::erase(unsigned slot) {
  if (storage_.erase == nullptr) return StorageResult::failed;
  if (counter_in_[slot] > counter_in_[slot ^ 1U] && keep_counter(slot ^ 1U) == StorageResult::busy)
    return StorageResult::busy;
  const StorageResult r = storage_.erase(storage_.user, slot);
  if (r == StorageResult::failed) return r;
  marks_[slot] = Marks{};
  counter_in_[slot] = 0;
  return r;
}

void Slots::survey(std::array<StoredSet, 2>& found) {
  for (unsigned slot = 0; slot < 2; ++slot) {
    found[slot].slot = static_cast<std::uint16_t>(slot);
    read_seals(slot, found[slot]);
    note_generation(found[slot].generation);
  }
  for (unsigned slot = 0; slot < 2; ++slot) {
    read_marks(slot);
    begun(slot);
  }
}

std::uint16_t Slots::target(std::uint16_t active) {
  if (active != wire::no_slot) return static_cast<std::uint16_t>(active ^ 1U);
  for (std::uint16_t slot = 0; slot < 2; ++slot) {
    StoredSet seen;
    seen.slot = slot;
    const bool is_sealed = read_seals(slot, seen);
    if ((is_sealed && !is_counted(seen)) || (!is_sealed && begun(slot) != 0)) return slot;
  }
  for (std::uint16_t slot = 0; slot < 2; ++slot) {
    for (const std::uint32_t mark : marks_[slot ^ 1U].generation) {
      if (mark != 0) return slot;
    }
  }
  return 0;
}

}  // namespace firmware
}  // namespace flexcomp
