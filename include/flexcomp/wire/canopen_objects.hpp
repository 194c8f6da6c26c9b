// SPDX-License-Identifier: Apache-2.0
/// \file
/// CANopen object dictionary (CiA 301). The records and commands are described in store_state.hpp, all
/// little-endian.
///
///     index  sub  type            access  what
///     0x1000   0  UNSIGNED32      const   device type: 0, no standard profile
///     0x1001   0  UNSIGNED8       ro      error register: bit 0 where the status record shows a fault
///     0x1003   0  UNSIGNED8       rw      faults in the list below; 0 written empties it
///            1-8  UNSIGNED32      ro      newest first: EMCY error code, faults of the status record << 16
///     0x1008   0  VISIBLE_STRING  const   manufacturer device name, "flexcomp"
///     0x100A   0  VISIBLE_STRING  const   manufacturer software version
///     0x1010   0  UNSIGNED8       const   2
///              1  UNSIGNED32      rw      "save" (0x65766173): commit what is staged; reads 1
///              2  UNSIGNED32      rw      "save": stores 0x1015 and 0x1017; reads 1, or 0 without memory for them
///     0x1011   0  UNSIGNED8       const   2
///              1  UNSIGNED32      rw      "load" (0x64616F6C): restore_defaults; reads 1
///              2  UNSIGNED32      rw      "load": 0x1015 and 0x1017 as built, from the next reset on; reads as 0x1010:2
///     0x1014   0  UNSIGNED32      rw      COB-ID of EMCY, 0x80 + node; bit 31: none is sent
///     0x1015   0  UNSIGNED16      rw      between two of them at least, 100 us
///     0x1017   0  UNSIGNED16      rw      producer heartbeat time, ms; 0: none
///     0x1018   0  UNSIGNED8       const   4
///              1  UNSIGNED32      ro      vendor id (0: none assigned)
///              2  UNSIGNED32      ro      product code
///              3  UNSIGNED32      ro      revision: firmware (major << 16 | minor << 8 | patch)
///              4  UNSIGNED32      ro      serial number: the first four bytes of its hash, without one of the name's
///     0x1200   0  UNSIGNED8       const   2
///              1  UNSIGNED32      ro      COB-ID of requests, 0x600 + node
///              2  UNSIGNED32      ro      COB-ID of answers, 0x580 + node
///     0x1201   0  UNSIGNED8       const   2
///              1  UNSIGNED32      rw      COB-ID of requests to the second server; bit 31: there is none
///              2  UNSIGNED32      rw      COB-ID of its answers; bit 31: there is none
///     0x1800   0  UNSIGNED8       const   5
///              1  UNSIGNED32      rw      COB-ID of the TPDO, 0x180 + node; bit 31: none is sent; bit 30: set
///              2  UNSIGNED8       rw      transmission type: 254 or 255, at events
///              3  UNSIGNED16      rw      between two of them at least, 100 us
///              5  UNSIGNED16      rw      event timer, ms: sent so long after the last one; 0: none
///     0x1A00   0  UNSIGNED8       const   4
///            1-4  UNSIGNED32      const   0x2002:8, 9, 4, 5
///     0x2000   0  DOMAIN          ro      capability record
///     0x2001   0  DOMAIN          ro      status record
///     0x2002   0  UNSIGNED8       const   9: status as single values
///              1  UNSIGNED16      ro      state (wire::StoreState)
///              2  UNSIGNED16      ro      answer to the last command (wire::Answer)
///              3  UNSIGNED16      ro      refusal of the last command (flexcomp::Refusal)
///              4  UNSIGNED16      ro      faults
///              5  UNSIGNED32      ro      sequence of the active set
///              6  UNSIGNED32      ro      detail
///              7  UNSIGNED32      ro      control cycles until a trial reverts
///              8  UNSIGNED8       ro      state, as sub 1
///              9  UNSIGNED8       ro      StepStatus of the last control cycle
///     0x2003   0  DOMAIN          ro      robot record (robot_record.hpp)
///     0x2004   0  DOMAIN          ro      certificate record of the active set (certificate_record.hpp)
///     0x2005   0  UNSIGNED8       const   9: certificate as single values
///              1  UNSIGNED32      ro      instructions of a step, at most
///              2  REAL32          ro      size of the set at the tool, at most, mm
///              3  REAL32          ro      the same, orientation, deg
///            4-9  REAL32          ro      deflection of joint 1 … 6, at most, deg
///     0x2006   0  DOMAIN          ro      unit record (unit_record.hpp)
///     0x2010   0  UNSIGNED8       const   2
///              1  DOMAIN          wo      image into staging
///              2  DOMAIN          ro      active image, byte for byte
///     0x2011   0  UNSIGNED8       const   2
///              1  UNSIGNED32      rw      argument of the next command
///              2  UNSIGNED16      rw      command (wire::Command): writing it runs it; reads the last one
///     0x2020   0  UNSIGNED8       const   3
///              1  DOMAIN          rw      probe request record
///              2  DOMAIN          ro      probe response record, by the set that is active when it is read
///              3  UNSIGNED16      ro      flags of that response (flexcomp::step_flag)
///     0x2021   0  UNSIGNED8       const   7: corrections
///            1-6  REAL32          ro      correction of joint 1 … 6 in the last control cycle, deg
///              7  REAL32          ro      largest correction of any joint since the start, deg
///
/// - A download to 0x2010:1 is `begin` and the bytes in one: an indicated size announces the length,
///   otherwise the length is known at the end. It goes to staging only; an aborted or timed-out transfer
///   leaves nothing behind. Then verify, commit and so on by 0x2011:2, or "save" by 0x1010:1.
/// - A command that is refused aborts the transfer with a code of abort_code(); 0x2001 says the rest. What comes
///   out in the background (verify, commit and so on) is only there: poll 0x2002:1 until it is not 3.
/// - CiA 301 lets restored defaults become valid at the next reset; here they do at once, by a bounded motion,
///   because between the two a controller would run a set that it can no longer read back.
/// - Communication parameters have 8 bytes of memory of their own, where the integrator gives it: version 1 u8, 0 u8,
///   0x1017 u16, 0x1015 u16, CRC-16 of these 6 bytes. They hold from the next reset on. 0x1010:1 does not store them: a
///   set is committed without a word on the network, and the other way round.
/// - EMCY (CiA 301, 7.2.7) is sent for each fault that appears, and with 0000h for those that disappear, in pre-operational and
///   operational; after a reset for those that are there. Bytes: error code u16, error register u8, faults of the
///   status record u16, refusal of the last command u16, 0.
/// - SDO is served in pre-operational and operational: expedited, segmented, and in blocks with CRC (CiA 301,
///   7.2.4.3). A sub-block of a download has at most most_segments, and sizes of sub-blocks alternate between
///   two numbers, so that a frame that comes twice is known.
/// - 0x1201 is a second server, for flexcomp beside a master that has 0x1200. Each has a transfer of its own, is a client of
///   its own to the store, and has 0x2011 and 0x2020 of its own.
/// - The TPDO is sent in operational only: at its start, when one of the mapped objects has changed, and after the event
///   timer. After a reset bit 31 is set: a node that sends what nobody has asked for is a surprise on a network.
#ifndef FLEXCOMP_WIRE_CANOPEN_OBJECTS_HPP
#define FLEXCOMP_WIRE_CANOPEN_OBJECTS_HPP

#include <array>
#include <cstdint>

#include "flexcomp/status.hpp"
#include "flexcomp/wire/store_state.hpp"

namespace flexcomp {
namespace wire {
namespace canopen {

// Indices of objects; see the table at the top.
constexpr std::uint16_t device_type = 0x1000;         ///< CiA 301, 7.5.2.1
constexpr std::uint16_t error_register = 0x1001;      ///< CiA 301, 7.5.2.2
constexpr std::uint16_t error_history = 0x1003;       ///< CiA 301, 7.5.2.4
constexpr std::uint8_t history_length = 8;            ///< errors in it, at most
constexpr std::uint16_t device_name = 0x1008;         ///< CiA 301, 7.5.2.8
constexpr std::uint16_t software_version = 0x100A;    ///< CiA 301, 7.5.2.10
constexpr std::uint16_t store_parameters = 0x1010;    ///< CiA 301, 7.5.2.13
constexpr std::uint16_t restore_parameters = 0x1011;  ///< CiA 301, 7.5.2.14
constexpr std::uint16_t emergency = 0x1014;           ///< COB-ID, CiA 301, 7.5.2.17
constexpr std::uint16_t emergency_inhibit = 0x1015;   ///< CiA 301, 7.5.2.18
constexpr std::uint8_t communication_parameters = 2;  ///< sub-index of the two: 0x1015 and 0x1017
constexpr std::uint32_t communication_bytes = 8;      ///< of their memory
constexpr std::uint16_t heartbeat_time = 0x1017;      ///< CiA 301, 7.5.2.20
constexpr std::uint16_t identity = 0x1018;            ///< CiA 301, 7.5.2.21
constexpr std::uint16_t sdo_server = 0x1200;          ///< CiA 301, 7.5.2.33
constexpr std::uint16_t sdo_channel = 0x1201;         ///< the second server, CiA 301, 7.5.2.33
constexpr std::uint16_t pdo = 0x1800;             ///< communication parameters of the TPDO, CiA 301, 7.5.2.37
constexpr std::uint8_t pdo_cob_id = 1;            ///< sub-index
constexpr std::uint8_t pdo_transmission = 2;      ///< sub-index: transmission type
constexpr std::uint8_t pdo_inhibit = 3;           ///< sub-index: inhibit time, 100 us
constexpr std::uint8_t pdo_timer = 5;             ///< sub-index: event timer, ms
constexpr std::uint16_t pdo_mapping = 0x1A00;     ///< of the TPDO, CiA 301, 7.5.2.38
constexpr std::uint16_t capability = 0x2000;      ///< capability record
constexpr std::uint16_t status = 0x2001;          ///< status record
constexpr std::uint16_t status_summary = 0x2002;  ///< status as single values
constexpr std::uint16_t image = 0x2010;           ///< parameter image
constexpr std::uint8_t image_staging = 1;         ///< sub-index: image into staging
constexpr std::uint8_t image_active = 2;          ///< sub-index: active image
constexpr std::uint16_t command = 0x2011;         ///< command and its argument
constexpr std::uint8_t command_argument = 1;      ///< sub-index: argument of the next command
constexpr std::uint8_t command_number = 2;        ///< sub-index: command
constexpr std::uint16_t probe = 0x2020;           ///< probe request and response
constexpr std::uint8_t probe_request = 1;         ///< sub-index: request record
constexpr std::uint8_t probe_response = 2;        ///< sub-index: response record
constexpr std::uint8_t probe_flags = 3;           ///< sub-index: flags of the response that was read last
constexpr std::uint16_t corrections = 0x2021;     ///< of the last control cycle

constexpr std::uint32_t save_signature = 0x65766173;  ///< "save", CiA 301 7.5.2.13
constexpr std::uint32_t load_signature = 0x64616F6C;  ///< "load", CiA 301 7.5.2.14
constexpr std::uint32_t product_code = 0x464C5831;    ///< "FLX1"

/// Segments of a sub-block, at most, where flexcomp chooses. With fewer than 64 no number of a segment looks like
/// the start of an upload (40h) or its answer (43h … 4Fh): a master that polls over the same channel is told apart.
constexpr std::uint8_t most_segments = 63;

/// Continues CRC-16 CCITT (x^16 + x^12 + x^5 + 1, from 0; CiA 301, 7.2.4.3.16) over more bytes.
inline std::uint16_t crc16(std::uint16_t crc, const std::uint8_t* bytes, std::uint32_t size) {
  constexpr std::uint16_t of_nibble[16] = {0x0000, 0x1021, 0x2042, 0x3063, 0x4084, 0x50A5, 0x60C6, 0x70E7,
                                           0x8108, 0x9129, 0xA14A, 0xB16B, 0xC18C, 0xD1AD, 0xE1CE, 0xF1EF};
  unsigned c = crc;
  for (std::uint32_t k = 0; k < size; ++k) {
    c = ((c << 4U) & 0xFFFFU) ^ of_nibble[(c >> 12U) ^ (bytes[k] >> 4U)];
    c = ((c << 4U) & 0xFFFFU) ^ of_nibble[(c >> 12U) ^ (bytes[k] & 15U)];
  }
  return static_cast<std::uint16_t>(c);
}

// COB-IDs of the pre-defined connection set (CiA 301, 7.3.5).
constexpr std::uint16_t nmt_id = 0x000;          ///< NMT commands, from the master
constexpr std::uint16_t emergency_id = 0x080;    ///< + node
constexpr std::uint16_t pdo_id = 0x180;          ///< + node, TPDO 1
constexpr std::uint16_t sdo_answer_id = 0x580;   ///< + node, server to client
constexpr std::uint16_t sdo_request_id = 0x600;  ///< + node, client to server
constexpr std::uint16_t heartbeat_id = 0x700;    ///< + node

/// NMT commands (CiA 301, 7.2.8.3.1).
enum class NmtCommand : std::uint8_t {
  start = 1,                    ///< enter operational
  stop = 2,                     ///< enter stopped
  enter_pre_operational = 128,  ///< enter pre-operational
  reset_node = 129,             ///< reset the node
  reset_communication = 130,    ///< reset its communication
};

/// NMT states as in the heartbeat (CiA 301, 7.2.8.3.2.2).
enum class NmtState : std::uint8_t {
  initialising = 0,       ///< also the boot-up message
  stopped = 4,            ///< no SDO
  operational = 5,        ///< SDO is served
  pre_operational = 127,  ///< SDO is served
};

/// EMCY error codes (CiA 301, table 26: 50xx hardware of the device, 63xx data set).
namespace emergency_code {
constexpr std::uint16_t none = 0x0000;     ///< faults have disappeared; the others stand in bytes 3 and 4
constexpr std::uint16_t storage = 0x5000;  ///< fault::storage
constexpr std::uint16_t no_valid_set = 0x6301;    ///< fault::no_valid_set
constexpr std::uint16_t older_slot = 0x6302;      ///< fault::older_slot
constexpr std::uint16_t trial_reverted = 0x6303;  ///< fault::trial_reverted
}  // namespace emergency_code

/// Bit 31 of a COB-ID in 0x1014, 0x1201 and 0x1800: it is not used.
constexpr std::uint32_t not_valid = 0x80000000;
/// Bit 30 of the COB-ID in 0x1800: the TPDO is not sent on a remote frame.
constexpr std::uint32_t no_remote_frames = 0x40000000;
/// Transmission type of the TPDO: 254 and 255, at events (CiA 301, 7.5.2.37).
constexpr std::uint8_t pdo_event_driven = 254;
/// Inhibit time of the TPDO after a reset, 100 us.
constexpr std::uint16_t pdo_inhibit_default = 1000;
/// What the TPDO holds: index, sub-index and bits of an object, in order.
constexpr std::array<std::uint32_t, 4> pdo_mapped = {0x20020808, 0x20020908, 0x20020410, 0x20020520};

/// Requests over 0x1201 where flexcomp chooses, for nodes 1 … 48; answers 30h above. The 96 identifiers from 680h to 6DFh are
/// neither restricted nor those of any node's pre-defined connection set (CiA 301, 7.3.5): two for each of 48 nodes.
constexpr std::uint16_t channel_request_id = 0x67F;  ///< + node
constexpr std::uint16_t channel_answer_id = 0x6AF;   ///< + node
constexpr std::uint8_t most_channels = 48;           ///< nodes that have them

/// Between two EMCY after a reset, 100 us.
constexpr std::uint16_t emergency_inhibit_default = 1000;

/// Whether a COB-ID is one of those that CiA 301, 7.3.5 keeps for itself.
constexpr bool is_restricted(std::uint32_t id) {
  return id <= 0x07F || (id >= 0x101 && id <= 0x180) || (id >= 0x581 && id <= 0x5FF) ||
         (id >= 0x601 && id <= 0x67F) || id >= 0x6E0;
}

/// SDO abort codes (CiA 301, table 22).
namespace abort {
constexpr std::uint32_t none = 0;                     ///< no abort
constexpr std::uint32_t toggle = 0x05030000;          ///< toggle bit not alternated
constexpr std::uint32_t timeout = 0x05040000;         ///< SDO protocol timed out
constexpr std::uint32_t command = 0x05040001;         ///< command specifier not valid or unknown
constexpr std::uint32_t block_size = 0x05040002;      ///< invalid block size
constexpr std::uint32_t sequence = 0x05040003;        ///< invalid sequence number, of a block
constexpr std::uint32_t crc = 0x05040004;             ///< CRC error, of a block transfer
constexpr std::uint32_t out_of_memory = 0x05040005;   ///< out of memory
constexpr std::uint32_t access = 0x06010000;          ///< unsupported access to an object
constexpr std::uint32_t write_only = 0x06010001;      ///< attempt to read a write-only object
constexpr std::uint32_t read_only = 0x06010002;       ///< attempt to write a read-only object
constexpr std::uint32_t no_object = 0x06020000;       ///< object does not exist
constexpr std::uint32_t incompatible = 0x06040043;    ///< general parameter incompatibility
constexpr std::uint32_t hardware = 0x06060000;        ///< access failed due to a hardware error
constexpr std::uint32_t length = 0x06070010;          ///< length of service parameter does not match
constexpr std::uint32_t too_long = 0x06070012;        ///< length of service parameter too high
constexpr std::uint32_t too_short = 0x06070013;       ///< length of service parameter too low
constexpr std::uint32_t no_sub_index = 0x06090011;    ///< sub-index does not exist
constexpr std::uint32_t value = 0x06090030;           ///< invalid value for parameter
constexpr std::uint32_t value_too_high = 0x06090031;  ///< value of parameter too high
constexpr std::uint32_t value_too_low = 0x06090032;   ///< value of parameter too low
constexpr std::uint32_t busy = 0x060A0023;            ///< resource not available
constexpr std::uint32_t general = 0x08000000;         ///< general error
constexpr std::uint32_t not_stored = 0x08000020;      ///< data cannot be transferred or stored
constexpr std::uint32_t local_control = 0x08000021;   ///< the same because of local control
constexpr std::uint32_t device_state = 0x08000022;    ///< the same because of the present device state
constexpr std::uint32_t no_data = 0x08000024;         ///< no data available
}  // namespace abort

/// SDO abort code of a refusal.
inline std::uint32_t abort_code(Refusal refusal) {
  switch (refusal) {
    case Refusal::none:
      return abort::none;
    case Refusal::truncated:
      return abort::too_short;
    case Refusal::bad_length:
    case Refusal::too_long:
      return abort::too_long;
    case Refusal::checksum:
      return abort::not_stored;
    case Refusal::bad_magic:
    case Refusal::schema:
    case Refusal::wrong_robot:
    case Refusal::wrong_nominal:
    case Refusal::unknown_record:
    case Refusal::unknown_basis:
    case Refusal::bad_place:
    case Refusal::mounting:
    case Refusal::not_allowed_covariate:
    case Refusal::wrong_unit:
      return abort::incompatible;
    case Refusal::bad_value:
      return abort::value;
    case Refusal::too_many_terms:
    case Refusal::table_too_large:
      return abort::out_of_memory;
    case Refusal::implausible:
    case Refusal::too_large:
    case Refusal::too_steep:
    case Refusal::too_compliant:
    case Refusal::sequence_too_far:
    case Refusal::too_costly:
      return abort::value_too_high;
    case Refusal::stale_sequence:
      return abort::value_too_low;
    case Refusal::not_signed:
    case Refusal::unknown_key:
    case Refusal::wrong_signature:
    case Refusal::counter_used:
      return abort::local_control;
  }
  return abort::general;
}

/// SDO abort code of an answer to a command, or of `refusal` where the answer is `refused`.
inline std::uint32_t abort_code(Answer answer, Refusal refusal) {
  switch (answer) {
    case Answer::accepted:
      return abort::none;
    case Answer::refused:
      return abort_code(refusal);
    case Answer::wrong_state:
    case Answer::no_previous:
    case Answer::reverted:
      return abort::device_state;
    case Answer::busy:
      return abort::busy;
    case Answer::not_authorised:
      return abort::local_control;
    case Answer::storage_failed:
      return abort::hardware;
    case Answer::incomplete:
      return abort::too_short;
    case Answer::unknown_command:
    case Answer::bad_argument:
      return abort::value;
  }
  return abort::general;
}

}  // namespace canopen
}  // namespace wire
}  // namespace flexcomp

#endif
