// SPDX-License-Identifier: Apache-2.0
// The second SDO server (1201h) beside the first one, and the TPDO (1800h, 1A00h): two masters that know nothing of each other.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <optional>
#include <random>

#include "firmware/canopen_bench.hpp"
#include "flexcomp/wire/canopen_dictionary.hpp"

namespace flexcomp::firmware::bench {
namespace {

using wire::Answer;
using wire::Command;

struct OnTheBus {
  std::uint16_t id;
  Bytes bytes;
};

/// Segment of a segmented download, `at` bytes into the data.
SdoFrame download_segment(const Bytes& data, std::size_t at) {
  const std::size_t n = std::min<std::size_t>(7, data.size() - at);
  const unsigned toggle = at / 7 % 2 != 0 ? 0x10U : 0U;
  SdoFrame f{};
  f[0] = static_cast<std::uint8_t>(toggle | ((7 - n) << 1U) | (at + n == data.size() ? 1U : 0U));
  std::copy_n(data.begin() + static_cast<std::ptrdiff_t>(at), n, f.begin() + 1);
  return f;
}

class CanopenServices : public testing::Test {
 protected:
  static constexpr std::uint8_t node_id = 5;
  static constexpr std::uint16_t plc = co::sdo_request_id + node_id;
  static constexpr std::uint16_t own = co::channel_request_id + node_id;
  static constexpr std::uint16_t pdo = co::pdo_id + node_id;

  CanopenServices() { poll(0); }

  void poll(std::uint32_t ms = 1) { poll_node(arm, node, ms); }

  void nmt(std::uint8_t command) {
    const std::uint8_t frame[2] = {command, node_id};
    node.receive(0, frame, 2);
    if (command >= 129) poll();
  }

  std::optional<SdoFrame> ask(std::uint16_t request, const SdoFrame& f) {
    sent.clear();
    node.receive(request, f.data(), 8);
    if (sent.empty()) return std::nullopt;
    EXPECT_EQ(sent.size(), 1U);
    EXPECT_EQ(sent[0].id, request == plc ? co::sdo_answer_id + node_id : co::channel_answer_id + node_id);
    SdoFrame out{};
    std::copy(sent[0].bytes.begin(), sent[0].bytes.end(), out.begin());
    return out;
  }

  std::uint32_t write(std::uint16_t request, std::uint16_t index, std::uint8_t sub, std::uint32_t value,
                      unsigned size) {
    return abort_code_of(ask(request, sdo_frame(0x23U | ((4 - size) << 2U), index, sub, value)));
  }

  std::uint32_t read(std::uint16_t request, std::uint16_t index, std::uint8_t sub) {
    const auto r = ask(request, sdo_frame(0x40, index, sub));
    EXPECT_TRUE(r && ((*r)[0] & 0xE3U) == 0x43U) << std::hex << index << " " << abort_code_of(r);
    if (!r) return 0xDEADBEEF;
    const unsigned unused = (*r)[0] >> 2U & 3U;
    return load_u32(r->data() + 4) & (0xFFFFFFFFU >> 8U * unused);
  }

  std::uint32_t run(std::uint16_t request, Command c, std::uint32_t argument = 0) {
    write(request, co::command, 1, argument, 4);
    return write(request, co::command, 2, static_cast<std::uint32_t>(c), 2);
  }

  /// Frames of the TPDO since the last call, after so long.
  std::vector<Bytes> pdos(std::uint32_t ms = 1) {
    sent.clear();
    poll(ms);
    std::vector<Bytes> out;
    for (const OnTheBus& f : sent) {
      if (f.id == pdo) out.push_back(f.bytes);
    }
    return out;
  }

  Arm arm;
  std::vector<OnTheBus> sent;
  bool full = false;
  CanopenNode node{*arm.device,
                   1,
                   {node_id, 0, 2000},
                   {this, [](void* self, std::uint16_t id, const std::uint8_t* b, std::uint8_t n) {
                      auto& t = *static_cast<CanopenServices*>(self);
                      if (t.full) return false;
                      t.sent.push_back({id, Bytes(b, b + n)});
                      return true;
                    }}};
};

TEST_F(CanopenServices, ThereIsNoSecondServerUntilItIsSetUp) {
  EXPECT_EQ(read(plc, co::sdo_channel, 0), 2U);
  EXPECT_EQ(read(plc, co::sdo_channel, 1), co::not_valid);
  EXPECT_EQ(read(plc, co::sdo_channel, 2), co::not_valid);
  // Nothing but its own two identifiers is answered.
  for (unsigned id = 1; id < 0x800; ++id) {
    if (id == plc) continue;
    sent.clear();
    const SdoFrame f = sdo_frame(0x40, co::device_type, 0);
    node.receive(static_cast<std::uint16_t>(id), f.data(), 8);
    ASSERT_TRUE(sent.empty()) << std::hex << id;
  }
  EXPECT_EQ(abort_code_of(ask(plc, sdo_frame(0x40, co::sdo_channel, 3))), co::abort::no_sub_index);
  EXPECT_EQ(write(plc, co::sdo_server, 1, 0x684, 4), co::abort::read_only);
}

TEST_F(CanopenServices, TheNetworkSetsItUpAsTheStandardHasIt) {
  for (const std::uint32_t id : {0x000U, 0x07FU, 0x101U, 0x180U, 0x585U, 0x605U, 0x67FU, 0x6E0U, 0x705U,
                                 0x7E4U, 0x800U, 0x20000684U, 0x40000684U, 0x10000000U}) {
    EXPECT_EQ(write(plc, co::sdo_channel, 1, id, 4), co::abort::value) << std::hex << id;
  }
  EXPECT_EQ(write(plc, co::sdo_channel, 1, 0x085, 4), co::abort::value) << "EMCY has it";
  EXPECT_EQ(write(plc, co::sdo_channel, 1, own, 4), 0U);
  EXPECT_FALSE(ask(own, sdo_frame(0x40, co::device_type, 0))) << "half a channel is none";
  EXPECT_NE(node.channel_request() & co::not_valid, 0U);
  EXPECT_EQ(write(plc, co::sdo_channel, 2, own, 4), co::abort::value) << "one for both";
  EXPECT_EQ(write(plc, co::sdo_channel, 1, own + 1, 4), co::abort::value) << "changed while valid";
  EXPECT_EQ(write(plc, co::sdo_channel, 1, co::not_valid | (own + 1U), 4), co::abort::value);
  EXPECT_EQ(write(plc, co::sdo_channel, 2, co::channel_answer_id + node_id, 4), 0U);
  EXPECT_EQ(read(own, co::device_type, 0), 0U);
  EXPECT_EQ(read(own, co::sdo_channel, 1), own);
  EXPECT_EQ(node.channel_request(), own);
  // Nor does another service take what the channel has.
  EXPECT_EQ(write(plc, co::emergency, 0, 0x80000085U, 4), 0U);
  EXPECT_EQ(write(plc, co::emergency, 0, own, 4), co::abort::value);
  EXPECT_EQ(write(plc, co::emergency, 0, co::not_valid | own, 4), 0U) << "as long as it is not used";
  EXPECT_EQ(write(plc, co::emergency, 0, own, 4), co::abort::value);
  EXPECT_EQ(write(plc, co::pdo, 1, 0xC0000000U | own, 4), 0U);
  EXPECT_EQ(write(plc, co::pdo, 1, 0x40000000U | own, 4), co::abort::value);
  // Off again over the channel itself: the answer still comes.
  EXPECT_EQ(ask(own, sdo_frame(0x23, co::sdo_channel, 1, co::not_valid | own)),
            sdo_frame(0x60, co::sdo_channel, 1));
  EXPECT_FALSE(ask(own, sdo_frame(0x40, co::device_type, 0)));
  EXPECT_EQ(write(plc, co::sdo_channel, 1, own, 4), 0U);
  EXPECT_EQ(read(own, co::device_type, 0), 0U);
  nmt(130);
  EXPECT_EQ(read(plc, co::sdo_channel, 1), co::not_valid) << "back to its value at power-on";
  EXPECT_FALSE(ask(own, sdo_frame(0x40, co::device_type, 0)));
}

TEST_F(CanopenServices, TheIntegratorsChannelSurvivesAReset) {
  for (const auto& [request, answer] : {std::pair<std::uint32_t, std::uint32_t>{0x605, 0x6B4},
                                        {0x684, 0x684},
                                        {0x684, 0x085},
                                        {0x684, 0x80000684U},
                                        {0x80000684U, 0x6B4},
                                        {0x684, 0x10684},
                                        {0, 0x6B4}}) {
    EXPECT_FALSE(node.set_channel(request, answer)) << std::hex << request << " " << answer;
    EXPECT_EQ(read(plc, co::sdo_channel, 1), co::not_valid);
    EXPECT_EQ(read(plc, co::sdo_channel, 2), co::not_valid);
  }
  for (std::uint32_t n = 1; n <= co::most_channels; ++n)
    EXPECT_TRUE(node.set_channel(co::channel_request_id + n, co::channel_answer_id + n)) << n;
  EXPECT_FALSE(node.set_channel(co::channel_request_id + 49U, co::channel_answer_id + 49U));
  ASSERT_TRUE(node.set_channel(own, co::channel_answer_id + node_id));
  EXPECT_EQ(read(own, co::device_type, 0), 0U);
  EXPECT_EQ(write(plc, co::sdo_channel, 2, co::not_valid, 4), co::abort::value);
  EXPECT_EQ(write(plc, co::sdo_channel, 2, co::not_valid | (co::channel_answer_id + node_id), 4), 0U);
  EXPECT_EQ(write(plc, co::sdo_channel, 2, co::not_valid, 4), 0U);
  nmt(129);
  EXPECT_EQ(read(own, co::device_type, 0), 0U);
  nmt(2);
  EXPECT_FALSE(ask(own, sdo_frame(0x40, co::device_type, 0))) << "stopped";
}

TEST_F(CanopenServices, ALongUploadAndAPushDoNotMeet) {
  ASSERT_TRUE(node.set_channel(own, co::channel_answer_id + node_id));
  const Bytes image = make_image(arm.robot, 5);
  Bytes robot(wire::robot_record_bytes);
  arm.device->robot_record(wire::ByteOrder::little, robot.data());
  // The PLC reads the robot again and again, one segment between any two of the push.
  Bytes got;
  unsigned whole = 0;
  const auto plc_goes_on = [&] {
    if (got.size() == robot.size() || (got.empty() && whole == 0)) {
      EXPECT_TRUE(got == robot || whole == 0);
      ++whole;
      got.clear();
      ASSERT_EQ(abort_code_of(ask(plc, sdo_frame(0x40, co::robot, 0))), 0U);
      return;
    }
    const auto s = ask(plc, SdoFrame{static_cast<std::uint8_t>(got.size() / 7 % 2 != 0 ? 0x70 : 0x60)});
    ASSERT_EQ(abort_code_of(s), 0U);
    got.insert(got.end(), s->begin() + 1, s->begin() + 8 - (((*s)[0] >> 1U) & 7U));
  };
  ASSERT_EQ(ask(own, sdo_frame(0x21, co::image, 1, static_cast<std::uint32_t>(image.size()))),
            sdo_frame(0x60, co::image, 1));
  for (std::size_t at = 0; at < image.size(); at += 7) {
    ASSERT_EQ(abort_code_of(ask(own, download_segment(image, at))), 0U) << at;
    plc_goes_on();
    poll(30);
  }
  EXPECT_GT(whole, 2U);
  EXPECT_EQ(run(own, Command::commit), 0U);
  for (int k = 0; k < 100; ++k) poll();
  EXPECT_EQ(arm.sequence(), 5U);
}

TEST_F(CanopenServices, EachChannelIsAClientOfItsOwn) {
  ASSERT_TRUE(node.set_channel(own, co::channel_answer_id + node_id));
  const Bytes image = make_image(arm.robot, 5);
  ask(own, sdo_frame(0x21, co::image, 1, static_cast<std::uint32_t>(image.size())));
  EXPECT_EQ(abort_code_of(ask(plc, sdo_frame(0x21, co::image, 1, static_cast<std::uint32_t>(image.size())))),
            co::abort::busy);
  EXPECT_EQ(run(plc, Command::abort), co::abort::busy);
  for (std::size_t at = 0; at < image.size(); at += 7)
    ASSERT_EQ(abort_code_of(ask(own, download_segment(image, at))), 0U);
  EXPECT_EQ(write(plc, co::store_parameters, 1, co::save_signature, 4), co::abort::busy)
      << "what another one has staged";
  EXPECT_EQ(run(plc, Command::commit), co::abort::busy);
  // Argument, command and probe of one are not those of the other.
  write(own, co::command, 1, 77, 4);
  EXPECT_EQ(read(plc, co::command, 1), 0U);
  EXPECT_EQ(read(plc, co::command, 2), static_cast<std::uint32_t>(Command::commit));
  EXPECT_EQ(read(own, co::command, 2), 0U);
  Bytes probe(wire::probe_request_bytes, 0);
  ask(own, sdo_frame(0x21, co::probe, 1, static_cast<std::uint32_t>(probe.size())));
  for (std::size_t at = 0; at < probe.size(); at += 7)
    ASSERT_EQ(abort_code_of(ask(own, download_segment(probe, at))), 0U);
  const auto response = [this](std::uint16_t request) {
    EXPECT_EQ(abort_code_of(ask(request, sdo_frame(0x40, co::probe, 2))), 0U);
    Bytes out;
    for (unsigned t = 0; out.size() < wire::probe_response_bytes; t ^= 0x10U) {
      const auto s = ask(request, SdoFrame{static_cast<std::uint8_t>(0x60U | t)});
      out.insert(out.end(), s->begin() + 1, s->begin() + 8 - (((*s)[0] >> 1U) & 7U));
    }
    return out;
  };
  const Bytes answered = response(own);
  EXPECT_NE(answered, Bytes(wire::probe_response_bytes, 0));
  EXPECT_EQ(response(plc), Bytes(wire::probe_response_bytes, 0)) << "it has asked nothing";
  // The silence of one does not end the other.
  ask(plc, sdo_frame(0x40, co::robot, 0));
  for (int k = 0; k < 30; ++k) {
    poll(100);
    read(own, co::error_register, 0);
  }
  EXPECT_EQ(abort_code_of(ask(plc, SdoFrame{0x60})), co::abort::command) << "timed out";
  EXPECT_EQ(run(own, Command::commit), 0U) << "what is staged stays";
  for (int k = 0; k < 100; ++k) poll();
  EXPECT_EQ(arm.sequence(), 5U);
}

TEST_F(CanopenServices, WhatIsUnderWayEndsWithItsChannel) {
  const auto stage_half = [this](std::uint16_t request) {
    const Bytes image = make_image(arm.robot, 5);
    ask(request, sdo_frame(0x21, co::image, 1, static_cast<std::uint32_t>(image.size())));
    ask(request, download_segment(image, 0));
    EXPECT_EQ(arm.device->status().state, 1);
  };
  ASSERT_TRUE(node.set_channel(own, co::channel_answer_id + node_id));
  stage_half(own);
  EXPECT_EQ(write(plc, co::sdo_channel, 1, co::not_valid | own, 4), 0U);
  EXPECT_EQ(arm.device->status().state, 0);
  nmt(129);
  stage_half(own);
  nmt(2);
  EXPECT_EQ(arm.device->status().state, 0);
  nmt(1);
  stage_half(own);
  nmt(130);
  EXPECT_EQ(arm.device->status().state, 0);
  stage_half(own);
  EXPECT_TRUE(node.set_channel(own, co::channel_answer_id + node_id));
  EXPECT_EQ(arm.device->status().state, 0);
  // The other one's is left alone.
  stage_half(plc);
  EXPECT_TRUE(node.set_channel(own, co::channel_answer_id + node_id));
  EXPECT_EQ(write(plc, co::error_history, 0, 0, 1), 0U) << "ends its own transfer";
  EXPECT_EQ(arm.device->status().state, 0);
  // A block upload over both at once: eight segments of each in one poll, no more.
  ask(plc, sdo_frame(0xA4, co::robot, 0, 63));
  ask(own, sdo_frame(0xA4, co::robot, 0, 63));
  full = true;
  node.receive(plc, SdoFrame{0xA3}.data(), 8);
  node.receive(own, SdoFrame{0xA3}.data(), 8);
  full = false;
  sent.clear();
  poll();
  EXPECT_EQ(sent.size(), 2U * CanopenNode::segments_per_call);
}

TEST_F(CanopenServices, TheRobotRecordInPiecesIsTheRecord) {
  Bytes whole(wire::robot_record_bytes);
  arm.device->robot_record(wire::ByteOrder::little, whole.data());
  for (std::uint32_t size = 1; size <= 9; ++size) {
    for (std::uint32_t at = 0; at + size <= whole.size(); ++at) {
      Bytes part(size + 1, 0xEE);
      arm.device->robot_record_part(at, part.data(), size);
      ASSERT_TRUE(std::equal(part.begin(), part.end() - 1, whole.begin() + at)) << at << " " << size;
      ASSERT_EQ(part.back(), 0xEE);
    }
  }
  Bytes all(whole.size());
  arm.device->robot_record_part(0, all.data(), static_cast<std::uint32_t>(all.size()));
  EXPECT_EQ(all, whole);
}

TEST_F(CanopenServices, EverySmallObjectComesInABlockAsWell) {
  arm.push(make_image(arm.robot, 5));
  for (const co::Object& o : co::objects) {
    if (o.size == 0 || o.size > 4 || o.access == co::Access::wo) continue;
    const auto plain = ask(plc, sdo_frame(0x40, o.index, o.sub));
    ASSERT_TRUE(plain);
    const auto first = ask(plc, sdo_frame(0xA4, o.index, o.sub, 63));
    if (abort_code_of(plain) != 0) {
      EXPECT_EQ(abort_code_of(first), abort_code_of(plain));
      continue;
    }
    ASSERT_EQ(load_u32(first->data() + 4), o.size) << std::hex << o.index << " " << int{o.sub};
    const auto segment = ask(plc, SdoFrame{0xA3});
    ASSERT_EQ((*segment)[0], 0x81) << std::hex << o.index << " " << int{o.sub};
    EXPECT_TRUE(std::equal(segment->begin() + 1, segment->begin() + 1 + o.size, plain->begin() + 4));
    ask(plc, SdoFrame{0xA2, 1, 63});
    node.receive(plc, SdoFrame{0xA1}.data(), 8);
  }
}

TEST_F(CanopenServices, NoPdoWithoutBeingAsked) {
  EXPECT_EQ(read(plc, co::pdo, 0), 5U);
  EXPECT_EQ(read(plc, co::pdo, 1), 0xC0000185U);
  EXPECT_EQ(read(plc, co::pdo, 2), 254U);
  EXPECT_EQ(read(plc, co::pdo, 3), 1000U);
  EXPECT_EQ(read(plc, co::pdo, 5), 0U);
  EXPECT_EQ(abort_code_of(ask(plc, sdo_frame(0x40, co::pdo, 4))), co::abort::no_sub_index)
      << "CiA 301, 7.5.2.37: reserved";
  EXPECT_EQ(write(plc, co::pdo, 4, 0, 1), co::abort::no_sub_index);
  EXPECT_EQ(abort_code_of(ask(plc, sdo_frame(0x40, co::pdo, 6))), co::abort::no_sub_index);
  EXPECT_EQ(read(plc, co::pdo_mapping, 0), 4U);
  EXPECT_EQ(write(plc, co::pdo_mapping, 0, 0, 1), co::abort::read_only) << "the mapping is fixed";
  EXPECT_EQ(write(plc, co::pdo_mapping, 1, 0x20020610, 4), co::abort::read_only);
  nmt(1);
  arm.push(make_image(arm.robot, 5));
  for (int k = 0; k < 50; ++k) EXPECT_TRUE(pdos(100).empty());
}

TEST_F(CanopenServices, TheCommunicationParametersOfThePdo) {
  for (const std::uint32_t id : {0x185U, 0x80000185U, 0x60000185U, 0x40000000U, 0x40000180U, 0x40000605U,
                                 0x40000085U, 0x40000701U, 0x40000985U}) {
    EXPECT_EQ(write(plc, co::pdo, 1, id, 4), co::abort::value) << std::hex << id;
  }
  for (unsigned type = 0; type < 254; ++type)
    EXPECT_EQ(write(plc, co::pdo, 2, type, 1), co::abort::value) << type;
  EXPECT_EQ(write(plc, co::pdo, 2, 255, 1), 0U);
  EXPECT_EQ(write(plc, co::pdo, 3, 500, 2), 0U);
  EXPECT_EQ(write(plc, co::pdo, 1, 0xC0000186U, 4), 0U) << "another identifier while it is not used";
  EXPECT_EQ(write(plc, co::pdo, 1, 0x40000186U, 4), 0U);
  EXPECT_EQ(write(plc, co::pdo, 1, 0x40000187U, 4), co::abort::value);
  EXPECT_EQ(write(plc, co::pdo, 3, 0, 2), co::abort::value) << "not while it is valid";
  EXPECT_EQ(write(plc, co::pdo, 5, 1234, 2), 0U);
  EXPECT_EQ(read(plc, co::pdo, 1), 0x40000186U);
  EXPECT_EQ(read(plc, co::pdo, 2), 255U);
  EXPECT_EQ(read(plc, co::pdo, 3), 500U);
  EXPECT_EQ(read(plc, co::pdo, 5), 1234U);
  nmt(130);
  EXPECT_EQ(read(plc, co::pdo, 1), 0xC0000185U);
  EXPECT_EQ(read(plc, co::pdo, 2), 254U);
  EXPECT_EQ(read(plc, co::pdo, 3), 1000U);
  EXPECT_EQ(read(plc, co::pdo, 5), 0U);
}

TEST_F(CanopenServices, ThePdoTellsStateStepFaultsAndSequence) {
  ASSERT_EQ(write(plc, co::pdo, 1, 0x40000185U, 4), 0U);
  EXPECT_TRUE(pdos(1000).empty()) << "pre-operational";
  nmt(1);
  auto got = pdos();
  ASSERT_EQ(got.size(), 1U) << "the first one as operational is entered";
  EXPECT_EQ(got[0].size(), 8U);
  EXPECT_EQ(got[0][0], 0) << "idle";
  EXPECT_EQ(got[0][1], static_cast<std::uint8_t>(StepStatus::no_set));
  EXPECT_EQ(load_u16(got[0].data() + 2), static_cast<std::uint16_t>(wire::fault::no_valid_set));
  EXPECT_EQ(load_u32(got[0].data() + 4), 0U);
  for (int k = 0; k < 100; ++k) EXPECT_TRUE(pdos(100).empty()) << "nothing has changed";
  ASSERT_EQ(arm.push(make_image(arm.robot, 0x01020304)), Answer::accepted);
  // The values are those of the mapped objects, each at its place.
  std::vector<Bytes> all;
  for (int k = 0; k < 2000; ++k) {
    for (const Bytes& b : pdos(5)) all.push_back(b);
  }
  ASSERT_FALSE(all.empty());
  EXPECT_LE(all.size(), 100U);
  std::size_t at = 0;
  for (const std::uint32_t mapped : co::pdo_mapped) {
    const std::uint32_t now =
        read(plc, static_cast<std::uint16_t>(mapped >> 16U), static_cast<std::uint8_t>(mapped >> 8U));
    std::uint32_t told = 0;
    for (unsigned k = 0; k < (mapped & 0xFFU) / 8U; ++k) told |= std::uint32_t{all.back()[at++]} << 8U * k;
    EXPECT_EQ(told, now) << std::hex << mapped;
  }
  EXPECT_EQ(at, 8U);
  EXPECT_EQ(load_u32(all.back().data() + 4), 0x01020304U);
  nmt(128);
  arm.run(Command::restore_defaults, 0, 1);
  arm.until_done();
  EXPECT_TRUE(pdos(1000).empty()) << "pre-operational again";
  nmt(2);
  EXPECT_TRUE(pdos(1000).empty()) << "stopped";
  nmt(1);
  EXPECT_EQ(pdos().size(), 1U);
  EXPECT_EQ(write(plc, co::pdo, 1, 0xC0000185U, 4), 0U);
  arm.push(make_image(arm.robot, 9));
  EXPECT_TRUE(pdos(1000).empty()) << "not valid";
}

TEST_F(CanopenServices, InhibitTimeAndEventTimerOfThePdo) {
  ASSERT_EQ(write(plc, co::pdo, 3, 405, 2), 0U);  // 40.5 ms
  ASSERT_EQ(write(plc, co::pdo, 1, 0x40000185U, 4), 0U);
  nmt(1);
  ASSERT_EQ(pdos().size(), 1U);
  // A state that flaps each millisecond: one frame in 41 ms, and the last state is told in the end.
  std::uint32_t last_ms = arm.now_ms;
  unsigned count = 0;
  Bytes last;
  for (std::uint32_t k = 0; k < 500; ++k) {
    ask(plc, sdo_frame(0x21, co::image, 1, 100));
    if (k % 2 != 0) ask(plc, sdo_frame(0x80, co::image, 1, co::abort::general));
    for (const Bytes& b : pdos(1)) {
      EXPECT_GE(arm.now_ms - last_ms, 41U);
      last_ms = arm.now_ms;
      ++count;
      last = b;
    }
  }
  EXPECT_GE(count, 10U);
  EXPECT_LE(count, 13U);
  ask(plc, sdo_frame(0x80, co::image, 1, co::abort::general));
  for (int k = 0; k < 100; ++k) {
    for (const Bytes& b : pdos(1)) last = b;
  }
  EXPECT_EQ(last[0], 0);
  // The timer runs from the last frame, whatever sent it; a full queue only puts it off.
  ASSERT_EQ(write(plc, co::pdo, 5, 250, 2), 0U);
  count = 0;
  for (int k = 0; k < 1000; ++k) count += static_cast<unsigned>(pdos(1).size());
  EXPECT_EQ(count, 4U);
  full = true;
  for (int k = 0; k < 1000; ++k) EXPECT_TRUE(pdos(1).empty());
  full = false;
  EXPECT_EQ(pdos(1).size(), 1U);
  EXPECT_TRUE(pdos(1).empty());
  // A timer shorter than the inhibit time does not undercut it.
  ASSERT_EQ(write(plc, co::pdo, 5, 1, 2), 0U);
  count = 0;
  for (int k = 0; k < 410; ++k) count += static_cast<unsigned>(pdos(1).size());
  EXPECT_LE(count, 11U);
  EXPECT_GE(count, 9U);
  // The clock wraps.
  arm.now_ms = 0xFFFFFFF0U;
  pdos(0);
  count = 0;
  for (int k = 0; k < 410; ++k) count += static_cast<unsigned>(pdos(1).size());
  EXPECT_LE(count, 11U);
  EXPECT_GE(count, 9U);
}

TEST_F(CanopenServices, RandomFramesOnBothChannels) {
  std::mt19937 engine(12);
  const auto random = [&engine] { return static_cast<std::uint32_t>(engine()); };
  const std::uint16_t indices[] = {co::sdo_channel, co::pdo,    co::pdo_mapping, co::emergency, co::image,
                                   co::robot,       co::status, co::probe,       co::command};
  ASSERT_TRUE(node.set_channel(own, co::channel_answer_id + node_id));
  for (int k = 0; k < 200000; ++k) {
    SdoFrame f;
    for (auto& b : f) b = static_cast<std::uint8_t>(random());
    if (random() % 4 != 0) store_u16(f.data() + 1, indices[random() % 9]);
    f[3] = static_cast<std::uint8_t>(random() % 6);
    if (random() % 3 == 0) store_u32(f.data() + 4, random() & 0xC00007FFU);
    if (random() % 8 == 0) f = SdoFrame{static_cast<std::uint8_t>(random())};
    if (random() % 256 == 0) nmt(static_cast<std::uint8_t>(random() % 2 != 0 ? 1 : 128 + random() % 3));
    full = random() % 64 == 0;
    sent.clear();
    node.receive(random() % 2 != 0 ? plc : own, f.data(), 8);
    ASSERT_LE(sent.size(), 1U + CanopenNode::segments_per_call);
    sent.clear();
    if (random() % 8 == 0) poll(random() % 50);
    ASSERT_LE(sent.size(), 23U);
    for (const OnTheBus& frame : sent) ASSERT_FALSE(frame.id < 0x080 || frame.id > 0x705) << frame.id;
    if (k % 1000 == 0) node.set_channel(own, co::channel_answer_id + node_id);
  }
  EXPECT_FALSE(arm.flash.double_writes);
}

}  // namespace
}  // namespace flexcomp::firmware::bench
