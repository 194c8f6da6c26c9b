// SPDX-License-Identifier: Apache-2.0
// The files about the buses against the firmware itself: every object and every register is asked of the server, and what
// it has is what the data sheet and the map say, no more and no less. The data sheet is read by rules of its own here.
#include "exchange/bus_files.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include "firmware/bench.hpp"
#include "flexcomp_firmware/canopen.hpp"
#include "flexcomp_firmware/modbus.hpp"

namespace flexcomp::firmware::bench {
namespace {

namespace co = wire::canopen;
using Sections = std::map<std::string, std::map<std::string, std::string>>;

Sections sections_of(const std::string& text) {
  Sections out;
  std::string section;
  std::istringstream in(text);
  for (std::string line; std::getline(in, line);) {
    EXPECT_TRUE(!line.empty() && line.back() == '\r') << "CiA 306: lines end with CR LF: " << line;
    if (!line.empty()) line.pop_back();
    if (line.empty()) continue;
    if (line.front() == '[') {
      section = line.substr(1, line.size() - 2);
      EXPECT_EQ(out.count(section), 0U) << section << " twice";
      out[section];
      continue;
    }
    const auto equals = line.find('=');
    EXPECT_NE(equals, std::string::npos) << line;
    EXPECT_TRUE(out[section].emplace(line.substr(0, equals), line.substr(equals + 1)).second)
        << line << " twice";
  }
  return out;
}

unsigned long number(const std::string& text) { return std::stoul(text, nullptr, 0); }

/// The node of a running arm, asked by frames.
class Node {
 public:
  Node() {
    transmit_.user = this;
    transmit_.send = [](void* self, std::uint16_t, const std::uint8_t* bytes, std::uint8_t size) {
      auto& node = *static_cast<Node*>(self);
      std::copy(bytes, bytes + size, node.answer_.begin());
      return true;
    };
    node_.emplace(*arm_.device, 2, settings_, transmit_);
    // The default of the error history is what it is without a fault.
    node_->poll(0);
    ask(0x2F, co::error_history, 0, 0);
  }
  std::array<std::uint8_t, 8> ask(unsigned command, unsigned index, unsigned sub, std::uint32_t value = 0) {
    std::array<std::uint8_t, 8> f{};
    f[0] = static_cast<std::uint8_t>(command);
    store_u16(f.data() + 1, static_cast<std::uint16_t>(index));
    f[3] = static_cast<std::uint8_t>(sub);
    store_u32(f.data() + 4, value);
    node_->receive(co::sdo_request_id + settings_.node, f.data(), 8);
    return answer_;
  }

 private:
  Arm arm_;
  CanopenSettings settings_;
  CanTransmit transmit_;
  std::array<std::uint8_t, 8> answer_{};
  std::optional<CanopenNode> node_;
};

std::uint32_t code(const std::array<std::uint8_t, 8>& answer) {
  return answer[0] == 0x80 ? load_u32(answer.data() + 4) : 0;
}

TEST(ElectronicDataSheet, HasWhatTheNodeHasAndNothingElse) {
  const Sections eds = sections_of(host::electronic_data_sheet("flexcomp.eds"));
  // Lists and their sections.
  std::set<std::string> listed;
  for (const char* list : {"MandatoryObjects", "OptionalObjects", "ManufacturerObjects"}) {
    const auto& keys = eds.at(list);
    const unsigned long count = number(keys.at("SupportedObjects"));
    EXPECT_EQ(keys.size(), count + 1);
    for (unsigned long k = 1; k <= count; ++k) {
      char name[8];
      std::snprintf(name, sizeof name, "%04lX", number(keys.at(std::to_string(k))));
      EXPECT_TRUE(listed.insert(name).second) << name;
      EXPECT_EQ(eds.count(name), 1U) << name << " is listed and not described";
    }
  }
  for (const char* mandatory : {"1000", "1001", "1018"})
    EXPECT_EQ(eds.at("MandatoryObjects").size(), 4U) << mandatory;

  Node node;
  const std::map<unsigned long, unsigned> sizes{{5, 1}, {6, 2}, {7, 4}, {8, 4}};
  std::size_t objects = 0;
  std::size_t described = 0;
  for (const auto& section : eds) {
    if (section.second.count("DataType") != 0) ++described;
  }
  for (unsigned index = 0x1000; index < 0xA000; ++index) {
    char name[8];
    std::snprintf(name, sizeof name, "%04X", index);
    for (unsigned sub = 0; sub < 256; ++sub) {
      const auto read = node.ask(0x40, index, sub);
      const std::uint32_t refused = code(read);
      if (refused == co::abort::no_object) {
        EXPECT_EQ(eds.count(name), 0U) << name << " is described, but the node has none";
        EXPECT_EQ(sub, 0U);
        break;
      }
      ASSERT_EQ(listed.count(name), 1U) << name << " is in the node and not in the data sheet";
      const bool record = eds.at(name).count("SubNumber") != 0;
      const std::string section =
          record
              ? std::string(name) + "sub" + (std::ostringstream() << std::hex << std::uppercase << sub).str()
              : name;
      const bool there = record ? eds.count(section) != 0 : sub == 0;
      if (refused == co::abort::no_sub_index) {
        EXPECT_FALSE(there) << section;
        if (read[0] != 0x80) node.ask(0x80, index, sub);
        continue;
      }
      ASSERT_TRUE(there) << section << " is in the node and not in the data sheet";
      ++objects;
      const auto& keys = eds.at(section);
      EXPECT_FALSE(keys.at("ParameterName").empty()) << section;
      EXPECT_LE(keys.at("ParameterName").size(), 241U);
      const std::string& access = keys.at("AccessType");
      EXPECT_EQ(access == "wo", refused == co::abort::write_only) << section;
      // One byte too many for all of them, so nothing is carried out: only the node's opinion of writing is asked.
      const std::uint32_t write = code(node.ask(0x21, index, sub, 100000));
      EXPECT_EQ(access == "ro" || access == "const", write == co::abort::read_only)
          << section << " " << std::hex << write;
      node.ask(0x80, index, sub);
      const unsigned long type = number(keys.at("DataType"));
      if (refused == 0 && sizes.count(type) != 0) {
        ASSERT_EQ(read[0] & 0xE3U, 0x43U) << section << " is not expedited";
        EXPECT_EQ(4U - (read[0] >> 2U & 3U), sizes.at(type)) << section;
        if (keys.count("DefaultValue") != 0) {
          const std::string& value = keys.at("DefaultValue");
          const bool by_node = value.rfind("$NODEID+", 0) == 0;
          const unsigned long expected = number(by_node ? value.substr(8) : value) + (by_node ? 1 : 0);
          EXPECT_EQ(load_u32(read.data() + 4), expected) << section;
        }
      }
      // The number of errors is not that of the sub-indices, and 1800h has none with number 4.
      if (record && sub == 0 && index != co::error_history && index != co::pdo) {
        EXPECT_EQ(number(eds.at(name).at("SubNumber")), number(keys.at("DefaultValue")) + 1) << section;
      }
      node.ask(0x80, index, sub);
    }
  }
  EXPECT_EQ(objects, described);
  EXPECT_GE(objects, 40U);
  EXPECT_EQ(host::electronic_data_sheet("a.eds"), host::electronic_data_sheet("a.eds"));
}

// One revision is one text: masters keep a copy by it.
TEST(ElectronicDataSheet, HasAnotherRevisionWhereItHasOtherContents) {
  const std::string text = host::electronic_data_sheet("a.eds");
  const Sections eds = sections_of(text);
  EXPECT_EQ(eds.at("FileInfo").at("FileRevision"), "2");
  EXPECT_EQ(eds.at("FileInfo").at("ModificationDate"), "11-23-2026");
  EXPECT_EQ(crc32(reinterpret_cast<const std::uint8_t*>(text.data()), text.size()), 0xA3BE7F8AU)
      << "the data sheet has changed: raise file_revision and modification_date in "
         "host/exchange/bus_files.cpp, then set "
         "this number";
}

TEST(RegisterMap, HasWhatTheServerHasAndNothingElse) {
  Arm arm;
  ModbusServer server(*arm.device, 3);
  std::array<std::uint8_t, wire::modbus::pdu_bytes> out{};
  const auto exception = [&](std::vector<std::uint8_t> request) {
    server.answer(request.data(), request.size(), out.data());
    return (out[0] & 0x80U) != 0 ? out[1] : 0;
  };
  std::map<unsigned, const host::Register*> at;
  const std::vector<host::Register> map = host::register_map();
  for (const host::Register& r : map) {
    for (unsigned k = 0; k < r.registers; ++k)
      EXPECT_TRUE(at.emplace(r.address + k, &r).second) << r.name << " overlaps";
  }
  for (unsigned address = 0; address < 0x10000; ++address) {
    const auto high = static_cast<std::uint8_t>(address >> 8U);
    const auto low = static_cast<std::uint8_t>(address);
    const auto r = at.find(address);
    const bool window = r != at.end() && r->second->block == "reading_window";  // empty without a set
    const int read = exception({3, high, low, 0, 1});
    if (!window) {
      EXPECT_EQ(read == 0, r != at.end() && r->second->readable) << std::hex << address;
    }
    const int write = exception({6, high, low, 0, 0});
    EXPECT_EQ(write != 2, r != at.end() && r->second->writable) << std::hex << address;
  }
  // Known values at the places that the map names: a field's place is right, not only the block's.
  const auto find = [&](const std::string& name) {
    for (const host::Register& r : map) {
      if (r.name == name) return r;
    }
    ADD_FAILURE() << name;
    return host::Register();
  };
  const auto value = [&](const std::string& name) {
    const host::Register r = find(name);
    EXPECT_EQ(exception({3, static_cast<std::uint8_t>(r.address >> 8U), static_cast<std::uint8_t>(r.address),
                         0, static_cast<std::uint8_t>(r.registers)}),
              0)
        << name;
    std::uint64_t bits = 0;
    for (unsigned k = 0; k < 2U * r.registers; ++k) bits = bits << 8U | out[2 + k];
    return bits;
  };
  const wire::Capability can = arm.device->capability();
  EXPECT_EQ(value("capability.image_bytes"), can.image_bytes);
  EXPECT_EQ(value("capability.cycle"), can.cycle_us);
  EXPECT_EQ(value("capability.largest_correction"), can.largest_correction_rad);
  EXPECT_EQ(value("status.last_status"), arm.device->status().last_status);
  EXPECT_EQ(value("status.active_slot"), arm.device->status().active_slot);
  EXPECT_EQ(value("certificate.most_instructions"), arm.device->certificate().most_instructions);
  const Robot robot = tx60l();
  EXPECT_EQ(value("robot.link3_a"), bits_of(static_cast<double>(robot.links[2].a_m)));
  EXPECT_EQ(value("robot.joint6_max"), bits_of(static_cast<double>(robot.limits[5].max_rad)));
  EXPECT_EQ(value("robot.tool_z"), bits_of(static_cast<double>(robot.tool_xyz_m[2])));
  EXPECT_EQ(value("robot.payload"), bits_of(static_cast<double>(robot.payload_kg)));
  EXPECT_EQ(find("probe_response.sequence").address + 2U, find("probe_response.q1").address + 36U);
  EXPECT_EQ(find("probe_request.relative_speed6").address + 4U, find("probe_trigger").address);

  // The three ways of writing it say the same.
  const nlohmann::ordered_json json = host::register_map_json();
  ASSERT_EQ(json["registers"].size(), map.size());
  EXPECT_EQ(json["registers"][5]["name"], map[5].name);
  const std::string csv = host::register_map_csv();
  EXPECT_EQ(static_cast<std::size_t>(std::count(csv.begin(), csv.end(), '\n')), map.size() + 1);
  const std::string markdown = host::register_map_markdown();
  for (const host::Register& r : map) EXPECT_THAT(markdown, testing::HasSubstr("`" + r.name + "`"));
}

}  // namespace
}  // namespace flexcomp::firmware::bench
