// SPDX-License-Identifier: Apache-2.0
/// \file
/// Modbus server: the PDU layer as a function from request to response (Modbus Application Protocol
/// V1.1b3) and the two framings as byte-stream machines (Modbus over Serial Line V1.02, Messaging on TCP/IP
/// V1.0b). No I/O in here.
#ifndef FLEXCOMP_FIRMWARE_MODBUS_HPP
#define FLEXCOMP_FIRMWARE_MODBUS_HPP

#include <array>
#include <cstddef>
#include <cstdint>

#include "flexcomp/wire/modbus_map.hpp"
#include "flexcomp_firmware/device.hpp"

namespace flexcomp {
namespace firmware {

/// The register map of modbus_map.hpp for one client: one object per serial line and per TCP connection.
class ModbusServer {
 public:
  /// `origin` must differ between the objects that share a device, and from `nobody`.
  ModbusServer(Device& device, Origin origin) : device_(device), origin_(origin) {}

  /// Answers one request PDU (function code and data) into `out`, which holds modbus::pdu_bytes. Returns the
  /// bytes of the answer; 0 only for an empty request. Any bytes are answered, by an exception where need be
  /// (V1.1b3, clause 7), and checked in the order quantity and byte count (03), addresses (02), then the
  /// application (04, 06).
  std::size_t answer(const std::uint8_t* request, std::size_t size, std::uint8_t* out);

  /// Carries out a request to all units of a serial line; what answer() would say is in `out` and must not be sent.
  /// Only functions 06 and 16 (V1.02, 2.1), and only to registers by which no set can be changed: one frame that
  /// anybody may send must not end what all arms of a line run on.
  std::size_t broadcast(const std::uint8_t* request, std::size_t size, std::uint8_t* out);

  /// Bits of wire::fault.
  std::uint16_t faults() const { return device_.store().faults(); }

  /// Ends a connection: discards what it has staged, resets offsets and probe.
  void disconnect();

 private:
  wire::modbus::Exception read(std::uint32_t address, std::uint32_t quantity, std::uint8_t* out);
  wire::modbus::Exception write(std::uint32_t address, std::uint32_t quantity, const std::uint8_t* from);
  wire::modbus::Exception apply(std::uint32_t address, std::uint32_t quantity, const std::uint8_t* from);
  std::size_t serve(const std::uint8_t* request, std::size_t size, std::uint8_t* out, bool is_broadcast);
  std::size_t report(std::size_t size, std::uint8_t* out) const;
  std::size_t identify(const std::uint8_t* request, std::size_t size, std::uint8_t* out) const;

  Device& device_;
  Origin origin_;
  std::uint32_t argument_ = 0;
  std::uint16_t command_ = 0;
  std::uint32_t staging_offset_ = 0;
  std::uint32_t reading_offset_ = 0;
  std::uint16_t trigger_ = 0;
  std::uint16_t probe_flags_ = 0;
  std::array<std::uint8_t, wire::probe_request_bytes> probe_request_{};
  std::array<std::uint8_t, wire::probe_response_bytes> probe_response_{};
};

/// CRC-16 of Modbus (V1.02, 6.2.2): x^16 + x^15 + x^2 + 1 reflected, init 0xFFFF ("123456789" -> 0x4B37).
/// Continues `crc` over more bytes; over a frame with its CRC it ends at 0.
std::uint16_t modbus_crc(const std::uint8_t* bytes, std::size_t size, std::uint16_t crc = 0xFFFF);

/// Hook that sends bytes: called from within receive() or poll(), at most once per request.
struct Transmit {
  void* user = nullptr;  ///< given to the hook
  /// Sends the bytes, or copies them.
  void (*send)(void* user, const std::uint8_t* bytes, std::size_t size) = nullptr;
};

/// RTU framing on a serial line. A frame ends where its function code says, or, with an unknown function code, at the gap.
/// Frames of other units are followed by their CRC.
///
/// Deviation from V1.02, 2.5.1.1: the standard ends a frame at 3.5 characters without a byte (1.75 ms above 19200 baud).
/// Where bytes arrive in bursts (USB adapters, emulators) that splits frames, hence the length; the gap only resynchronises
/// and may be several times longer. After noise, or where a frame was cut, a request is found
/// - at once where it comes after a silence of 1.75 ms, and ends with what has been received;
/// - else at the gap, as what remains at the end of the received bytes and has the right length and CRC.
///
/// It serves the functions of a serial line: Diagnostics (08) with its counters, Get Comm Event Counter (11).
class ModbusRtu {
 public:
  /// `unit` 1 … 247.
  ModbusRtu(ModbusServer& server, std::uint8_t unit, std::uint32_t gap_us, const Transmit& transmit)
      : server_(server), unit_(unit), gap_us_(gap_us), transmit_(transmit) {}

  /// Bytes from the line, received until `now_us` (wraps). The receiver must be off while the server sends.
  void receive(const std::uint8_t* bytes, std::size_t size, std::uint32_t now_us);

  /// Call often: ends frames at the gap.
  void poll(std::uint32_t now_us);

  /// Among the bytes last received characters were lost (`overrun`) or disturbed (parity, framing): the frame that they
  /// are of is not used where it is not whole yet; counted.
  void line_error(bool overrun);

 private:
  /// Counters of sub-functions 11 … 18 (V1.1b3, 6.8.1; V1.02, appendix A: CPT1 … CPT8); they wrap.
  enum class Counter : std::uint8_t {
    messages,    ///< 11: of the line, with a right CRC
    errors,      ///< 12: wrong CRC, too short, disturbed
    exceptions,  ///< 13: also those of broadcasts
    addressed,   ///< 14: to this unit or to all
    unanswered,  ///< 15: broadcasts, and all while it only listens
    nak,         ///< 16: never given
    busy,        ///< 17: exception 06
    overruns,    ///< 18: characters lost
    number,
  };
  std::uint16_t& count(Counter c) { return counters_[static_cast<std::size_t>(c)]; }

  bool is_ours(std::size_t from) const;
  std::size_t expected(std::size_t from) const;
  std::size_t diagnose(const std::uint8_t* request, std::size_t size, std::uint8_t* out);
  void gap();
  void take_frame(std::size_t from);
  void take_marked();
  void forget();
  void damaged();
  void make_room();
  bool is_mark(std::size_t at) const;
  void set_mark(std::size_t at);

  ModbusServer& server_;
  std::uint8_t unit_;
  std::uint32_t gap_us_;
  Transmit transmit_;
  std::uint32_t last_us_ = 0;
  std::size_t size_ = 0;
  std::uint16_t crc_ = 0xFFFF;
  bool lost_ = false;     ///< what stands at the beginning is no frame
  bool damaged_ = false;  ///< and has been counted
  bool overrun_ = false;  ///< more came in than a frame has, which has been counted
  bool marked_ = false;
  bool listens_only_ = false;
  std::uint16_t events_ = 0;
  std::array<std::uint16_t, static_cast<std::size_t>(Counter::number)> counters_{};
  std::array<std::uint8_t, wire::modbus::rtu_bytes / 8> marks_{};  ///< bits: bytes that came after a silence
  std::array<std::uint8_t, wire::modbus::rtu_bytes> frame_{};
};

/// TCP framing (MBAP header) of one connection.
class ModbusTcp {
 public:
  /// `unit` 0 … 255; units 0 and 255 are answered as well.
  ModbusTcp(ModbusServer& server, std::uint8_t unit, const Transmit& transmit)
      : server_(&server), unit_(unit), transmit_(transmit) {}

  /// Bytes from the stream, in any portions. False where the stream is not Modbus (a length that no PDU has): the
  /// connection must be closed, the next frame cannot be found. Frames of another protocol are discarded.
  bool receive(const std::uint8_t* bytes, std::size_t size);

 private:
  ModbusServer* server_;
  std::uint8_t unit_;
  Transmit transmit_;
  std::size_t size_ = 0;
  bool broken_ = false;
  std::array<std::uint8_t, wire::modbus::tcp_bytes> frame_{};
};

}  // namespace firmware
}  // namespace flexcomp

#endif
