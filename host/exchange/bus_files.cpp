// SPDX-License-Identifier: Apache-2.0
#include "exchange/bus_files.hpp"

#include <fmt/format.h>

#include <array>
#include <map>
#include <stdexcept>
#include <string_view>
#include <utility>

#include "files/csv.hpp"
#include "flexcomp/wire/canopen_dictionary.hpp"
#include "flexcomp/wire/certificate_record.hpp"
#include "flexcomp/wire/modbus_blocks.hpp"
#include "flexcomp/wire/robot_record.hpp"
#include "json.hpp"

namespace flexcomp::host {

namespace {

namespace co = wire::canopen;
namespace map = wire::modbus;

// --- electronic data sheet -----------------------------------------------------------------------------------------------

// Of the contents: whoever changes them raises the revision and sets the date (tests/hil/bus_files_test.cpp notices). CiA 306-1
// has MM-DD-YYYY and hh:mm(AM|PM).
constexpr unsigned file_revision = 2;
constexpr const char* creation_date = "11-21-2026";
constexpr const char* creation_time = "03:56PM";
constexpr const char* modification_date = "11-23-2026";
constexpr const char* modification_time = "01:30AM";

constexpr unsigned variable_object = 7;
constexpr unsigned domain_object = 2;
constexpr unsigned array_object = 8;
constexpr unsigned record_object = 9;

const char* access(co::Access a) {
  return a == co::Access::constant ? "const" : a == co::Access::ro ? "ro" : a == co::Access::wo ? "wo" : "rw";
}

/// Keys and values of one section; CiA 306 ends lines with CR LF.
class Sheet {
 public:
  void section(const std::string& name) {
    text_ += fmt::format("{}[{}]\r\n", text_.empty() ? "" : "\r\n", name);
  }
  void put(const std::string& key, const std::string& value) {
    text_ += fmt::format("{}={}\r\n", key, value);
  }
  void put(const std::string& key, unsigned value) { put(key, fmt::format("{}", value)); }
  std::string text() && { return std::move(text_); }

 private:
  std::string text_;
};

/// 1018h:3 of the firmware of this version: major << 16 | minor << 8 | patch.
unsigned revision_number() {
  unsigned out = 0;
  unsigned part = 0;
  for (const char c : std::string_view(FLEXCOMP_VERSION ".")) {
    if (c != '.') {
      part = 10 * part + static_cast<unsigned>(c - '0');
    } else {
      out = out << 8U | std::exchange(part, 0);
    }
  }
  return out;
}

/// Arrays of CiA 301, 7.5.2; what else has sub-indices is a record.
bool is_array(std::uint16_t index) {
  return index == co::error_history || index == co::store_parameters || index == co::restore_parameters;
}

/// Value after a reset where the firmware alone says it; else nothing.
std::string default_value(const co::Object& o, std::size_t highest_sub) {
  if (o.sub == 0 && o.type == co::Type::u8 && o.access == co::Access::constant)
    return fmt::format("{}", highest_sub);
  if (o.index == co::device_type) return "0x00000000";
  if (o.index == co::device_name) return "flexcomp";
  if (o.index == co::software_version) return FLEXCOMP_VERSION;
  if (o.index == co::identity && o.sub == 1) return "0x00000000";
  if (o.index == co::identity && o.sub == 2) return fmt::format("0x{:08X}", co::product_code);
  if (o.index == co::identity && o.sub == 3) return fmt::format("0x{:08X}", revision_number());
  if (o.index == co::error_history && o.sub == 0) return "0";
  if (o.index == co::emergency) return fmt::format("$NODEID+0x{:X}", co::emergency_id);
  if (o.index == co::emergency_inhibit) return fmt::format("{}", co::emergency_inhibit_default);
  if (o.index == co::sdo_server && o.sub == 1) return fmt::format("$NODEID+0x{:X}", co::sdo_request_id);
  if (o.index == co::sdo_server && o.sub == 2) return fmt::format("$NODEID+0x{:X}", co::sdo_answer_id);
  if (o.index == co::sdo_channel) return fmt::format("0x{:08X}", co::not_valid);
  if (o.index == co::pdo && o.sub == co::pdo_cob_id)
    return fmt::format("$NODEID+0x{:08X}", co::not_valid | co::no_remote_frames | co::pdo_id);
  if (o.index == co::pdo && o.sub == co::pdo_transmission) return fmt::format("{}", co::pdo_event_driven);
  if (o.index == co::pdo && o.sub == co::pdo_inhibit) return fmt::format("{}", co::pdo_inhibit_default);
  if (o.index == co::pdo && o.sub == co::pdo_timer) return "0";
  if (o.index == co::pdo_mapping) return fmt::format("0x{:08X}", co::pdo_mapped.at(o.sub - 1U));
  return "";
}

void put_object(Sheet& sheet, const co::Object& o, const std::string& section, const std::string& name,
                std::size_t highest_sub) {
  sheet.section(section);
  sheet.put("ParameterName", name);
  const bool domain = o.type == co::Type::domain;
  sheet.put("ObjectType", fmt::format("0x{:X}", domain && o.sub == 0 ? domain_object : variable_object));
  sheet.put("DataType", fmt::format("0x{:04X}", static_cast<unsigned>(o.type)));
  sheet.put("AccessType", access(o.access));
  const std::string value = default_value(o, highest_sub);
  if (!value.empty()) sheet.put("DefaultValue", value);
  sheet.put("PDOMapping", co::is_mapped(o) ? 1U : 0U);
}

// --- register map --------------------------------------------------------------------------------------------------------

struct Field {
  std::string name;
  std::string type;
  std::size_t bytes = 0;
  std::string unit;
};

/// Walks over a record as encode() and decode() do and notes what comes.
class Walk {
 public:
  template <class T>
  void operator()(T& value) {
    static_cast<void>(value);
    fields.push_back({"", sizeof(T) == 2 ? "u16" : sizeof(T) == 4 ? "u32" : "f64", sizeof(T), ""});
  }
  void bytes(const std::uint8_t*, std::size_t size) { fields.push_back({"", "bytes", size, ""}); }
  void skip(std::size_t size) { fields.push_back({"reserved", "bytes", size, ""}); }

  std::vector<Field> fields;
};

/// Names in the order of the walk: "name" or "name|unit"; the members of an array one after the other.
std::vector<Field> named(std::vector<Field> fields, const std::vector<std::string>& names) {
  std::size_t at = 0;
  for (Field& f : fields) {
    if (!f.name.empty()) continue;
    if (at == names.size()) throw std::logic_error("a record has more fields than names");
    const auto bar = names[at].find('|');
    f.name = names[at].substr(0, bar);
    if (bar != std::string::npos) f.unit = names[at].substr(bar + 1);
    ++at;
  }
  if (at != names.size()) throw std::logic_error("a record has fewer fields than names");
  return fields;
}

/// "name, name|unit"
void add(std::vector<std::string>& names, std::string_view list) {
  constexpr std::string_view comma = ", ";
  for (auto end = list.find(comma); end != std::string_view::npos; end = list.find(comma)) {
    names.emplace_back(list.substr(0, end));
    list.remove_prefix(end + comma.size());
  }
  names.emplace_back(list);
}
/// joint 1 … joint 6
void add_each(std::vector<std::string>& names, const std::string& stem, const std::string& unit) {
  for (std::size_t j = 1; j <= wire::joints; ++j) names.push_back(fmt::format("{}{}|{}", stem, j, unit));
}
void add_xyz(std::vector<std::string>& names, const std::string& stem, const std::string& unit) {
  for (const char* axis : {"x", "y", "z"}) names.push_back(fmt::format("{}_{}|{}", stem, axis, unit));
}

std::vector<Field> fields_of(map::Block block) {
  using map::Block;
  Walk walk;
  std::vector<std::string> names;
  switch (block) {
    case Block::capability: {
      wire::Capability record;
      wire::detail::visit_capability(record, walk);
      add(names,
          "protocol, joints, scalar_bytes, schema, bases, flags, terms, tables, values, image_bytes, "
          "cycle|us, fade_cycles, firmware, nominal_hash, name_hash, plausible_position|m, "
          "plausible_orientation|rad, largest_correction|rad");
      break;
    }
    case Block::status: {
      wire::Status record;
      wire::detail::visit_status(record, walk);
      add(names,
          "state, answer, refusal, faults, detail, active_slot, settled, active_sequence, active_bytes, "
          "active_crc, previous_sequence, announced_bytes, staged_bytes, trial_cycles_left, cycles");
      for (std::size_t k = 0; k < 6; ++k)
        names.push_back(fmt::format("cycles_{}", name(static_cast<StepStatus>(k))));
      names.emplace_back("last_status");
      break;
    }
    case Block::probe_request: {
      wire::ProbeRequest record;
      wire::detail::visit_probe_request(record, walk);
      add_each(names, "q", "rad");
      names.emplace_back("payload|kg");
      add_xyz(names, "payload_com", "m");
      add_xyz(names, "force", "N");
      add(names, "temperature|deg C, time|s");
      add_each(names, "direction", "");
      add_each(names, "relative_speed", "");
      break;
    }
    case Block::probe_response: {
      wire::ProbeResponse record;
      wire::detail::visit_probe_response(record, walk);
      add_each(names, "q", "rad");
      add(names, "missed_position|m, missed_orientation|rad, status, slot, sequence");
      break;
    }
    case Block::robot: {
      NominalRobot<wire::joints> record;
      wire::detail::visit_robot(record, walk);
      for (std::size_t i = 1; i <= wire::joints; ++i)
        add(names,
            fmt::format("link{0}_theta|rad, link{0}_d|m, link{0}_a|m, link{0}_alpha|rad, link{0}_beta|rad",
                        i));
      for (std::size_t i = 1; i <= wire::joints; ++i)
        add(names, fmt::format("joint{0}_min|rad, joint{0}_max|rad", i));
      add_xyz(names, "gravity", "m/s^2");
      add_xyz(names, "tool", "m");
      add(names, "tool_qw, tool_qx, tool_qy, tool_qz, payload|kg");
      add_xyz(names, "payload_com", "m");
      names.emplace_back("reference_temperature|deg C");
      // The robot's name is no part of the walk.
      walk.fields.push_back({"name_bytes", "u16", 2, ""});
      walk.fields.push_back({"name", "bytes", wire::robot_name_bytes, ""});
      break;
    }
    case Block::certificate: {
      wire::CertificateRecord record;
      wire::detail::visit_certificate(record, walk);
      add_each(names, "deflection", "rad");
      add_each(names, "slope", "");
      add(names,
          "off_joint_deflection|rad, off_joint_slope, by_mass|rad/kg, by_force|rad/N, "
          "by_centre_of_mass|rad/m, "
          "by_temperature|rad/K, position|m, orientation|rad, reach|m, instructions, most_instructions, "
          "sequence");
      break;
    }
    case Block::corrections:
      walk.fields.assign(wire::joints + 1, {"", "f32", 4, ""});
      add_each(names, "correction", "deg");
      names.emplace_back("largest_correction|deg");
      break;
    default:
      return {};
  }
  return named(walk.fields, names);
}

}  // namespace

std::string electronic_data_sheet(const std::string& file) {
  std::map<std::uint16_t, std::vector<const co::Object*>> by_index;
  for (const co::Object& o : co::objects) by_index[o.index].push_back(&o);
  std::array<std::vector<std::uint16_t>, 3> lists;  // mandatory, optional, manufacturer's
  for (const auto& entry : by_index) {
    const std::uint16_t index = entry.first;
    const bool mandatory = index == co::device_type || index == co::error_register || index == co::identity;
    lists[mandatory ? 0 : index < 0x2000 || index >= 0x6000 ? 1 : 2].push_back(index);
  }

  Sheet sheet;
  sheet.section("FileInfo");
  sheet.put("FileName", file);
  sheet.put("FileVersion", 1);
  sheet.put("FileRevision", file_revision);
  sheet.put("EDSVersion", "4.0");
  sheet.put("Description", "flexcomp " FLEXCOMP_VERSION ": compensation of a robot arm");
  sheet.put("CreationTime", creation_time);
  sheet.put("CreationDate", creation_date);
  sheet.put("CreatedBy", "flexcomp " FLEXCOMP_VERSION);
  sheet.put("ModificationTime", modification_time);
  sheet.put("ModificationDate", modification_date);
  sheet.put("ModifiedBy", "flexcomp " FLEXCOMP_VERSION);
  sheet.section("DeviceInfo");
  sheet.put("VendorName", "flexcomp");
  sheet.put("VendorNumber", "0x0");
  sheet.put("ProductName", "flexcomp");
  sheet.put("ProductNumber", fmt::format("0x{:08X}", co::product_code));
  sheet.put("RevisionNumber", fmt::format("0x{:08X}", revision_number()));
  sheet.put("OrderCode", "flexcomp");
  // Bit timing is the board's; CiA 301 names these rates.
  for (const int rate : {10, 20, 50, 125, 250, 500, 800, 1000})
    sheet.put(fmt::format("BaudRate_{}", rate), 1);
  sheet.put("SimpleBootUpMaster", 0);
  sheet.put("SimpleBootUpSlave", 1);
  for (const char* none : {"Granularity", "DynamicChannelsSupported", "GroupMessaging", "NrOfRXPDO"})
    sheet.put(none, 0);
  sheet.put("NrOfTXPDO", 1);
  sheet.put("LSS_Supported", 0);
  sheet.section("DummyUsage");
  for (unsigned k = 1; k <= 7; ++k) sheet.put(fmt::format("Dummy{:04X}", k), 0);
  sheet.section("Comments");
  sheet.put("Lines", 2);
  sheet.put("Line1", "Records of type DOMAIN are described in include/flexcomp/wire/store_state.hpp.");
  sheet.put("Line2",
            "SDO transfers are expedited, segmented or in blocks; the mapping of the TPDO is fixed.");
  const std::array<const char*, 3> names{"MandatoryObjects", "OptionalObjects", "ManufacturerObjects"};
  for (std::size_t list = 0; list < lists.size(); ++list) {
    sheet.section(names[list]);
    sheet.put("SupportedObjects", static_cast<unsigned>(lists[list].size()));
    for (std::size_t k = 0; k < lists[list].size(); ++k)
      sheet.put(fmt::format("{}", k + 1), fmt::format("0x{:04X}", lists[list][k]));
  }
  for (const std::vector<std::uint16_t>& list : lists) {
    for (const std::uint16_t index : list) {
      const std::vector<const co::Object*>& objects = by_index.at(index);
      const std::string section = fmt::format("{:04X}", index);
      if (objects.size() == 1) {
        put_object(sheet, *objects.front(), section, objects.front()->name, 0);
        continue;
      }
      sheet.section(section);
      sheet.put("ParameterName", co::record_name(index));
      sheet.put("ObjectType", fmt::format("0x{:X}", is_array(index) ? array_object : record_object));
      sheet.put("SubNumber", static_cast<unsigned>(objects.size()));
      for (const co::Object* o : objects)
        put_object(sheet, *o, fmt::format("{}sub{:X}", section, o->sub), o->name, objects.back()->sub);
    }
  }
  return std::move(sheet).text();
}

std::vector<Register> register_map() {
  std::vector<Register> out;
  for (const map::BlockDescription& b : map::block_descriptions) {
    std::vector<Field> fields = fields_of(b.block);
    if (fields.empty()) {
      const std::size_t bytes = 2 * std::size_t{b.registers};
      fields.push_back({"", b.registers == 1 ? "u16" : b.registers == 2 ? "u32" : "bytes", bytes, ""});
    }
    std::size_t at = b.address;
    for (const Field& f : fields) {
      Register r;
      r.address = static_cast<std::uint16_t>(at);
      r.registers = static_cast<std::uint16_t>(f.bytes / 2);
      r.readable = b.readable;
      r.writable = b.writable;
      r.block = b.name;
      r.name = f.name.empty() ? std::string(b.name) : fmt::format("{}.{}", b.name, f.name);
      r.type = f.type;
      r.unit = f.unit;
      if (&f == &fields.front()) r.text = b.text;
      at += r.registers;
      out.push_back(std::move(r));
    }
    if (at != std::size_t{b.address} + b.registers)
      throw std::logic_error("a block and its fields differ in length");
  }
  return out;
}

namespace {

std::string access(const Register& r) { return std::string(r.readable ? "r" : "") + (r.writable ? "w" : ""); }

}  // namespace

std::string register_map_csv() {
  std::string text = "address,address_hex,registers,access,type,unit,name,description\n";
  for (const Register& r : register_map()) {
    text += fmt::format("{},0x{:04X},{},{},{},{},{},{}\n", r.address, r.address, r.registers, access(r),
                        r.type, csv_cell(r.unit), r.name, csv_cell(r.text));
  }
  return text;
}

std::string register_map_markdown() {
  std::string text =
      "# Modbus register map of a flexcomp controller\n\n"
      "Addresses are those of the protocol, from 0; a tool that counts from 1 (or from 40001) adds one. Read "
      "by function 03 "
      "or 04,\nwritten by 06, 16 or 23. u32, f32 and f64 take two, two and four registers, the most "
      "significant first. "
      "Reals are IEEE 754.\n\n"
      "| address | registers | access | type | unit | name | what |\n|---|---|---|---|---|---|---|\n";
  for (const Register& r : register_map()) {
    text += fmt::format("| {} (0x{:04X}) | {} | {} | {} | {} | `{}` | {} |\n", r.address, r.address,
                        r.registers, access(r), r.type, r.unit, r.name, r.text);
  }
  return text;
}

Json register_map_json() {
  Json out;
  out["byte_order"] = "big";
  out["read_functions"] = {3, 4};
  out["write_functions"] = {6, 16, 23};
  out["registers"] = Json::array();
  for (const Register& r : register_map()) {
    out["registers"].push_back({{"address", r.address},
                                {"registers", r.registers},
                                {"access", access(r)},
                                {"type", r.type},
                                {"unit", r.unit},
                                {"block", r.block},
                                {"name", r.name},
                                {"description", r.text}});
  }
  return out;
}

}  // namespace flexcomp::host
