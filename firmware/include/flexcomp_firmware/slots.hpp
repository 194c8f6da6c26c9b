// SPDX-License-Identifier: Apache-2.0
/// \file
/// Two slots of non-volatile memory, and what is written in them beside the images.
///
/// A slot holds the image from its first byte and, from its end backwards, up to five
/// equal seals of 32 bytes, before these an announcement and up to 14 marks:
///
///      seal                                    mark, announcement
///      0  "FLXS"                               0  "FLXM", "FLXB"
///      4  u32 bytes of the image               4  u32 generation
///      8  u32 sequence                         8  u64 counter
///     12  u32 CRC-32 of the image             16  12 bytes 0
///     16  u32 generation                      28  u32 CRC-32 of the 28 bytes before
///     20  u64 counter
///     28  u32 CRC-32 of the 28 bytes before
///
/// Every commit has a generation of its own, one above all before; of two sets the higher one is in use. A mark voids the
/// other slot's set up to its generation. A write or erase that the power cuts may read well at one start and badly at the next,
/// and where it reads as erased nothing shows that it was begun. Therefore
///
/// - a commit erases the slot that is not in use, announces its generation there, writes the image, reads it back, and seals it
///   three times. The first seal decides, and the announcement before it is there to be seen;
/// - a start that finds fewer seals than three adds two before it trusts the set; a start that finds an announcement
///   without a seal, or a seal that it does not trust, voids it by three marks in the other slot before anything is in use.
///   No later start decides otherwise: two of either are whole;
/// - one mark voids no set with two seals, so that a slot in use is erased only after three;
/// - of two slots the one that marks void is erased before the one with the marks;
/// - the set in use is read again before the other one is erased.
///
/// A set on trial has no seal until it is confirmed. Rollback commits the other set anew, then erases the slot that it leaves.
///
/// The counter is the highest of a signature that was accepted until then (flexcomp/signature.hpp). It outlasts each erase: where
/// only the slot that is to be erased has it, a mark of generation 0, which voids nothing, takes it into the other one before. Where that has
/// no place left (after some ten trials that all ended without a confirm) the announcement after the erase is the first to have it.
#ifndef FLEXCOMP_FIRMWARE_SLOTS_HPP
#define FLEXCOMP_FIRMWARE_SLOTS_HPP

#include <array>
#include <cstdint>

#include "flexcomp/image.hpp"
#include "flexcomp/wire/store_state.hpp"
#include "flexcomp_firmware/config.hpp"
#include "flexcomp_firmware/handover.hpp"

namespace flexcomp {
namespace firmware {

/// Result of a storage hook.
enum class StorageResult : std::int8_t {
  failed = -1,  ///< reported as a fault
  done = 0,     ///< complete
  busy = 1,     ///< erase and write only: not complete, the same call comes again
};

/// Non-volatile memory as the store needs it: two slots (0 and 1) of slot_bytes each. The hooks are called
/// from the background only. Where a hook is null nothing is stored and commits are refused.
struct Storage {
  void* user = nullptr;  ///< given to every hook
  /// Reads `size` bytes from `offset` of a slot; an unwritten slot may read as anything.
  StorageResult (*read)(void* user, unsigned slot, std::uint32_t offset, std::uint8_t* to,
                        std::uint32_t size) = nullptr;
  /// Makes a whole slot writable. When power goes meanwhile, any of its bytes may be old or erased.
  StorageResult (*erase)(void* user, unsigned slot) = nullptr;
  /// Writes `size` bytes (a multiple of 32, at most 256) at `offset` (a multiple of 32) of an erased slot;
  /// each byte is written once between two erases, save one whose writing the power has cut and that reads as erased: then
  /// anything may become of it. Done means that the bytes survive a power loss.
  StorageResult (*write)(void* user, unsigned slot, std::uint32_t offset, const std::uint8_t* from,
                         std::uint32_t size) = nullptr;
};

/// A set in a slot.
struct StoredSet {
  std::uint32_t index = Handover::none;  ///< of the model that is prepared from it
  std::uint16_t slot = wire::no_slot;    ///< 0, 1 or wire::no_slot
  std::uint32_t sequence = 0;            ///< of its image
  std::uint32_t bytes = 0;               ///< of its image
  std::uint32_t crc = 0;                 ///< of its image
  std::uint32_t generation = 0;          ///< of its commit
  std::uint8_t seals = 0;                ///< that can be read
};

/// The two slots; see the table at the top. Where a hook is null a call fails.
class Slots {
 public:
  static constexpr std::uint32_t unit_bytes = 32;  ///< memory is written in multiples of this
  static constexpr unsigned enough_seals = 3;      ///< of a set whose other slot may be erased
  static constexpr unsigned enough_marks = 3;      ///< that void a set for good

  /// Reads nothing yet.
  explicit Slots(const Storage& storage) : storage_(storage) {}

  bool is_readable() const { return storage_.read != nullptr; }   ///< sets can be read
  bool is_erasable() const { return storage_.erase != nullptr; }  ///< slots can be erased
  bool is_writable() const { return storage_.write != nullptr; }  ///< sets can be written

  /// Reads from a slot.
  StorageResult read(unsigned slot, std::uint32_t offset, std::uint8_t* to, std::uint32_t size) const {
    return storage_.read != nullptr ? storage_.read(storage_.user, slot, offset, to, size)
                                    : StorageResult::failed;
  }
  /// Writes a part of an image.
  StorageResult write(unsigned slot, std::uint32_t offset, const std::uint8_t* from,
                      std::uint32_t size) const {
    return storage_.write != nullptr ? storage_.write(storage_.user, slot, offset, from, size)
                                     : StorageResult::failed;
  }
  /// Erases a slot, marks and all; the other one has the counter then.
  StorageResult erase(unsigned slot);
  /// Writes the counter into a slot, where it is not there yet. Without a place left nothing is written.
  StorageResult keep_counter(unsigned slot);

  /// What the seals of both slots say, and their marks. At the start, before anything else.
  void survey(std::array<StoredSet, 2>& found);
  /// What the seals of a slot say; false where there is none.
  bool read_seals(unsigned slot, StoredSet& set);
  /// One more seal, at the next place that looks erased.
  StorageResult add_seal(StoredSet& set);
  /// Announces the commit of a generation in an erased slot.
  StorageResult announce(const StoredSet& set);
  /// Generation of the commit that was begun in a slot, whose image may be there; 0: none.
  std::uint32_t begun(unsigned slot);
  /// One mark that voids the other slot's set, of any generation there has been.
  StorageResult add_mark(unsigned slot) { return add_mark(slot, generation_); }
  /// Marks in the other slot that void a set.
  unsigned marks_against(const StoredSet& set) const;
  /// True where no marks void a set: one does not void what two seals say.
  bool is_counted(const StoredSet& set) const;
  /// The slot for a new set; where none is in use (`active` is wire::no_slot) the one that the other's marks void, so that
  /// the marks outlast it.
  std::uint16_t target(std::uint16_t active);

  /// A generation above all before.
  std::uint32_t next_generation() { return ++generation_; }
  /// Takes a generation that was seen into account.
  void note_generation(std::uint32_t seen) {
    if (seen > generation_) generation_ = seen;
  }
  std::uint32_t generation() const { return generation_; }  ///< highest one so far
  std::uint64_t counter() const { return counter_; }  ///< highest one that a seal, mark or announcement has
  /// Takes a counter into account; what is written from now on has it.
  void note_counter(std::uint64_t seen) {
    if (seen > counter_) counter_ = seen;
  }

 private:
  static constexpr unsigned most_marks = 14;
  static constexpr unsigned most_notes = 8;  ///< the other places are for marks that void a set
  StorageResult add_mark(unsigned slot, std::uint32_t generation);
  void note_counter_in(unsigned slot, std::uint64_t seen);
  bool read_unit(unsigned slot, std::uint32_t offset, std::uint8_t* unit) const;
  StorageResult write_unit(unsigned slot, std::uint32_t offset, const std::uint8_t* unit) const;
  void make_unit(const std::uint8_t* magic, std::uint32_t generation, std::uint8_t* unit) const;
  void read_marks(unsigned slot);

  /// Marks of a slot: those that are there, and the next place.
  struct Marks {
    std::array<std::uint32_t, most_marks> generation{};  ///< 0: none
    std::uint8_t next = 0;
  };
  const Storage storage_;
  std::array<Marks, 2> marks_{};
  std::uint32_t generation_ = 0;  ///< highest that a seal, an announcement or a mark has had
  std::uint64_t counter_ = 0;
  std::array<std::uint64_t, 2> counter_in_{};  ///< highest one in each slot
};

}  // namespace firmware
}  // namespace flexcomp

#endif
