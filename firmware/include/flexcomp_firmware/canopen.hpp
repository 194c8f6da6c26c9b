// SPDX-License-Identifier: Apache-2.0
/// \file
/// CANopen node to CiA 301: NMT slave, boot-up, heartbeat and EMCY producer and one SDO server (expedited, segmented
/// and in blocks) with the object dictionary of canopen_objects.hpp. Frames come and go through callbacks; no I/O
/// in here.
#ifndef FLEXCOMP_FIRMWARE_CANOPEN_HPP
#define FLEXCOMP_FIRMWARE_CANOPEN_HPP

#include <array>
#include <cstddef>
#include <cstdint>

#include "flexcomp/wire/canopen_objects.hpp"
#include "flexcomp_firmware/device.hpp"

namespace flexcomp {
namespace firmware {

/// Hook that sends one data frame with an 11-bit identifier. False where the queue is full: the frame is
/// offered again at the next poll(), unless a newer answer replaces it.
struct CanTransmit {
  void* user = nullptr;  ///< given to the hook
  /// Sends, or returns false.
  bool (*send)(void* user, std::uint16_t id, const std::uint8_t* bytes, std::uint8_t size) = nullptr;
};

/// Non-volatile memory of wire::canopen::communication_bytes bytes for the communication parameters of a node; optional.
struct CanMemory {
  void* user = nullptr;  ///< given to both
  /// Copies the bytes that were saved; 0 where there are none.
  int (*load)(void* user, std::uint8_t* to) = nullptr;
  /// Keeps these bytes; 0 where that failed.
  int (*save)(void* user, const std::uint8_t* from) = nullptr;
};

/// Settings of a node.
struct CanopenSettings {
  std::uint8_t node = 1;                ///< 1 … 127
  std::uint16_t heartbeat_ms = 1000;    ///< producer heartbeat time after a reset; 0: none
  std::uint32_t sdo_timeout_ms = 2000;  ///< silence after which a transfer is aborted
  /// Segments that a client may send without an answer, 3 … 63: not more than the receive queue holds. 0: block
  /// transfer is refused, clients fall back to segments.
  std::uint8_t block_size = wire::canopen::most_segments;
};

/// One CANopen node on a device. `origin` must differ between the objects that share a device.
class CanopenNode {
 public:
  /// Starts in `initialising`; the first poll() sends the boot-up message.
  CanopenNode(Device& device, Origin origin, const CanopenSettings& settings, const CanTransmit& transmit);
  CanopenNode(const CanopenNode&) = delete;
  CanopenNode& operator=(const CanopenNode&) = delete;

  /// Takes a data frame with an 11-bit identifier (no remote frame) from the bus: NMT (CiA 301, 7.2.8) or SDO
  /// (7.2.4). Any bytes are valid input.
  void receive(std::uint16_t id, const std::uint8_t* bytes, std::size_t size);

  /// Sends boot-up message, heartbeat, frames that were not taken and up to segments_per_call segments of a block;
  /// ends timed-out transfers. now_ms wraps.
  void poll(std::uint32_t now_ms);

  /// Memory of the communication parameters; those that it holds take effect at once. Before the first poll().
  void set_memory(const CanMemory& memory);

  /// CanopenSettings::block_size of the downloads that begin from now on.
  void set_block_size(std::uint8_t segments) { settings_.block_size = segments; }

  /// NMT state.
  wire::canopen::NmtState state() const { return state_; }

  /// Segments of a block upload that one call sends, at most.
  static constexpr unsigned segments_per_call = 8;

 private:
  enum class Transfer : std::uint8_t { none, download, upload, block_download, block_upload };
  enum class Block : std::uint8_t { initiated, segments, end };

  void nmt(std::uint8_t command);
  void reset();
  void load_communication();
  std::uint32_t save_communication(bool defaults);
  void observe_faults();
  void send_emergency(std::uint32_t now_ms);
  std::uint32_t set_emergency_id(std::uint32_t id);
  void request(const std::uint8_t* frame);
  void begin_download(const std::uint8_t* frame);
  void download_segment(const std::uint8_t* frame);
  void begin_upload(const std::uint8_t* frame);
  void upload_segment(const std::uint8_t* frame);
  std::uint32_t start_upload(std::uint32_t& size);
  bool read_segment(std::uint32_t offset, std::uint8_t* to, std::uint32_t size);
  bool is_block_segment(const std::uint8_t* frame) const;
  bool is_leftover(const std::uint8_t* frame);
  void begin_block_download(const std::uint8_t* frame);
  void block_segment(const std::uint8_t* frame);
  void acknowledge(const std::uint8_t* frame);
  void end_block_download(const std::uint8_t* frame);
  void block_upload(const std::uint8_t* frame);
  void begin_block_upload(const std::uint8_t* frame);
  void block_acknowledged(const std::uint8_t* frame);
  void send_segments();
  void end_block_upload();
  std::uint32_t accept(std::uint32_t size, bool known);
  std::uint32_t take(const std::uint8_t* bytes, std::uint32_t size);
  std::uint32_t complete();
  std::uint32_t set(const std::uint8_t* bytes, std::uint32_t size);
  std::uint32_t get(std::uint32_t& size, std::uint8_t* out);
  static bool is_small(const std::uint8_t* frame);
  void upload_beside(const std::uint8_t* frame);
  std::uint32_t command(wire::Command command, std::uint32_t argument);
  bool staging() const;
  void forget();
  void abort(std::uint32_t code);
  void abort_without_transfer();
  void reply(const std::uint8_t* frame);
  std::uint32_t code_of(wire::Answer a) const;

  Device& device_;
  const Origin origin_;
  CanopenSettings settings_;
  const CanTransmit transmit_;
  CanMemory memory_{};
  wire::canopen::NmtState state_ = wire::canopen::NmtState::initialising;
  bool boot_up_ = true;
  bool touched_ = false;
  std::uint32_t touched_ms_ = 0;
  std::uint32_t heartbeat_ms_ = 0;  ///< when the last one was sent
  std::uint16_t heartbeat_time_ = 0;

  std::uint16_t faults_seen_ = 0;  ///< that are in the history
  std::uint16_t faults_told_ = 0;  ///< by EMCY, since the last reset
  bool inhibited_ = false;         ///< since emergency_ms_
  std::uint32_t emergency_ms_ = 0;
  std::uint32_t emergency_id_ = 0;
  std::uint16_t emergency_inhibit_ = 0;
  std::uint8_t history_size_ = 0;
  std::array<std::uint32_t, wire::canopen::history_length> history_{};

  Transfer transfer_ = Transfer::none;
  std::uint16_t index_ = 0;
  std::uint8_t sub_ = 0;
  bool toggle_ = false;
  bool size_known_ = false;
  std::uint32_t size_ = 0;
  std::uint32_t done_ = 0;
  std::uint32_t image_crc_ = 0;
  std::uint32_t argument_ = 0;
  std::uint16_t command_ = 0;

  Transfer repeatable_ = Transfer::none;   ///< whose segment_ the client may ask for again
  std::array<std::uint8_t, 8> segment_{};  ///< last request of a download, last answer of an upload

  // Of a block transfer.
  Block block_ = Block::initiated;
  bool with_crc_ = false;
  bool alternating_ = false;       ///< the client names another size of sub-block each time
  std::uint8_t block_size_ = 0;    ///< of the present sub-block, segments
  std::uint8_t sequence_ = 0;      ///< download: last segment taken; upload: last one sent
  std::uint8_t highest_ = 0;       ///< upload: last one ever sent of this sub-block
  std::uint8_t acknowledged_ = 0;  ///< download: of the sub-block before
  std::uint16_t crc_ = 0;          ///< of the first crc_bytes_
  std::uint32_t crc_bytes_ = 0;
  std::uint8_t leftover_ = 0;   ///< last segment that came after this node has aborted
  std::uint8_t leftovers_ = 0;  ///< the last one that may

  bool pending_ = false;
  std::array<std::uint8_t, 8> out_{};
  std::array<std::uint8_t, wire::robot_record_bytes> scratch_{};  ///< the longest record
  std::array<std::uint8_t, wire::probe_request_bytes> probe_request_{};
  std::array<std::uint8_t, wire::probe_response_bytes> probe_response_{};
};

}  // namespace firmware
}  // namespace flexcomp

#endif
