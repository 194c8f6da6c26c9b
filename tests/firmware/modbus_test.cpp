// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "firmware/modbus_bench.hpp"

namespace flexcomp::firmware::bench {
namespace {

class ModbusPdu : public testing::Test {
 protected:
  Arm arm;
  Client client{*arm.device, 1};
};

TEST_F(ModbusPdu, TellsTheCertificateOfTheActiveSet) {
  ASSERT_EQ(arm.push(make_image(arm.robot, 4)), wire::Answer::accepted);
  for (const std::uint8_t f : {std::uint8_t{3}, std::uint8_t{4}}) {
    const Bytes r = client.read(map::certificate, map::certificate_registers, f);
    ASSERT_EQ(r.size(), 2 + wire::certificate_bytes);
    wire::CertificateRecord record;
    wire::decode(r.data() + 2, wire::ByteOrder::big, record);
    EXPECT_EQ(record.sequence, 4U);
    EXPECT_EQ(record.position_m, arm.device->certificate().position_m);
    EXPECT_EQ(record.instructions, arm.device->certificate().instructions);
  }
  EXPECT_EQ(client.ask(join({{6}, be({map::certificate, 1})})), exception(6, 2)) << "read only";
}

TEST_F(ModbusPdu, ChecksQuantityAndByteCountThenAddress) {
  for (const std::uint8_t f : {std::uint8_t{3}, std::uint8_t{4}}) {
    EXPECT_EQ(client.read(0, 0, f), exception(f, 3));
    EXPECT_EQ(client.read(0, 126, f), exception(f, 3));
    EXPECT_EQ(client.read(0xFFFF, 126, f), exception(f, 3)) << "quantity before address";
    EXPECT_EQ(client.read(0xFFFF, 2, f), exception(f, 2));
    EXPECT_EQ(client.read(0xFFFF, 1, f), exception(f, 2));
    EXPECT_EQ(client.read(0x6F, 2, f), exception(f, 2)) << "one register too many";
    EXPECT_EQ(client.read(0, 112, f).size(), 226U) << "two blocks that touch";
    EXPECT_EQ(client.ask({f, 0, 0, 0}), exception(f, 3));
    EXPECT_EQ(client.ask({f, 0, 0, 0, 1, 0}), exception(f, 3));
  }
  EXPECT_EQ(client.ask(join({{6}, be({0x40, 1})})), exception(6, 2)) << "read only";
  EXPECT_EQ(client.ask(join({{6}, be({0x9000, 1})})), exception(6, 2));
  EXPECT_EQ(client.ask({6, 0, 0xA0}), exception(6, 3));
  EXPECT_EQ(client.ask(join({{6}, be({0xA1, 7})})), join({{6}, be({0xA1, 7})})) << "echo";
  EXPECT_EQ(client.read(0xA0, 2), join({{3, 4}, be({0, 7})}));

  EXPECT_EQ(client.ask(join({{0x10}, be({0xA0, 0}), {0}})), exception(0x10, 3));
  EXPECT_EQ(client.ask(join({{0x10}, be({0x102, 124}), {248}, Bytes(248)})), exception(0x10, 3));
  EXPECT_EQ(client.ask(join({{0x10}, be({0xFFFF, 2}), {4}, Bytes(4)})), exception(0x10, 2));
  EXPECT_EQ(client.ask(join({{0x10}, be({0x9F, 1}), {3}, Bytes(2)})), exception(0x10, 3))
      << "count before address";
  EXPECT_EQ(client.ask(join({{0x10}, be({0xA0, 2}), {3}, Bytes(4)})), exception(0x10, 3));
  EXPECT_EQ(client.ask(join({{0x10}, be({0xA0, 2}), {4}, Bytes(3)})), exception(0x10, 3));
  EXPECT_EQ(client.ask(join({{0x10}, be({0xA0, 2}), {4}, Bytes(4)})), join({{0x10}, be({0xA0, 2})}));

  const auto both = [](unsigned from, unsigned reads, unsigned to, unsigned writes, std::uint8_t count,
                       std::size_t data) {
    return join({{0x17}, be({from, reads, to, writes}), {count}, Bytes(data)});
  };
  EXPECT_EQ(client.ask(both(0, 0, 0xA0, 1, 2, 2)), exception(0x17, 3));
  EXPECT_EQ(client.ask(both(0, 126, 0xA0, 1, 2, 2)), exception(0x17, 3));
  EXPECT_EQ(client.ask(both(0, 1, 0xA0, 0, 0, 0)), exception(0x17, 3));
  EXPECT_EQ(client.ask(both(0, 1, 0x102, 122, 244, 244)), exception(0x17, 3));
  EXPECT_EQ(client.ask(both(0xFFFF, 2, 0xA0, 1, 2, 2)), exception(0x17, 2));
  EXPECT_EQ(client.ask(both(0, 1, 0x40, 1, 2, 2)), exception(0x17, 2));
  EXPECT_EQ(client.ask(both(0, 1, 0xA0, 1, 3, 2)), exception(0x17, 3));
  EXPECT_EQ(client.ask(both(0xA0, 2, 0xA0, 2, 4, 4)).size(), 6U);
}

TEST_F(ModbusPdu, OtherFunctions) {
  for (unsigned f = 0; f < 256; ++f) {
    if (f == 3 || f == 4 || f == 6 || f == 8 || f == 0x10 || f == 0x11 || f == 0x17 || f == 0x2B) continue;
    EXPECT_EQ(client.ask({static_cast<std::uint8_t>(f), 0, 0, 0, 1}), exception(f, 1)) << f;
  }
  EXPECT_EQ(client.ask({8, 0, 0, 0x12, 0x34}), (Bytes{8, 0, 0, 0x12, 0x34}));
  EXPECT_EQ(client.ask({8, 0, 1, 0, 0}), exception(8, 1));
  EXPECT_EQ(client.ask({8}), exception(8, 3));
  EXPECT_EQ(client.ask({0x2B, 0x0D, 0, 0}), exception(0x2B, 1));
  EXPECT_EQ(client.ask({0x2B, 0x0E, 0, 0}), exception(0x2B, 3));
  EXPECT_EQ(client.ask({0x2B, 0x0E, 4, 9}), exception(0x2B, 2));
  EXPECT_EQ(client.ask({0x2B, 0x0E, 1, 0}).size(), 7U + 10 + 10 + 7);
  EXPECT_EQ(client.ask({0x2B, 0x0E, 4, 2}),
            (Bytes{0x2B, 0x0E, 4, 0x81, 0, 0, 1, 2, 5, '0', '.', '1', '.', '0'}));
  EXPECT_EQ(client.ask({}), Bytes{});
}

TEST_F(ModbusPdu, PushPullAndProbe) {
  const Bytes image = make_image(arm.robot, 5);
  ASSERT_EQ(client.stage(image)[0], 0x10);
  EXPECT_EQ(client.run(wire::Command::verify)[0], 0x10);
  EXPECT_EQ(client.status().state, static_cast<std::uint16_t>(wire::StoreState::working));
  arm.until_done();
  EXPECT_EQ(client.status().state, static_cast<std::uint16_t>(wire::StoreState::verified));
  EXPECT_EQ(client.run(wire::Command::commit)[0], 0x10);
  arm.settle();
  const wire::Status s = client.status();
  EXPECT_EQ(s.active_sequence, 5U);
  EXPECT_EQ(client.pull(s.active_bytes), image);
  EXPECT_EQ(client.read(map::reading_window, 1)[0], 3);
  // Beyond the image: not even one register.
  client.write(map::reading_offset, be({0, static_cast<unsigned>(image.size() - 2)}));
  EXPECT_EQ(client.read(map::reading_window, 1).size(), 4U);
  EXPECT_EQ(client.read(map::reading_window, 2), exception(3, 2));
  client.write(map::reading_offset, be({0xFFFF, 0xFFFF}));
  EXPECT_EQ(client.read(map::reading_window, 1), exception(3, 2));

  Joints q = {real(0.1), real(-0.2), real(0.3), real(0.4), real(0.5), real(-0.6)};
  wire::ProbeRequest request;
  for (std::size_t j = 0; j < joints; ++j) request.q_rad[j] = to_binary64_bits(q[j]);
  Bytes record(wire::probe_request_bytes);
  wire::encode(request, wire::ByteOrder::big, record.data());
  const Bytes r =
      client.ask(join({{0x17},
                       be({map::probe_response, map::probe_response_registers, map::probe_request, 109}),
                       {218},
                       record,
                       be({map::trigger_default_context})}));
  ASSERT_EQ(r.size(), 2 + wire::probe_response_bytes);
  wire::ProbeResponse answer;
  wire::decode(r.data() + 2, wire::ByteOrder::big, answer);
  const auto expected = by_the_core(arm.robot, image, q, default_context<Scalar>(arm.robot));
  for (std::size_t j = 0; j < joints; ++j) EXPECT_EQ(answer.q_rad[j], to_binary64_bits(expected.q[j]));
  EXPECT_EQ(answer.sequence, 5U);
  EXPECT_EQ(client.ask(join({{6}, be({map::probe_trigger, 3})})), exception(6, 4));

  // The flags follow the response: a client that reads it alone gets what it always got.
  EXPECT_EQ(client.read(map::probe_flags, 1), Bytes({3, 2, 0, 0})) << "nothing holds it back";
  request.q_rad[4] = to_binary64_bits(Scalar(0));  // the wrist is straight
  wire::encode(request, wire::ByteOrder::big, record.data());
  const auto ask = [&](unsigned registers) {
    return client.ask(join({{0x17},
                            be({map::probe_response, registers, map::probe_request, 109}),
                            {218},
                            record,
                            be({map::trigger_default_context})}));
  };
  const Bytes longer = ask(map::probe_response_registers + 1);
  ASSERT_EQ(longer.size(), 2 + wire::probe_response_bytes + 2);
  EXPECT_EQ(Bytes(longer.end() - 2, longer.end()), Bytes({0, step_flag::near_singular}));
  const Bytes shorter = ask(map::probe_response_registers);
  EXPECT_EQ(Bytes(shorter.begin() + 2, shorter.end()), Bytes(longer.begin() + 2, longer.end() - 2));
  EXPECT_EQ(ask(map::probe_response_registers + 2), exception(0x17, 2));
  EXPECT_EQ(client.write(map::probe_flags, be({0})), exception(16, 2));
}

TEST_F(ModbusPdu, RefusesWithTheReasonInTheStatus) {
  Bytes image = make_image(arm.robot, 1);
  image[200] ^= 1U;
  client.stage(image);
  EXPECT_EQ(client.run(wire::Command::commit)[0], 0x10);
  arm.until_done();
  EXPECT_EQ(client.status().answer, static_cast<std::uint16_t>(wire::Answer::refused));
  EXPECT_EQ(client.status().refusal, static_cast<std::uint16_t>(Refusal::checksum));
  client.stage(make_image(arm.robot, 1));
  Client other(*arm.device, 2);
  EXPECT_EQ(other.run(wire::Command::begin, 100), exception(0x10, 6));
  EXPECT_EQ(other.status().answer, static_cast<std::uint16_t>(wire::Answer::busy));
  client.server.disconnect();
  EXPECT_EQ(other.run(wire::Command::begin, 101)[0], 0x10);
  EXPECT_EQ(other.write(map::staging_offset, be({0, 2, 0})), exception(0x10, 4)) << "a gap";
  EXPECT_EQ(other.write(map::staging_offset, be({0xFFFF, 0xFFFF, 0})), exception(0x10, 4));
  Bytes odd(102);
  EXPECT_EQ(other.write(map::staging_offset, join({be({0, 0}), odd}))[0], 0x10) << "an odd length is padded";
  EXPECT_EQ(other.status().staged_bytes, 101U);
  EXPECT_EQ(other.write(map::staging_offset, join({be({0, 0}), odd, be({0})})), exception(0x10, 4));
  EXPECT_EQ(other.run(wire::Command::verify)[0], 0x10);
  arm.until_done();
  EXPECT_EQ(other.status().answer, static_cast<std::uint16_t>(wire::Answer::refused));
  EXPECT_EQ(other.read(map::reading_window, 1), exception(3, 2)) << "no active image";
}

TEST(ModbusCrc, CheckValue) {
  const char text[] = "123456789";
  EXPECT_EQ(modbus_crc(reinterpret_cast<const std::uint8_t*>(text), 9), 0x4B37);
}

class ModbusFraming : public testing::Test {
 protected:
  Arm arm;
  ModbusServer server{*arm.device, 1};
  Wire wire_out;
};

TEST_F(ModbusFraming, RtuByLengthInAnyPortions) {
  ModbusRtu line(server, 17, 1750, wire_out.transmit());
  const Bytes request = join({{3}, be({0xA0, 2})});
  Bytes stream;
  for (int k = 0; k < 10; ++k)
    stream = join({stream, rtu(17, request), rtu(17, join({{0x10}, be({0xA0, 2}), {4}, Bytes(4)}))});
  std::mt19937 random(1);
  for (std::size_t at = 0; at < stream.size();) {
    const std::size_t n = std::min<std::size_t>(1 + random() % 20, stream.size() - at);
    line.receive(stream.data() + at, n, 1000);
    at += n;
  }
  EXPECT_EQ(wire_out.answers, 20U);
  const Bytes answer = rtu(17, {3, 4, 0, 0, 0, 0});
  EXPECT_EQ(
      Bytes(wire_out.bytes.begin(), wire_out.bytes.begin() + static_cast<std::ptrdiff_t>(answer.size())),
      answer);
}

TEST_F(ModbusFraming, RtuBroadcastOthersAndUnknown) {
  ModbusRtu line(server, 17, 1750, wire_out.transmit());
  std::uint32_t now = 0;
  const auto send = [&](const Bytes& b) {
    line.receive(b.data(), b.size(), now += 10000);
    line.poll(now += 10000);
    return wire_out.answers;
  };
  EXPECT_EQ(send(rtu(0, join({{6}, be({0x201, 5})}))), 0U) << "carried out, not answered";
  EXPECT_EQ(send(rtu(17, join({{3}, be({0x201, 1})}))), 1U);
  EXPECT_EQ(wire_out.bytes, rtu(17, {3, 2, 0, 5}));
  EXPECT_EQ(send(rtu(18, join({{3}, be({0xA1, 1})}))), 1U);
  EXPECT_EQ(send(rtu(18, Bytes{3, 2, 0, 5})), 1U) << "somebody else's answer";
  // Request and answer of another unit without a gap that we could see, then ours.
  EXPECT_EQ(send(join({rtu(18, join({{3}, be({0, 10})})), rtu(18, join({{3, 20}, Bytes(20)})),
                       rtu(17, {3, 0, 0xA1, 0, 1})})),
            2U);
  EXPECT_EQ(send(rtu(17, {0x55, 1, 2})), 3U) << "unknown function, ended by the gap";
  EXPECT_EQ(Bytes(wire_out.bytes.end() - 5, wire_out.bytes.end()), rtu(17, exception(0x55, 1)));
  Bytes bad = rtu(17, {3, 0, 0xA1, 0, 1});
  bad.back() ^= 1U;
  EXPECT_EQ(send(bad), 3U);
  EXPECT_EQ(send({17, 3, 0}), 3U) << "torn";
  EXPECT_EQ(send(rtu(17, {3, 0, 0xA1, 0, 1})), 4U) << "in step again after the gap";
  EXPECT_EQ(send(Bytes(1000, 17)), 4U);
  EXPECT_EQ(send(rtu(17, {3, 0, 0xA1, 0, 1})), 5U);
}

TEST_F(ModbusFraming, TcpInAnyPortions) {
  const auto frame = [](unsigned id, std::uint8_t unit, const Bytes& pdu) {
    return join({be({id, 0, static_cast<unsigned>(pdu.size() + 1)}), {unit}, pdu});
  };
  const Bytes pdu = join({{3}, be({0xA0, 2})});
  Bytes stream;
  for (unsigned k = 0; k < 20; ++k) {
    const std::uint8_t units[4] = {0, 255, 7, 9};
    stream = join({stream, frame(k, units[k % 4], pdu)});
  }
  for (std::size_t portion = 1; portion <= stream.size(); ++portion) {
    Wire out;
    ModbusTcp tcp(server, 7, out.transmit());
    for (std::size_t at = 0; at < stream.size(); at += portion) {
      ASSERT_TRUE(tcp.receive(stream.data() + at, std::min(portion, stream.size() - at)));
    }
    ASSERT_EQ(out.answers, 15U) << "unit 9 is somebody else";
    ASSERT_EQ(Bytes(out.bytes.begin() + 13, out.bytes.begin() + 26), frame(1, 255, {3, 4, 0, 0, 0, 0}));
  }
}

TEST_F(ModbusFraming, TcpGivesUpOnWhatIsNotModbus) {
  const auto receive = [this](const Bytes& b) {
    ModbusTcp tcp(server, 7, wire_out.transmit());
    const bool ok = tcp.receive(b.data(), b.size());
    const Bytes good = be({0, 0, 6, 0x0703, 0xA0, 2});
    EXPECT_EQ(tcp.receive(good.data(), good.size()), ok);
    return ok;
  };
  EXPECT_FALSE(receive(be({1, 0, 1, 0x0703})));
  EXPECT_FALSE(receive(be({1, 0, 255, 0x0703})));
  EXPECT_EQ(wire_out.answers, 0U);
}

// Random and half-random bytes into all three layers.
TEST_F(ModbusFraming, SurvivesMillionsOfBytes) {
  std::mt19937 engine(9);
  const auto random = [&engine] { return static_cast<std::uint32_t>(engine()); };
  Client client(*arm.device, 2);
  ModbusRtu line(server, 17, 1750, wire_out.transmit());
  const std::uint8_t functions[] = {3, 4, 6, 8, 0x10, 0x17, 0x2B, 0x55};
  const unsigned addresses[] = {0,     0x40,  0xA0,  0xA2,  0x100, 0x102, 0x200,
                                0x202, 0x300, 0x36C, 0x380, 0x400, 0x500};
  std::uint32_t now = 0;
  std::size_t bytes = 0;
  for (int k = 0; k < 60000; ++k) {
    Bytes pdu(1 + random() % 252);
    for (auto& b : pdu) b = static_cast<std::uint8_t>(random());
    if (random() % 4 != 0) {
      pdu[0] = functions[random() % 8];
      if (pdu.size() > 6) {
        const unsigned address = addresses[random() % 13] + random() % 3;
        const unsigned quantity = random() % 130;
        const Bytes head = be({address, quantity});
        std::copy(head.begin(), head.end(), pdu.begin() + 1);
        pdu[5] = static_cast<std::uint8_t>(2 * quantity);
        if (random() % 2 != 0) pdu.resize(pdu[0] == 0x10 ? std::min<std::size_t>(6 + 2 * quantity, 253) : 5);
      }
    }
    const Bytes answer = client.ask(pdu);
    ASSERT_GE(answer.size(), 2U);
    ASSERT_TRUE(answer[0] == pdu[0] || answer[0] == (pdu[0] | 0x80U));
    Bytes frame = random() % 2 != 0 ? rtu(random() % 2 != 0 ? 17 : 0, pdu) : pdu;
    frame.resize(std::min<std::size_t>(frame.size(), 300));
    line.receive(frame.data(), frame.size(), now += random() % 3000);
    if (random() % 8 == 0) {
      ModbusTcp tcp(server, 7, wire_out.transmit());
      tcp.receive(pdu.data(), pdu.size());
    }
    bytes += pdu.size() + frame.size();
    wire_out.bytes.clear();
    arm.device->store().poll(now / 1000);
    arm.step();
  }
  EXPECT_GT(bytes, 5000000U);
  EXPECT_FALSE(arm.flash.double_writes);
}

}  // namespace
}  // namespace flexcomp::firmware::bench
