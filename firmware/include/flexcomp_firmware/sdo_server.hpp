// SPDX-License-Identifier: Apache-2.0
/// \file
/// One SDO server of a CANopen node (CiA 301, 7.2.4): expedited, segmented and block transfers of the objects that the node
/// has. A node has two, each with its own client.
#ifndef FLEXCOMP_FIRMWARE_SDO_SERVER_HPP
#define FLEXCOMP_FIRMWARE_SDO_SERVER_HPP

#include <array>
#include <cstddef>
#include <cstdint>

#include "flexcomp/wire/canopen_dictionary.hpp"
#include "flexcomp_firmware/store.hpp"

namespace flexcomp {
namespace firmware {

class CanopenNode;

/// Objects 0x2011 and 0x2020, of which each server has its own: what one client writes is not run or read by another.
struct ClientObjects {
  std::uint32_t argument = 0;                                           ///< of the next command
  std::uint16_t command = 0;                                            ///< the last one
  std::array<std::uint8_t, wire::probe_request_bytes> probe_request{};  ///< record
  std::uint16_t probe_flags = 0;  ///< of the response that was read last
  bool is_asked = false;          ///< whether it has been written
};

/// COB-IDs of a server; bit 31 (wire::canopen::not_valid) in either: there is none.
struct SdoIdentifiers {
  std::uint32_t request = wire::canopen::not_valid;  ///< client to server
  std::uint32_t answer = wire::canopen::not_valid;   ///< server to client
};

/// Bytes of the longest record that is copied when its transfer begins. The robot never changes and is read as it is sent.
constexpr std::size_t longest_copied_record() {
  std::size_t most = 0;
  for (const wire::canopen::Object& o : wire::canopen::objects) {
    if (o.index != wire::canopen::robot && o.size > most) most = o.size;
  }
  return most;
}

/// Server of one SDO channel. To the store it is the client `origin`.
class SdoServer {
 public:
  /// Of this node, which must outlive it.
  SdoServer(CanopenNode& node, Origin origin) : node_(node), origin_(origin) {}
  SdoServer(const SdoServer&) = delete;
  SdoServer& operator=(const SdoServer&) = delete;

  /// Ends the transfer without a word; argument and last command are forgotten.
  void reset(const SdoIdentifiers& identifiers);
  /// Whether a frame with this identifier is a request to this server.
  bool takes(std::uint16_t id) const { return id == request_id(); }
  /// COB-ID of requests; with bit 31 where there is no server.
  std::uint32_t request_id() const {
    return identifiers_.request | (identifiers_.answer & wire::canopen::not_valid);
  }
  /// Takes a request of 8 bytes; any are valid input.
  void request(const std::uint8_t* frame);
  /// Sends what was not taken and up to CanopenNode::segments_per_call segments of a block; ends a timed-out transfer.
  void poll(std::uint32_t now_ms);
  /// Ends the transfer and discards what it has staged.
  void forget();

  Origin origin() const { return origin_; }               ///< to the store
  SdoIdentifiers& identifiers() { return identifiers_; }  ///< COB-IDs
  ClientObjects& objects() { return objects_; }           ///< of its client

 private:
  enum class Transfer : std::uint8_t { none, download, upload, block_download, block_upload };
  enum class Block : std::uint8_t { initiated, segments, end };

  void begin_download(const std::uint8_t* frame);
  void download_segment(const std::uint8_t* frame);
  void begin_upload(const std::uint8_t* frame);
  void upload_segment(const std::uint8_t* frame);
  std::uint32_t start_upload(std::uint32_t& size);
  bool read_segment(std::uint32_t offset, std::uint8_t* to, std::uint32_t size);
  bool is_block_segment(const std::uint8_t* frame) const;
  bool is_leftover(const std::uint8_t* frame);
  std::uint8_t segments_taken() const;
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
  static bool is_small(const std::uint8_t* frame);
  void upload_beside(const std::uint8_t* frame);
  bool staging() const;
  void abort(std::uint32_t code);
  void abort_without_transfer();
  bool send(const std::uint8_t* frame);
  void reply(const std::uint8_t* frame);
  std::uint32_t code_of(wire::Answer a) const;

  CanopenNode& node_;
  const Origin origin_;
  SdoIdentifiers identifiers_{};
  ClientObjects objects_{};
  bool touched_ = false;
  std::uint32_t touched_ms_ = 0;

  Transfer transfer_ = Transfer::none;
  std::uint16_t index_ = 0;
  std::uint8_t sub_ = 0;
  bool toggle_ = false;
  bool size_known_ = false;
  std::uint32_t size_ = 0;
  std::uint32_t done_ = 0;
  std::uint32_t image_crc_ = 0;

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
  std::array<std::uint8_t, longest_copied_record()> scratch_{};
};

}  // namespace firmware
}  // namespace flexcomp

#endif
