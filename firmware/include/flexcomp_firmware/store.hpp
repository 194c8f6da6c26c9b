// SPDX-License-Identifier: Apache-2.0
/// \file
/// The parameter store: stages a parameter image, verifies it, writes it to non-volatile memory, activates
/// it, and loads it at the next start. One state machine for every bus.
///
/// Everything here runs in the background, in one thread; only the handover word and the models that the
/// cycle does not use are shared with the control cycle.
#ifndef FLEXCOMP_FIRMWARE_STORE_HPP
#define FLEXCOMP_FIRMWARE_STORE_HPP

#include <array>
#include <cstddef>
#include <cstdint>

#include "flexcomp/image.hpp"
#include "flexcomp/status.hpp"
#include "flexcomp/wire/store_state.hpp"
#include "flexcomp_firmware/config.hpp"
#include "flexcomp_firmware/control.hpp"
#include "flexcomp_firmware/signature_check.hpp"
#include "flexcomp_firmware/slots.hpp"

namespace flexcomp {
namespace firmware {

/// Settings of the store.
struct StoreSettings {
  /// A set that changes the pose at any of the probe poses by more than this is refused as implausible.
  Scalar plausible_position_m = Scalar(0.05);
  /// The same for the orientation, below pi / 2.
  Scalar plausible_orientation_rad = Scalar(0.1);
  /// A set whose bounds exceed these is refused by the name of a term (docs/compensation.md, section "Admission").
  AdmissionLimits<Scalar> limits{};
  /// What the context of a step may say; a negative member: as default_ranges() has it.
  AdmissionRanges<Scalar> ranges = undeclared_ranges<Scalar>();
  /// Control cycles of a trial where the command names none.
  std::uint32_t trial_cycles = 60000;
  /// Silence after which a transfer is discarded, ms.
  std::uint32_t staging_timeout_ms = 30000;
};

/// Client of the store: a bus, or one connection of it. No other client may touch what one has staged. Wide
/// enough for a new number with every connection.
using Origin = std::uint32_t;
constexpr Origin nobody = 0;  ///< no client, or local control

/// The store of one arm. All of it runs in the background; see the table of a slot at the top.
class Store {
 public:
  /// Without boot() there is no set.
  Store(const Robot& robot, ParameterSets& sets, const Storage& storage, const StoreSettings& settings);
  Store(const Store&) = delete;
  Store& operator=(const Store&) = delete;

  /// Before the control cycle starts: the highest valid sequence becomes active, else the other slot with the
  /// fault `older_slot`, else nothing with the fault `no_valid_set`. Must not be called again. It checks at once what
  /// poll() checks in slices.
  void boot();

  /// From now on only sets that are signed with one of these keys, and bound to this unit, are used. False, and nothing is changed,
  /// after boot().
  bool set_trust(const Trust& trust);

  /// Runs one command of the wire; its answer is also in status(). `is_authorised`: also rollback and restore_defaults, for which
  /// a client other than `nobody` needs an unlock or a signed command.
  wire::Answer run(wire::Command command, std::uint32_t argument, Origin origin, bool is_authorised = false);

  /// begin() for a transfer whose length is not known yet: end() follows.
  wire::Answer begin_unknown(Origin origin);

  /// Bytes of the image from `offset`. They may overlap what came before but leave no gap.
  wire::Answer write(std::uint32_t offset, const std::uint8_t* bytes, std::uint32_t size, Origin origin);

  /// Ends a transfer that began without a length: it is the number of bytes so far.
  wire::Answer end(Origin origin);

  /// Ends a connection: discards what it has staged. A commit being written is not touched.
  void disconnect(Origin origin);

  /// Reads the active image from its slot. False beyond its end, without a set, or where reading
  /// fails.
  bool read_active(std::uint32_t offset, std::uint8_t* to, std::uint32_t size);

  /// Background work; at most one storage call of 256 bytes, or a slice of a check of at most 20,000 instructions (Cortex-M7,
  /// default capacity), each time. now_ms wraps.
  void poll(std::uint32_t now_ms);

  /// Fills the fields of the store in the status record.
  void status(wire::Status& out) const;

  /// The prepared set that is active, or null; valid until the next poll() or run().
  const FirmwareModel* active_model() const;

  /// Bounds of the active set, or null; valid as active_model() is.
  const FirmwareCertificate* active_certificate() const;

  std::uint32_t active_bytes() const { return active_.bytes; }        ///< of the active image
  std::uint32_t active_sequence() const { return active_.sequence; }  ///< 0: none
  std::uint16_t active_slot() const { return active_.slot; }          ///< 0, 1 or wire::no_slot
  std::uint16_t faults() const { return faults_; }                    ///< bits of wire::fault
  std::uint32_t announced_bytes() const { return announced_; }        ///< of the staged image
  Refusal refusal() const { return refusal_; }                        ///< of the last command
  std::uint64_t counter() const { return slots_.counter(); }          ///< highest of an accepted signature
  const Trust& trust() const { return trust_; }                       ///< as set
  const StoreSettings& settings() const { return settings_; }         ///< as given
  const Sha256Digest& nominal_hash() const { return nominal_hash_; }  ///< of the robot

 private:
  enum class Job : std::uint8_t {
    none,
    load,           ///< rollback: read the set in the other slot
    check,          ///< verify, commit, rollback: the image in the staging memory, in slices
    keep_counter,   ///< of a signed command, before it holds
    check_active,   ///< commit, rollback: the set in use is still what it was
    erase,          ///< the slot that is not in use
    announce,       ///< the generation, before the image
    write,          ///< the image
    compare,        ///< read back
    seal,           ///< commit or confirm: three seals
    void_incoming,  ///< commit or confirm: marks, where writing a seal failed
    drop_incoming,  ///< the same: erase it
    await_confirm,  ///< confirm: until the cycle has ended the trial
    drop_left,      ///< rollback: erase the slot that is left behind
    clear_other,    ///< restore: erase the inactive slot
    void_active,    ///< restore: three marks in it
    clear_active,   ///< restore: then the active one
  };

  wire::Answer answer(wire::Answer a, std::uint32_t detail = 0);
  wire::Answer refuse(Refusal r, std::uint32_t detail = 0);
  wire::Answer begin(std::uint32_t length, Origin origin);
  wire::Answer verify(Origin origin);
  wire::Answer commit(Origin origin, bool trial, std::uint32_t cycles);
  wire::Answer confirm();
  wire::Answer rollback();
  wire::Answer restore();
  wire::Answer drop(Origin origin);
  wire::Answer unlock(std::uint32_t argument, Origin origin);
  bool has_permission(wire::Command command, Origin origin) const;
  wire::Answer execute(wire::Command command, std::uint32_t argument, Origin origin);
  bool must_wait(Origin origin);
  bool owns(Origin origin) const { return origin == owner_; }
  void release();
  bool free_model(std::uint32_t& index) const;
  /// What comes next in the check of an image; each is some slices.
  enum class Check : std::uint8_t {
    header,
    checksum,
    signature,
    records,
    chain,
    derivatives,
    size,
    probes,
    bounds,
    verdict
  };
  /// What a check is for.
  enum class Purpose : std::uint8_t { start, verify, commit, rollback };
  void begin_check(std::uint32_t size, std::uint32_t index);
  bool check_slice(Refusal& r, std::uint32_t& detail);
  /// Begins the check of a signature, or goes on with it; true where it has ended. Null without set_trust(): what it needs is
  /// then not linked.
  bool (*check_signature_)(Store& store, bool begins, Refusal& r) = nullptr;
  static bool check_signature(Store& store, bool begins, Refusal& r);
  Refusal begin_signature();
  void checked(Refusal r, std::uint32_t detail);
  void begin_commit();
  std::uint32_t used_model() const;
  bool plausible(const FirmwareModel& model, std::uint32_t pose, std::uint32_t& detail) const;
  void settle_start(const std::array<StoredSet, 2>& found);
  void erase_at_start(unsigned slot);
  bool add_at_start(StoredSet* set, unsigned slot);
  bool load(const StoredSet& set);
  bool is_in_staging(const StoredSet& set) const;
  /// A check that no commit waits for; its client may give it up.
  bool is_verifying() const { return job_ == Job::check && purpose_ == Purpose::verify; }
  /// A check after which nothing has been written yet.
  bool is_checking() const { return job_ == Job::check && purpose_ != Purpose::rollback; }
  void fail();
  void finish(wire::Answer a);
  void make_active(const StoredSet& set);
  void watch_trial();
  void work();

  const Robot robot_;
  const Sha256Digest nominal_hash_;
  ParameterSets& sets_;
  Slots slots_;
  const StoreSettings settings_;

  wire::StoreState state_ = wire::StoreState::idle;
  wire::Answer answer_ = wire::Answer::accepted;
  Refusal refusal_ = Refusal::none;
  std::uint32_t detail_ = 0;
  std::uint16_t faults_ = 0;
  Origin owner_ = nobody;
  bool length_known_ = true;
  bool touched_ = false;
  std::uint32_t touched_ms_ = 0;
  std::uint32_t announced_ = 0;
  std::uint32_t staged_ = 0;

  StoredSet active_{};
  StoredSet previous_{};  ///< what the other slot holds, or what a trial falls back to
  StoredSet incoming_{};  ///< what is verified, written or on trial
  Job job_ = Job::none;
  Check check_ = Check::header;
  Purpose purpose_ = Purpose::verify;
  std::uint32_t check_index_ = 0;  ///< of the model that the image is prepared in
  std::uint32_t check_bytes_ = 0;
  std::uint32_t check_crc_ = 0;      ///< of the bytes so far
  ImageHeader header_{};             ///< of the image that is checked
  std::uint64_t check_counter_ = 0;  ///< of its signature
  bool is_command_ = false;          ///< it is no image but a signed command
  ImageCursor cursor_{};
  Admission<Scalar, joints> admission_{};
  std::uint32_t progress_ = 0;
  bool job_trial_ = false;
  bool job_rollback_ = false;
  std::uint32_t job_trial_cycles_ = 0;

  Trust trust_{};
  SignatureCheck signature_{};
  std::uint32_t signature_since_ms_ = 0;
  /// Who may roll back or restore once.
  struct Permission {
    Origin origin = nobody;
    wire::Command command = wire::Command::none;  ///< the one that was signed; none: either
    std::uint32_t challenge = 0;                  ///< number that an unlock has to repeat
    bool is_given = false;                        ///< it was repeated, or the command was signed
    std::uint32_t since_ms = 0;
    std::uint32_t active_crc = 0;  ///< of the set that it ends
  };
  Permission permission_{};
  std::uint32_t challenges_ = 0;  ///< so far

  bool has_booted_ = false;
  bool has_polled_ = false;
  std::uint32_t now_ms_ = 0;    ///< of the last poll
  std::uint32_t began_ms_ = 0;  ///< the owner's first begin
  Origin last_owner_ = nobody;  ///< who staged last
  Origin waiting_ = nobody;     ///< who was told to wait for him
  std::uint32_t waiting_ms_ = 0;

  alignas(8) std::array<std::uint8_t, staging_bytes> staging_{};
};

}  // namespace firmware
}  // namespace flexcomp

#endif
