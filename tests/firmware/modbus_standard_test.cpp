// SPDX-License-Identifier: Apache-2.0
// The Modbus server against the clauses of Modbus Application Protocol V1.1b3, Modbus over Serial Line V1.02 and Messaging
// on TCP/IP V1.0b; docs/modbus.md names the test of each clause.
#include <gtest/gtest.h>

#include "firmware/modbus_bench.hpp"

namespace flexcomp::firmware::bench {
namespace {

class ModbusStandard : public testing::Test {
 protected:
  Arm arm;
  Client client{*arm.device, 1};
};

// --- V1.1b3 -------------------------------------------------------------------------------------------

// 6.12 and 6.17: quantity and byte count (03), then addresses (02), then the application (04).
TEST_F(ModbusStandard, ByteCountIsCheckedWithTheQuantity) {
  EXPECT_EQ(client.ask(join({{0x10}, be({0x9F, 1}), {3}, Bytes(2)})), exception(0x10, 3));
  EXPECT_EQ(client.ask(join({{0x10}, be({0x9F, 1}), {2}, Bytes(3)})), exception(0x10, 3));
  EXPECT_EQ(client.ask(join({{0x10}, be({0x9F, 1}), {2}, Bytes(2)})), exception(0x10, 2));
  EXPECT_EQ(client.ask(join({{0x17}, be({0xFFFF, 2, 0x40, 1}), {3}, Bytes(2)})), exception(0x17, 3));
  EXPECT_EQ(client.ask(join({{0x17}, be({0xFFFF, 2, 0x40, 1}), {2}, Bytes(3)})), exception(0x17, 3));
  EXPECT_EQ(client.ask(join({{0x17}, be({0xFFFF, 2, 0x40, 1}), {2}, Bytes(2)})), exception(0x17, 2));
}

// 6.8.1, sub-function 00: N x 2 bytes come back.
TEST_F(ModbusStandard, ReturnQueryDataOfAnyEvenLength) {
  for (std::size_t n = 0; n <= 250; ++n) {
    Bytes request{8, 0, 0};
    for (std::size_t k = 0; k < n; ++k) request.push_back(static_cast<std::uint8_t>(17 * k + n));
    EXPECT_EQ(client.ask(request), n != 0 && n % 2 == 0 ? request : exception(8, 3)) << n;
  }
}

// 6.13: server ID, run indicator, additional data. The indicator is on where a set corrects the commands.
TEST_F(ModbusStandard, ReportServerId) {
  const std::string text = std::string("flexcomp ") + firmware_version_text;
  Bytes expected{0x11, static_cast<std::uint8_t>(2 + text.size()), 0xF1, 0};
  expected.insert(expected.end(), text.begin(), text.end());
  EXPECT_EQ(client.ask({0x11}), expected);
  ASSERT_EQ(arm.push(make_image(arm.robot, 1)), wire::Answer::accepted);
  expected[3] = 0xFF;
  EXPECT_EQ(client.ask({0x11}), expected);
  EXPECT_EQ(client.ask({0x11, 0}), exception(0x11, 3));
}

// 6.8, 6.9: "Serial Line only": without a line there are no counters.
TEST_F(ModbusStandard, CountersAreOfASerialLine) {
  for (unsigned sub = 1; sub < 32; ++sub) {
    EXPECT_EQ(client.ask({8, 0, static_cast<std::uint8_t>(sub), 0, 0}), exception(8, 1)) << sub;
  }
  EXPECT_EQ(client.ask({0x0B}), exception(0x0B, 1));
}

// 6.21: a level above the conformity level is answered by the level that there is; an unknown object of a stream begins
// it anew.
TEST_F(ModbusStandard, DeviceIdentificationAnswersByItsConformityLevel) {
  const Bytes basic = client.ask({0x2B, 0x0E, 1, 0});
  for (std::uint8_t code = 2; code <= 3; ++code) {
    Bytes expected = basic;
    expected[2] = code;
    EXPECT_EQ(client.ask({0x2B, 0x0E, code, 0}), expected);
  }
  EXPECT_EQ(client.ask({0x2B, 0x0E, 1, 0x80}), basic);
  EXPECT_EQ(client.ask({0x2B, 0x0E, 5, 0}), exception(0x2B, 3));
  EXPECT_EQ(client.ask({0x2B, 0x0E, 1}), exception(0x2B, 3));
}

// --- V1.02 --------------------------------------------------------------------------------------------

/// Unit 17 on a line, with a clock.
class ModbusLine : public testing::Test {
 protected:
  static constexpr std::uint32_t gap_us = 50'000;

  /// Bytes in one burst, `after_us` after what came last; the answer.
  Bytes hear(const Bytes& bytes, std::uint32_t after_us = 5000) {
    out.bytes.clear();
    line.poll(now += after_us / 2);
    now += after_us - after_us / 2;
    line.receive(bytes.data(), bytes.size(), now);
    return out.bytes;
  }
  /// The gap; what is answered by then.
  Bytes gap() {
    out.bytes.clear();
    line.poll(now += gap_us);
    return out.bytes;
  }
  Bytes ask(const Bytes& pdu) { return hear(rtu(17, pdu)); }
  unsigned diagnose(unsigned sub, unsigned data = 0) {
    const Bytes r = ask(join({{8}, be({sub, data})}));
    if (r.size() != 8 || r[1] != 8) return 0xFFFFFF;
    return (static_cast<unsigned>(r[4]) << 8U) | r[5];
  }
  unsigned count(unsigned sub) { return diagnose(sub); }

  Arm arm;
  Wire out;
  ModbusServer server{*arm.device, 1};
  ModbusRtu line{server, 17, gap_us, out.transmit()};
  std::uint32_t now = 0xFFFF0000U;
  const Bytes request = rtu(17, {3, 2, 0, 0, 1});
  const Bytes answer = rtu(17, {3, 2, 0, 0});
};

TEST_F(ModbusLine, NoiseDoesNotSwallowARequestAfterASilence) {
  std::mt19937 random(5);
  unsigned late = 0;
  constexpr unsigned rounds = 20000;
  for (unsigned k = 0; k < rounds; ++k) {
    Bytes noise(1 + random() % 300);
    for (auto& b : noise) b = static_cast<std::uint8_t>(random());
    if (k % 4 == 0) noise[0] = 17;
    if (k % 8 == 0 && noise.size() > 1) noise[1] = 0x10;
    if (k % 16 == 0) noise.resize(std::min<std::size_t>(noise.size(), 6));
    hear(noise, 60'000);
    Bytes said = hear(request, 2000);
    if (said != answer) {
      // What looks like the beginning of a longer frame is waited for until the gap, and no longer.
      ++late;
      said = gap();
    }
    ASSERT_EQ(said, answer) << k;
  }
  // Nothing else than noise that happens to begin a frame.
  EXPECT_LT(late, rounds / 100);
}

TEST_F(ModbusLine, ARequestInPiecesAfterNoise) {
  hear({0x55, 0xAA, 0x11, 0x03}, 60'000);
  hear(Bytes(request.begin(), request.begin() + 3), 2000);
  EXPECT_EQ(hear(Bytes(request.begin() + 3, request.end()), 3000), answer);
}

TEST_F(ModbusLine, ATornRequestAndItsRepetition) {
  for (std::size_t n = 1; n < request.size(); ++n) {
    hear(Bytes(request.begin(), request.begin() + static_cast<std::ptrdiff_t>(n)), 60'000);
    EXPECT_EQ(hear(request), answer) << n;
  }
}

// An adapter that passes bytes on in bursts, with pauses longer than the standard's silence.
TEST_F(ModbusLine, FramesTornByPausesAreWhole) {
  std::mt19937 random(8);
  for (unsigned k = 0; k < 20000; ++k) {
    Bytes data(2 * (1 + random() % 100));
    // Much of it looks like the beginning of a frame.
    for (auto& b : data) b = std::array<std::uint8_t, 6>{17, 0, 3, 8, 0x10, 0xFF}.at(random() % 6);
    const Bytes head = be({map::probe_request, static_cast<unsigned>(data.size() / 2)});
    const Bytes frame = rtu(17, join({{0x10}, head, {static_cast<std::uint8_t>(data.size())}, data}));
    Bytes said;
    for (std::size_t at = 0; at < frame.size();) {
      const std::size_t n = std::min<std::size_t>(1 + random() % 40, frame.size() - at);
      const auto from = frame.begin() + static_cast<std::ptrdiff_t>(at);
      said = join({said, hear(Bytes(from, from + static_cast<std::ptrdiff_t>(n)),
                              static_cast<std::uint32_t>(random() % 20'000))});
      at += n;
    }
    ASSERT_EQ(said, rtu(17, join({{0x10}, head}))) << k;
  }
}

// A transceiver that is switched off may be heard as a character.
TEST_F(ModbusLine, ACharacterTooManyAfterARequest) {
  for (const unsigned glitch : {0x00U, 0xFFU, 0x11U, 0x03U}) {
    EXPECT_EQ(hear(join({request, {static_cast<std::uint8_t>(glitch)}})), answer);
    EXPECT_EQ(hear(request), answer) << glitch;
  }
  EXPECT_EQ(count(12), 4U);
}

// A process that was held up reads noise and request in one portion: it is found at the gap.
TEST_F(ModbusLine, NoiseAndRequestInOnePortion) {
  std::mt19937 random(6);
  for (unsigned k = 0; k < 2000; ++k) {
    Bytes noise(1 + random() % 240);
    for (auto& b : noise) b = static_cast<std::uint8_t>(random());
    Bytes said = hear(join({noise, request}), 60'000);
    if (said.empty()) said = gap();
    ASSERT_EQ(said, answer) << k;
  }
}

// A frame within the data of another one is data, whoever the other one is for (no silence before it).
TEST_F(ModbusLine, AFrameWithinAFrameIsNotCarriedOut) {
  ASSERT_EQ(arm.push(make_image(arm.robot, 1)), wire::Answer::accepted);
  const Bytes inner = rtu(17, join({{6}, be({map::command, 8})}));
  for (const unsigned unit : {17U, 18U}) {
    Bytes data(60);
    std::copy(inner.begin(), inner.end(), data.begin() + 20);
    const Bytes whole = rtu(static_cast<std::uint8_t>(unit), join({{0x10}, be({0x300, 30}), {60}, data}));
    for (std::size_t cut = 1; cut < whole.size(); ++cut) {
      const auto at = whole.begin() + static_cast<std::ptrdiff_t>(cut);
      hear(Bytes(whole.begin(), at), 60'000);
      hear(Bytes(at, whole.end()), 2000);
      gap();
      ASSERT_EQ(arm.device->status().state, static_cast<std::uint16_t>(wire::StoreState::idle)) << cut;
    }
  }
  arm.settle();
  EXPECT_EQ(arm.sequence(), 1U);
}

TEST_F(ModbusLine, ReturnQueryDataOfAnyEvenLength) {
  for (std::size_t n = 2; n <= 250; n += 2) {
    Bytes pdu{8, 0, 0};
    for (std::size_t k = 0; k < n; ++k) pdu.push_back(static_cast<std::uint8_t>(31 * k + n));
    EXPECT_EQ(ask(pdu), rtu(17, pdu)) << n;
    // Byte by byte any of its parts may have a right checksum: it ends at the gap.
    Bytes said;
    for (const std::uint8_t b : rtu(17, pdu)) said = join({said, hear({b}, 100)});
    if (n > 2) said = join({said, gap()});
    EXPECT_EQ(said, rtu(17, pdu)) << n;
  }
  EXPECT_EQ(hear({0x33, 0x44}, 60'000), Bytes{});
  const Bytes pdu{8, 0, 0, 1, 2, 3, 4};
  Bytes said = ask(pdu);
  if (said.empty()) said = gap();
  EXPECT_EQ(said, rtu(17, pdu)) << "after noise, too";
}

// 2.1: no answer to a broadcast; decision of ours: it changes nothing of a set.
TEST_F(ModbusLine, NoBroadcastChangesASet) {
  ASSERT_EQ(arm.push(make_image(arm.robot, 1)), wire::Answer::accepted);
  ASSERT_EQ(arm.push(make_image(arm.robot, 2, 1, 2)), wire::Answer::accepted);
  const Bytes image = arm.pull();
  const auto slots = arm.flash.slots;
  const auto broadcast_all = [&](unsigned command) {
    out.answers = 0;
    hear(rtu(0, join({{6}, be({map::command, command})})));
    hear(rtu(0, join({{0x10}, be({map::argument, 3}), {6}, be({0, 100, command})})));
    hear(rtu(0, join({{0x10}, be({map::command, 1}), {2}, be({command})})));
    hear(rtu(0, join({{0x17}, be({map::status, 1, map::argument, 3}), {6}, be({0, 100, command})})));
    hear(rtu(0, join({{0x10}, be({map::staging_offset, 3}), {6}, be({0, 0, 0x5555})})));
    EXPECT_EQ(out.answers, 0U);
  };
  const auto staged_state = [&] { return arm.device->status().state; };
  for (unsigned command = 0; command < 300; ++command) {
    broadcast_all(command);
    ASSERT_EQ(staged_state(), static_cast<std::uint16_t>(wire::StoreState::idle)) << command;
  }
  // While somebody stages, verified or on trial.
  const Bytes next = make_image(arm.robot, 3, 1, 3);
  for (unsigned command = 0; command < 10; ++command) {
    ASSERT_EQ(arm.stage(next), wire::Answer::accepted);
    broadcast_all(command);
    ASSERT_EQ(arm.device->status().staged_bytes, next.size());
    ASSERT_EQ(arm.verify(), wire::Answer::accepted);
    broadcast_all(command);
    ASSERT_EQ(staged_state(), static_cast<std::uint16_t>(wire::StoreState::verified)) << command;
  }
  // The bus itself is who stages.
  Client same(*arm.device, 1);
  arm.run(wire::Command::abort);
  ASSERT_EQ(same.stage(next)[0], 0x10);
  for (unsigned command = 0; command < 10; ++command) broadcast_all(command);
  ASSERT_EQ(staged_state(), static_cast<std::uint16_t>(wire::StoreState::receiving));
  ASSERT_EQ(arm.run(wire::Command::commit_trial, 100000), wire::Answer::accepted);
  arm.settle();
  ASSERT_EQ(staged_state(), static_cast<std::uint16_t>(wire::StoreState::trial));
  for (unsigned command = 0; command < 10; ++command) {
    broadcast_all(command);
    ASSERT_EQ(staged_state(), static_cast<std::uint16_t>(wire::StoreState::trial)) << command;
  }
  ASSERT_EQ(arm.run(wire::Command::rollback), wire::Answer::accepted);
  arm.settle();
  EXPECT_EQ(arm.pull(), image);
  // The trial used the other slot; the one that is active is as it was.
  const unsigned slot = arm.device->store().active_slot();
  EXPECT_EQ(arm.flash.slots[slot], slots[slot]);
}

// A broadcast of what cannot do harm is carried out; only what writes is broadcast (2.1).
TEST_F(ModbusLine, OtherBroadcastsAreCarriedOut) {
  EXPECT_EQ(hear(rtu(0, join({{6}, be({map::reading_offset + 1U, 5})}))), Bytes{});
  EXPECT_EQ(ask(join({{3}, be({map::reading_offset, 2})})), rtu(17, {3, 4, 0, 0, 0, 5}));
  EXPECT_EQ(hear(rtu(0, join({{0x10}, be({map::reading_offset, 2}), {4}, be({0, 6})}))), Bytes{});
  EXPECT_EQ(ask(join({{3}, be({map::reading_offset, 2})})), rtu(17, {3, 4, 0, 0, 0, 6}));
  EXPECT_EQ(hear(rtu(0, join({{8}, be({4, 0})}))), Bytes{});
  EXPECT_EQ(count(11), 6U) << "nobody is silenced by a broadcast";
}

// Appendix A.2 (CPT1 … CPT8) and V1.1b3, 6.8: what each counter counts.
TEST_F(ModbusLine, CountersCountWhatTheStandardSays) {
  EXPECT_EQ(diagnose(10), 0U);
  EXPECT_EQ(count(11), 1U) << "bus messages: the question itself";
  hear(rtu(18, {3, 0, 0, 0, 1}));
  hear(rtu(18, {3, 2, 0, 0}));
  EXPECT_EQ(count(11), 4U) << "those of others as well";
  EXPECT_EQ(count(14), 3U) << "server messages: not those of others";
  EXPECT_EQ(count(15), 0U) << "no response";
  EXPECT_EQ(hear(rtu(0, join({{6}, be({map::reading_offset, 0})}))), Bytes{});
  EXPECT_EQ(count(15), 1U) << "a broadcast is not answered";
  EXPECT_EQ(count(14), 7U) << "but it is a message to this server";

  EXPECT_EQ(count(13), 0U) << "exceptions";
  EXPECT_EQ(ask({3, 0x90, 0, 0, 1}), rtu(17, exception(3, 2)));
  EXPECT_EQ(count(13), 1U);
  EXPECT_EQ(hear(rtu(0, join({{6}, be({map::command, 8})}))), Bytes{});
  EXPECT_EQ(count(13), 2U) << "that of a broadcast, which is not sent";
  EXPECT_EQ(count(16), 0U) << "NAK is not given";
  EXPECT_EQ(count(17), 0U) << "busy";
  Client other(*arm.device, 2);
  ASSERT_EQ(other.run(wire::Command::begin, 100)[0], 0x10);
  EXPECT_EQ(ask(join({{0x10}, be({map::argument, 3}), {6}, be({0, 100, 1})})), rtu(17, exception(0x10, 6)));
  EXPECT_EQ(count(17), 1U);
  EXPECT_EQ(count(13), 3U) << "busy is an exception";

  EXPECT_EQ(count(12), 0U) << "communication errors";
  Bytes bad = request;
  bad.back() ^= 1U;
  hear(bad);
  gap();
  EXPECT_EQ(count(12), 1U) << "a wrong checksum";
  hear({17, 3}, 60'000);
  gap();
  EXPECT_EQ(count(12), 2U) << "shorter than a frame";
  hear(bad, 60'000);
  EXPECT_EQ(hear(request), answer);
  EXPECT_EQ(count(12), 3U) << "followed by a good one";

  EXPECT_EQ(count(18), 0U) << "character overrun";
  hear(Bytes(300, 17), 60'000);
  gap();
  EXPECT_EQ(count(18), 1U) << "more characters than a frame has";
  EXPECT_EQ(count(12), 4U);
  for (const bool overrun : {true, false}) {
    hear(Bytes(request.begin(), request.begin() + 4), 60'000);
    line.line_error(overrun);
    EXPECT_EQ(hear(Bytes(request.begin() + 4, request.end()), 500), Bytes{});
    EXPECT_EQ(hear(request), answer) << "the next frame is good";
  }
  EXPECT_EQ(count(18), 2U) << "the receiver's own";
  EXPECT_EQ(count(12), 6U);
  EXPECT_EQ(diagnose(20), 0U);
  EXPECT_EQ(count(18), 0U);
  EXPECT_EQ(count(12), 6U);
  EXPECT_EQ(diagnose(10), 0U);
  for (const unsigned sub : {12U, 13U, 15U, 16U, 17U, 18U}) EXPECT_EQ(count(sub), 0U) << sub;
}

TEST_F(ModbusLine, DiagnosticsRefuseWhatTheyDoNotHave) {
  for (unsigned sub = 0; sub < 0x200; ++sub) {
    if (sub <= 2 || sub == 4 || (sub >= 10 && sub <= 18) || sub == 20) continue;
    EXPECT_EQ(ask(join({{8}, be({sub, 0})})), rtu(17, exception(8, 1))) << sub;
  }
  for (const unsigned sub : {1U, 2U, 4U, 10U, 11U, 12U, 13U, 14U, 15U, 16U, 17U, 18U, 20U}) {
    EXPECT_EQ(ask(join({{8}, be({sub, 1})})), rtu(17, exception(8, 3))) << sub;
  }
}

// 6.8.1, sub-functions 01, 02, 04.
TEST_F(ModbusLine, ListenOnlyModeEndsByARestart) {
  EXPECT_EQ(diagnose(2), wire::fault::no_valid_set) << "the diagnostic register: bits of the faults";
  EXPECT_EQ(diagnose(1), 0U) << "answered, then restarted";
  EXPECT_EQ(count(11), 1U);
  EXPECT_EQ(diagnose(1, 0xFF00), 0xFF00U);
  EXPECT_EQ(count(14), 1U);
  EXPECT_EQ(ask(join({{8}, be({4, 0})})), Bytes{}) << "no answer to this one either";
  EXPECT_EQ(hear(request), Bytes{});
  EXPECT_EQ(ask(join({{6}, be({map::reading_offset, 7})})), Bytes{}) << "nothing is carried out";
  EXPECT_EQ(hear(rtu(0, join({{6}, be({map::reading_offset, 7})}))), Bytes{});
  EXPECT_EQ(ask({0x55}), Bytes{});
  EXPECT_EQ(gap(), Bytes{});
  EXPECT_EQ(ask(join({{8}, be({11, 0})})), Bytes{});
  EXPECT_EQ(ask(join({{8}, be({1, 0})})), Bytes{}) << "leaves the mode, unanswered";
  EXPECT_EQ(count(11), 1U) << "and clears the counters";
  EXPECT_EQ(ask(join({{3}, be({map::reading_offset, 1})})), rtu(17, {3, 2, 0, 0}));
}

// 6.9: successful messages; not exceptions, not the question itself.
TEST_F(ModbusLine, CommunicationEventCounter) {
  EXPECT_EQ(ask({0x0B}), rtu(17, {0x0B, 0, 0, 0, 0}));
  EXPECT_EQ(hear(request), answer);
  EXPECT_EQ(ask({3, 0x90, 0, 0, 1}), rtu(17, exception(3, 2)));
  EXPECT_EQ(ask({0x0B}), rtu(17, {0x0B, 0, 0, 0, 1}));
  EXPECT_EQ(diagnose(10), 0U);
  EXPECT_EQ(ask({0x0B}), rtu(17, {0x0B, 0, 0, 0, 0}));
}

TEST_F(ModbusLine, ReportServerId) {
  const Bytes r = ask({0x11});
  ASSERT_GT(r.size(), 7U);
  EXPECT_EQ(r[1], 0x11);
  EXPECT_EQ(r[3], 0xF1);
}

// --- V1.0b --------------------------------------------------------------------------------------------

// 4.4.2.1: "If it is different from MODBUS protocol type, the indication is simply discarded."
TEST_F(ModbusStandard, AnotherProtocolIsDiscarded) {
  Wire out;
  ModbusTcp tcp(client.server, 7, out.transmit());
  const Bytes other = be({1, 1, 6, 0x0703, 0xA0, 2});
  const Bytes good = be({2, 0, 6, 0x0703, 0xA0, 2});
  for (const Bytes& b : {other, good, other, good}) EXPECT_TRUE(tcp.receive(b.data(), b.size()));
  EXPECT_EQ(out.answers, 2U);
}

}  // namespace
}  // namespace flexcomp::firmware::bench
