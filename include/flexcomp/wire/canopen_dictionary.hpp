// SPDX-License-Identifier: Apache-2.0
/// \file
/// The object dictionary of canopen_objects.hpp as a table: type, access, size and name of every object. The
/// firmware serves it, the host writes its electronic data sheet (CiA 306).
#ifndef FLEXCOMP_WIRE_CANOPEN_DICTIONARY_HPP
#define FLEXCOMP_WIRE_CANOPEN_DICTIONARY_HPP

#include <cstddef>
#include <cstdint>

#include "flexcomp/wire/canopen_objects.hpp"
#include "flexcomp/wire/certificate_record.hpp"
#include "flexcomp/wire/robot_record.hpp"
#include "flexcomp/wire/store_state.hpp"
#include "flexcomp/wire/unit_record.hpp"

namespace flexcomp {
namespace wire {
namespace canopen {

/// Data types by their index in the dictionary (CiA 301, table 44).
enum class Type : std::uint8_t {
  u8 = 0x05,      ///< UNSIGNED8
  u16 = 0x06,     ///< UNSIGNED16
  u32 = 0x07,     ///< UNSIGNED32
  real32 = 0x08,  ///< REAL32
  text = 0x09,    ///< VISIBLE_STRING
  domain = 0x0F,  ///< DOMAIN
};

/// Access to an object.
enum class Access : std::uint8_t {
  constant,  ///< read-only, and never another value
  ro,        ///< read only
  wo,        ///< write only
  rw         ///< read and write
};

/// One object, or one sub-index of it.
struct Object {
  std::uint16_t index;  ///< of the object
  std::uint8_t sub;     ///< sub-index, 0 where there is one value only
  Type type;            ///< of the value
  Access access;        ///< by SDO
  std::uint16_t size;   ///< bytes; 0 where they vary
  const char* name;     ///< in the EDS; of the record itself: record_name()
};

/// All objects, by index and sub-index.
constexpr Object objects[] = {
    {device_type, 0, Type::u32, Access::constant, 4, "Device type"},
    {error_register, 0, Type::u8, Access::ro, 1, "Error register"},
    {error_history, 0, Type::u8, Access::rw, 1, "Number of errors"},
    {error_history, 1, Type::u32, Access::ro, 4, "Error 1, the newest"},
    {error_history, 2, Type::u32, Access::ro, 4, "Error 2"},
    {error_history, 3, Type::u32, Access::ro, 4, "Error 3"},
    {error_history, 4, Type::u32, Access::ro, 4, "Error 4"},
    {error_history, 5, Type::u32, Access::ro, 4, "Error 5"},
    {error_history, 6, Type::u32, Access::ro, 4, "Error 6"},
    {error_history, 7, Type::u32, Access::ro, 4, "Error 7"},
    {error_history, 8, Type::u32, Access::ro, 4, "Error 8"},
    {device_name, 0, Type::text, Access::constant, 0, "Manufacturer device name"},
    {software_version, 0, Type::text, Access::constant, 0, "Manufacturer software version"},
    {store_parameters, 0, Type::u8, Access::constant, 1, "Highest sub-index"},
    {store_parameters, 1, Type::u32, Access::rw, 4, "Save all parameters: commit what is staged"},
    {store_parameters, communication_parameters, Type::u32, Access::rw, 4, "Save communication parameters"},
    {restore_parameters, 0, Type::u8, Access::constant, 1, "Highest sub-index"},
    {restore_parameters, 1, Type::u32, Access::rw, 4, "Restore all defaults: erase both sets"},
    {restore_parameters, communication_parameters, Type::u32, Access::rw, 4,
     "Restore default communication parameters"},
    {emergency, 0, Type::u32, Access::rw, 4, "COB-ID EMCY"},
    {emergency_inhibit, 0, Type::u16, Access::rw, 2, "Inhibit time EMCY, 100 us"},
    {heartbeat_time, 0, Type::u16, Access::rw, 2, "Producer heartbeat time, ms"},
    {identity, 0, Type::u8, Access::constant, 1, "Highest sub-index"},
    {identity, 1, Type::u32, Access::ro, 4, "Vendor-ID"},
    {identity, 2, Type::u32, Access::ro, 4, "Product code"},
    {identity, 3, Type::u32, Access::ro, 4, "Revision number"},
    {identity, 4, Type::u32, Access::ro, 4, "Serial number: first bytes of its hash"},
    {sdo_server, 0, Type::u8, Access::constant, 1, "Highest sub-index"},
    {sdo_server, 1, Type::u32, Access::ro, 4, "COB-ID client to server"},
    {sdo_server, 2, Type::u32, Access::ro, 4, "COB-ID server to client"},
    {sdo_channel, 0, Type::u8, Access::constant, 1, "Highest sub-index"},
    {sdo_channel, 1, Type::u32, Access::rw, 4, "COB-ID client to server"},
    {sdo_channel, 2, Type::u32, Access::rw, 4, "COB-ID server to client"},
    {pdo, 0, Type::u8, Access::constant, 1, "Highest sub-index"},
    {pdo, pdo_cob_id, Type::u32, Access::rw, 4, "COB-ID"},
    {pdo, pdo_transmission, Type::u8, Access::rw, 1, "Transmission type"},
    {pdo, pdo_inhibit, Type::u16, Access::rw, 2, "Inhibit time, 100 us"},
    {pdo, pdo_timer, Type::u16, Access::rw, 2, "Event timer, ms"},
    {pdo_mapping, 0, Type::u8, Access::constant, 1, "Number of mapped objects"},
    {pdo_mapping, 1, Type::u32, Access::constant, 4, "Mapped object 1"},
    {pdo_mapping, 2, Type::u32, Access::constant, 4, "Mapped object 2"},
    {pdo_mapping, 3, Type::u32, Access::constant, 4, "Mapped object 3"},
    {pdo_mapping, 4, Type::u32, Access::constant, 4, "Mapped object 4"},
    {capability, 0, Type::domain, Access::ro, capability_bytes, "Capability record"},
    {status, 0, Type::domain, Access::ro, status_bytes, "Status record"},
    {status_summary, 0, Type::u8, Access::constant, 1, "Highest sub-index"},
    {status_summary, 1, Type::u16, Access::ro, 2, "State of the parameter store"},
    {status_summary, 2, Type::u16, Access::ro, 2, "Answer to the last command"},
    {status_summary, 3, Type::u16, Access::ro, 2, "Refusal of the last command"},
    {status_summary, 4, Type::u16, Access::ro, 2, "Faults"},
    {status_summary, 5, Type::u32, Access::ro, 4, "Sequence of the active set"},
    {status_summary, 6, Type::u32, Access::ro, 4, "Detail"},
    {status_summary, 7, Type::u32, Access::ro, 4, "Control cycles until a trial reverts"},
    {status_summary, 8, Type::u8, Access::ro, 1, "State of the parameter store, 8 bits"},
    {status_summary, 9, Type::u8, Access::ro, 1, "Status of the last control cycle"},
    {robot, 0, Type::domain, Access::ro, robot_record_bytes, "Robot record"},
    {certificate, 0, Type::domain, Access::ro, certificate_bytes, "Certificate record"},
    {certificate_summary, 0, Type::u8, Access::constant, 1, "Highest sub-index"},
    {certificate_summary, 1, Type::u32, Access::ro, 4, "Instructions of a step, at most"},
    {certificate_summary, 2, Type::real32, Access::ro, 4, "Size of the set at the tool, at most, mm"},
    {certificate_summary, 3, Type::real32, Access::ro, 4, "Turn of the tool by the set, at most, deg"},
    {certificate_summary, 4, Type::real32, Access::ro, 4, "Deflection of joint 1, at most, deg"},
    {certificate_summary, 5, Type::real32, Access::ro, 4, "Deflection of joint 2, at most, deg"},
    {certificate_summary, 6, Type::real32, Access::ro, 4, "Deflection of joint 3, at most, deg"},
    {certificate_summary, 7, Type::real32, Access::ro, 4, "Deflection of joint 4, at most, deg"},
    {certificate_summary, 8, Type::real32, Access::ro, 4, "Deflection of joint 5, at most, deg"},
    {certificate_summary, 9, Type::real32, Access::ro, 4, "Deflection of joint 6, at most, deg"},
    {unit, 0, Type::domain, Access::ro, unit_record_bytes, "Unit record"},
    {image, 0, Type::u8, Access::constant, 1, "Highest sub-index"},
    {image, image_staging, Type::domain, Access::wo, 0, "Parameter image into staging"},
    {image, image_active, Type::domain, Access::ro, 0, "Active parameter image"},
    {command, 0, Type::u8, Access::constant, 1, "Highest sub-index"},
    {command, command_argument, Type::u32, Access::rw, 4, "Argument of the next command"},
    {command, command_number, Type::u16, Access::rw, 2, "Command: writing runs it"},
    {probe, 0, Type::u8, Access::constant, 1, "Highest sub-index"},
    {probe, probe_request, Type::domain, Access::rw, probe_request_bytes, "Probe request record"},
    {probe, probe_response, Type::domain, Access::ro, probe_response_bytes, "Probe response record"},
    {probe, probe_flags, Type::u16, Access::ro, 2, "Flags of the probe response that was read last"},
    {corrections, 0, Type::u8, Access::constant, 1, "Highest sub-index"},
    {corrections, 1, Type::real32, Access::ro, 4, "Correction of joint 1 in the last cycle, deg"},
    {corrections, 2, Type::real32, Access::ro, 4, "Correction of joint 2 in the last cycle, deg"},
    {corrections, 3, Type::real32, Access::ro, 4, "Correction of joint 3 in the last cycle, deg"},
    {corrections, 4, Type::real32, Access::ro, 4, "Correction of joint 4 in the last cycle, deg"},
    {corrections, 5, Type::real32, Access::ro, 4, "Correction of joint 5 in the last cycle, deg"},
    {corrections, 6, Type::real32, Access::ro, 4, "Correction of joint 6 in the last cycle, deg"},
    {corrections, 7, Type::real32, Access::ro, 4, "Largest correction of any joint since the start, deg"},
};
/// Number of entries of `objects`.
constexpr std::size_t object_count = sizeof objects / sizeof objects[0];

/// Whether the TPDO holds this object.
constexpr bool is_mapped(const Object& o) {
  for (const std::uint32_t m : pdo_mapped) {
    if (m == (std::uint32_t{o.index} << 16U | std::uint32_t{o.sub} << 8U | 8U * o.size)) return true;
  }
  return false;
}

/// Number of objects that the TPDO carries.
constexpr std::size_t mapped_count() {
  std::size_t count = 0;
  for (const Object& o : objects) count += is_mapped(o) ? 1U : 0U;
  return count;
}
static_assert(mapped_count() == pdo_mapped.size(), "the TPDO holds objects of the table, whole");

/// Name in the EDS of an object that has sub-indices.
constexpr const char* record_name(std::uint16_t index) {
  switch (index) {
    case error_history:
      return "Pre-defined error field";
    case store_parameters:
      return "Store parameters";
    case restore_parameters:
      return "Restore default parameters";
    case identity:
      return "Identity object";
    case sdo_server:
    case sdo_channel:
      return "SDO server parameter";
    case pdo:
      return "TPDO communication parameter";
    case pdo_mapping:
      return "TPDO mapping parameter";
    case status_summary:
      return "Status for people";
    case certificate_summary:
      return "Certificate for people";
    case image:
      return "Parameter image";
    case command:
      return "Command";
    case probe:
      return "Probe";
    case corrections:
      return "Corrections for people";
    default:
      return "";
  }
}

}  // namespace canopen
}  // namespace wire
}  // namespace flexcomp

#endif
