// SPDX-License-Identifier: Apache-2.0
/// \file
/// CANopen node to CiA 301: NMT slave, boot-up, heartbeat and EMCY producer, one TPDO and two SDO servers with the object
/// dictionary of canopen_objects.hpp. Frames come and go through callbacks; no I/O in here.
#ifndef FLEXCOMP_FIRMWARE_CANOPEN_HPP
#define FLEXCOMP_FIRMWARE_CANOPEN_HPP

#include <array>
#include <cstddef>
#include <cstdint>

#include "flexcomp/wire/canopen_objects.hpp"
#include "flexcomp_firmware/device.hpp"
#include "flexcomp_firmware/sdo_server.hpp"

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

/// One CANopen node on a device. `origin` must differ between the objects that share a device, and is below
/// CanopenNode::second_origin; its second server is the client `origin` + second_origin.
class CanopenNode {
 public:
  /// Starts in `initialising`; the first poll() sends the boot-up message.
  CanopenNode(Device& device, Origin origin, const CanopenSettings& settings, const CanTransmit& transmit);
  CanopenNode(const CanopenNode&) = delete;
  CanopenNode& operator=(const CanopenNode&) = delete;

  static constexpr Origin second_origin = 0x40000000;  ///< see above

  /// Takes a data frame with an 11-bit identifier (no remote frame) from the bus: NMT (CiA 301, 7.2.8) or SDO
  /// (7.2.4). Any bytes are valid input.
  void receive(std::uint16_t id, const std::uint8_t* bytes, std::size_t size);

  /// Sends boot-up message, heartbeat, EMCY, TPDO, and what SdoServer::poll() sends of both servers. now_ms wraps.
  void poll(std::uint32_t now_ms);

  /// Memory of the communication parameters; those that it holds take effect at once. Before the first poll().
  void set_memory(const CanMemory& memory);

  /// CanopenSettings::block_size of the downloads that begin from now on.
  void set_block_size(std::uint8_t segments) { settings_.block_size = segments; }

  /// COB-IDs of the second SDO server (0x1201) from now on and after each reset; without this call there is none until the
  /// network sets it up. False, and none, where they are equal, restricted (CiA 301, 7.3.5) or in use here.
  bool set_channel(std::uint32_t request_id, std::uint32_t answer_id);

  /// COB-ID of requests to the second server, which the network may change; wire::canopen::not_valid: there is none. For
  /// a driver that filters.
  std::uint32_t channel_request() const { return servers_[1].request_id(); }

  /// NMT state.
  wire::canopen::NmtState state() const { return state_; }

  /// Segments of a block upload that one call sends for one server, at most.
  static constexpr unsigned segments_per_call = 8;

 private:
  friend class SdoServer;

  void nmt(std::uint8_t command);
  void reset();
  bool communicates() const;
  bool send(std::uint32_t id, const std::uint8_t* bytes, std::uint8_t size);
  void load_communication();
  std::uint32_t save_communication(bool defaults);
  void observe_faults();
  void send_emergency(std::uint32_t now_ms);
  void send_pdo(std::uint32_t now_ms);
  std::uint32_t set_pdo(std::uint8_t sub, const std::uint8_t* bytes);
  std::uint32_t set_identifier(std::uint32_t& which, std::uint32_t value, std::uint32_t fixed);
  std::uint32_t set(SdoServer& by, std::uint16_t index, std::uint8_t sub, const std::uint8_t* bytes,
                    std::uint32_t size);
  std::uint32_t get(SdoServer& by, std::uint16_t index, std::uint8_t sub, std::uint32_t& size,
                    std::uint8_t* out);
  std::uint32_t command(const SdoServer& by, wire::Command command, std::uint32_t argument);

  Device& device_;
  CanopenSettings settings_;
  const CanTransmit transmit_;
  CanMemory memory_{};
  wire::canopen::NmtState state_ = wire::canopen::NmtState::initialising;
  bool boot_up_ = true;
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

  std::uint32_t pdo_id_ = 0;  ///< 0x1800:1
  std::uint8_t pdo_type_ = 0;
  bool pdo_sent_ = false;  ///< since operational was entered
  std::uint16_t pdo_inhibit_ = 0;
  std::uint16_t pdo_timer_ms_ = 0;
  std::uint32_t pdo_ms_ = 0;           ///< when the last one was sent
  std::array<std::uint8_t, 8> pdo_{};  ///< the last one

  SdoIdentifiers channel_{};  ///< of the second server after a reset
  std::array<SdoServer, 2> servers_;
};

}  // namespace firmware
}  // namespace flexcomp

#endif
