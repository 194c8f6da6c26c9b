// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <array>
#include <optional>

#include "firmware/canopen_bench.hpp"

namespace flexcomp::firmware::bench {
namespace {

using wire::Answer;
using wire::Command;
using Frame = SdoFrame;

struct Sent {
  std::uint16_t id;
  Bytes bytes;
};

class Canopen : public testing::Test {
 protected:
  static constexpr std::uint8_t node_id = 5;

  Canopen() { poll(0); }

  void poll(std::uint32_t ms) { poll_node(arm, node, ms); }

  std::optional<Frame> ask(const Frame& f) {
    sent.clear();
    node.receive(co::sdo_request_id + node_id, f.data(), 8);
    if (sent.empty()) return std::nullopt;
    EXPECT_EQ(sent.size(), 1U);
    EXPECT_EQ(sent[0].id, co::sdo_answer_id + node_id);
    EXPECT_EQ(sent[0].bytes.size(), 8U);
    Frame out{};
    std::copy(sent[0].bytes.begin(), sent[0].bytes.end(), out.begin());
    return out;
  }

  /// Downloads by segments; returns the abort code.
  std::uint32_t download(std::uint16_t index, std::uint8_t sub, const Bytes& data, bool sized = true) {
    auto r =
        ask(sdo_frame(sized ? 0x21 : 0x20, index, sub, sized ? static_cast<std::uint32_t>(data.size()) : 0));
    if (abort_code_of(r) != 0) return abort_code_of(r);
    EXPECT_EQ(*r, sdo_frame(0x60, index, sub));
    unsigned toggle = 0;
    for (std::size_t at = 0; at < data.size(); at += 7) {
      const std::size_t n = std::min<std::size_t>(7, data.size() - at);
      Frame f{};
      f[0] = static_cast<std::uint8_t>(toggle | ((7 - n) << 1U) | (at + n == data.size() ? 1U : 0U));
      std::copy_n(data.begin() + static_cast<std::ptrdiff_t>(at), n, f.begin() + 1);
      r = ask(f);
      if (abort_code_of(r) != 0) return abort_code_of(r);
      EXPECT_EQ(*r, (Frame{static_cast<std::uint8_t>(0x20U | toggle)}));
      toggle ^= 0x10U;
    }
    return 0;
  }

  std::uint32_t expedited(std::uint16_t index, std::uint8_t sub, std::uint32_t value, unsigned size) {
    return abort_code_of(ask(sdo_frame(0x23U | ((4 - size) << 2U), index, sub, value)));
  }

  /// Uploads whatever there is; empty on an abort, whose code is stored.
  Bytes upload(std::uint16_t index, std::uint8_t sub) {
    auto r = ask(sdo_frame(0x40, index, sub));
    last_code = abort_code_of(r);
    if (last_code != 0) return {};
    if (((*r)[0] & 2U) != 0) return {r->begin() + 4, r->begin() + 8 - (((*r)[0] >> 2U) & 3U)};
    const std::uint32_t size = load_u32(r->data() + 4);
    Bytes out;
    for (unsigned toggle = 0;; toggle ^= 0x10U) {
      r = ask(Frame{static_cast<std::uint8_t>(0x60U | toggle)});
      last_code = abort_code_of(r);
      if (last_code != 0) return {};
      EXPECT_EQ((*r)[0] & 0xF0U, toggle);
      out.insert(out.end(), r->begin() + 1, r->begin() + 8 - (((*r)[0] >> 1U) & 7U));
      if (((*r)[0] & 1U) != 0) break;
    }
    EXPECT_EQ(out.size(), size);
    return out;
  }

  std::uint32_t number(std::uint16_t index, std::uint8_t sub) {
    Bytes b = upload(index, sub);
    b.resize(4);
    return load_u32(b.data());
  }

  std::uint32_t command(Command c, std::uint32_t argument = 0) {
    expedited(co::command, 1, argument, 4);
    return expedited(co::command, 2, static_cast<std::uint32_t>(c), 2);
  }

  /// What a client does before it rolls back or restores.
  void unlock() {
    EXPECT_EQ(command(Command::unlock), 0U);
    EXPECT_EQ(command(Command::unlock, status().detail), 0U);
  }

  wire::Status status() {
    wire::Status s;
    wire::decode(upload(co::status, 0).data(), wire::ByteOrder::little, s);
    return s;
  }

  Arm arm;
  std::vector<Sent> sent;         ///< but for EMCY
  std::vector<Sent> emergencies;  ///< EMCY
  bool full = false;
  std::uint32_t last_code = 0;
  CanopenNode node{*arm.device,
                   1,
                   {node_id, 100, 2000},
                   {this, [](void* self, std::uint16_t id, const std::uint8_t* b, std::uint8_t n) {
                      auto& t = *static_cast<Canopen*>(self);
                      if (t.full) return false;
                      const bool emergency = id == co::emergency_id + node_id;
                      (emergency ? t.emergencies : t.sent).push_back({id, Bytes(b, b + n)});
                      return true;
                    }}};
};

TEST_F(Canopen, BootUpHeartbeatAndNmt) {
  ASSERT_EQ(sent.size(), 1U);
  EXPECT_EQ(sent[0].id, 0x705);
  EXPECT_EQ(sent[0].bytes, Bytes{0});
  const auto beat = [this] {
    sent.clear();
    poll(100);
    return sent.size() == 1 && sent[0].id == 0x705 ? sent[0].bytes[0] : 0xFF;
  };
  const auto nmt = [this](std::uint8_t cs, std::uint8_t to) {
    const std::uint8_t b[2] = {cs, to};
    node.receive(0, b, 2);
  };
  EXPECT_EQ(beat(), 127);
  nmt(1, 6);
  EXPECT_EQ(beat(), 127) << "another node";
  nmt(1, node_id);
  EXPECT_EQ(beat(), 5);
  nmt(2, 0);
  EXPECT_EQ(beat(), 4);
  EXPECT_FALSE(ask(sdo_frame(0x40, 0x1000, 0))) << "no SDO when stopped";
  nmt(128, 0);
  EXPECT_EQ(beat(), 127);
  EXPECT_TRUE(ask(sdo_frame(0x40, 0x1000, 0)));
  nmt(77, 0);
  EXPECT_EQ(beat(), 127);
  expedited(0x1017, 0, 0, 2);
  sent.clear();
  poll(10000);
  EXPECT_TRUE(sent.empty()) << "heartbeat off";
  for (const std::uint8_t cs : {std::uint8_t{129}, std::uint8_t{130}}) {
    nmt(cs, node_id);
    sent.clear();
    EXPECT_FALSE(ask(sdo_frame(0x40, 0x1000, 0))) << "not before the boot-up message";
    poll(1);
    ASSERT_EQ(sent.size(), 1U);
    EXPECT_EQ(sent[0].bytes, Bytes{0});
    EXPECT_EQ(number(0x1017, 0), 100U) << "back to its value at power-on";
  }
}

TEST_F(Canopen, MandatoryObjects) {
  EXPECT_EQ(number(0x1000, 0), 0U);
  EXPECT_EQ(upload(0x1001, 0), Bytes{1}) << "no set yet";
  const Bytes name = upload(0x1008, 0);
  EXPECT_EQ(std::string(name.begin(), name.end()), "flexcomp");
  EXPECT_EQ(number(0x1018, 0), 4U);
  EXPECT_EQ(number(0x1018, 4), load_u32(arm.robot.name_hash.data()));
  EXPECT_EQ(number(0x1200, 1), 0x605U);
  EXPECT_EQ(number(0x1200, 2), 0x585U);
  EXPECT_EQ(upload(co::capability, 0).size(), wire::capability_bytes);
  EXPECT_EQ(upload(co::robot, 0).size(), wire::robot_record_bytes);
  wire::Capability c;
  wire::decode(upload(co::capability, 0).data(), wire::ByteOrder::little, c);
  EXPECT_EQ(c.nominal_hash, nominal_hash(arm.robot));
  EXPECT_EQ(c.scalar_bytes, sizeof(Scalar));
}

TEST_F(Canopen, AbortCodes) {
  EXPECT_EQ(abort_code_of(ask(sdo_frame(0x40, 0x3000, 0))), co::abort::no_object);
  EXPECT_EQ(abort_code_of(ask(sdo_frame(0x40, 0x1018, 5))), co::abort::no_sub_index);
  EXPECT_EQ(abort_code_of(ask(sdo_frame(0x40, co::image, 1))), co::abort::write_only);
  EXPECT_EQ(abort_code_of(ask(sdo_frame(0x40, co::image, 2))), co::abort::no_data);
  EXPECT_EQ(expedited(0x1000, 0, 1, 4), co::abort::read_only);
  EXPECT_EQ(expedited(0x3000, 0, 1, 4), co::abort::no_object);
  EXPECT_EQ(expedited(0x1017, 0, 1, 4), co::abort::too_long);
  EXPECT_EQ(expedited(0x1017, 0, 1, 1), co::abort::too_short);
  EXPECT_EQ(abort_code_of(ask(sdo_frame(0x22, 0x1017, 0, 500))), 0U) << "size not indicated";
  EXPECT_EQ(number(0x1017, 0), 500U);
  EXPECT_EQ(expedited(0x1010, 1, 0x11111111, 4), co::abort::not_stored);
  EXPECT_EQ(expedited(0x1011, 1, 0x11111111, 4), co::abort::not_stored);
  EXPECT_EQ(expedited(0x1010, 1, co::save_signature, 4), co::abort::device_state) << "nothing staged";
  EXPECT_EQ(command(static_cast<Command>(99)), co::abort::value);
  EXPECT_EQ(command(Command::rollback), co::abort::local_control) << "not unlocked";
  unlock();
  EXPECT_EQ(command(Command::rollback), co::abort::device_state) << "nothing to go back to";
  EXPECT_EQ(abort_code_of(ask(sdo_frame(0xE0, 0, 0))), co::abort::command);
  EXPECT_EQ(abort_code_of(ask(Frame{0x00})), co::abort::command) << "a segment without a transfer";
  EXPECT_EQ(abort_code_of(ask(Frame{0x60})), co::abort::command);
  EXPECT_FALSE(ask(sdo_frame(0x80, 0, 0))) << "an abort is not answered";

  // Toggle.
  ask(sdo_frame(0x21, co::image, 1, 100));
  EXPECT_EQ(abort_code_of(ask(Frame{0x10})), co::abort::toggle);
  EXPECT_EQ(abort_code_of(ask(Frame{0x00})), co::abort::command) << "the transfer is over";
  EXPECT_EQ(arm.device->status().state, 0);
  ask(sdo_frame(0x40, co::status, 0));
  EXPECT_EQ(abort_code_of(ask(Frame{0x70})), co::abort::toggle);

  // Lengths.
  EXPECT_EQ(abort_code_of(ask(sdo_frame(0x21, co::image, 1, staging_bytes + 1))), co::abort::too_long);
  EXPECT_EQ(abort_code_of(ask(sdo_frame(0x21, co::image, 1, 0))), co::abort::too_short);
  ask(sdo_frame(0x21, co::image, 1, 5));
  EXPECT_EQ(abort_code_of(ask(Frame{0x00})), co::abort::too_long);
  ask(sdo_frame(0x21, co::image, 1, 50));
  EXPECT_EQ(abort_code_of(ask(Frame{0x01})), co::abort::too_short);
  EXPECT_EQ(download(co::image, 1, Bytes(staging_bytes + 1), false), co::abort::too_long);
  EXPECT_EQ(arm.device->status().state, 0) << "nothing is left behind";
  EXPECT_EQ(abort_code_of(ask(sdo_frame(0x21, co::probe, 1, 215))), co::abort::too_short);
  EXPECT_EQ(abort_code_of(ask(sdo_frame(0x21, co::probe, 1, 217))), co::abort::too_long);
  EXPECT_EQ(download(co::probe, 1, Bytes(215), false), co::abort::too_short);
  EXPECT_EQ(download(co::probe, 1, Bytes(600), false), co::abort::too_long);

  // Timeout.
  ask(sdo_frame(0x21, co::image, 1, 100));
  poll(1);
  sent.clear();
  poll(2000);
  ASSERT_FALSE(sent.empty());
  EXPECT_EQ(sent.back().id, 0x585);
  EXPECT_EQ(load_u32(sent.back().bytes.data() + 4), co::abort::timeout);
  EXPECT_EQ(arm.device->status().state, 0);
}

TEST_F(Canopen, RefusalsOfASet) {
  const auto refused = [this](const Bytes& image) {
    EXPECT_EQ(download(co::image, 1, image), 0U);
    EXPECT_EQ(command(Command::verify), 0U) << "it takes a while";
    EXPECT_EQ(number(co::status_summary, 1), static_cast<std::uint32_t>(wire::StoreState::working));
    arm.until_done();
    return co::abort_code(static_cast<Answer>(number(co::status_summary, 2)),
                          static_cast<Refusal>(number(co::status_summary, 3)));
  };
  const Bytes good = make_image(arm.robot, 1);
  Bytes bad = good;
  bad[300] ^= 4U;
  EXPECT_EQ(refused(bad), co::abort::not_stored);
  Robot other = arm.robot;
  other.name_hash = name_hash("other", 5);
  EXPECT_EQ(refused(make_image(other, 1)), co::abort::incompatible);
  EXPECT_EQ(number(co::status_summary, 3), static_cast<std::uint32_t>(Refusal::wrong_robot));
  other = arm.robot;
  other.links[3].d_m += 1e-9;
  EXPECT_EQ(refused(make_image(other, 1)), co::abort::incompatible);
  bad = good;
  bad[4] = 9;
  reseal(bad);
  EXPECT_EQ(refused(bad), co::abort::incompatible) << "schema";
  EXPECT_EQ(refused(Bytes(good.begin(), good.end() - 4)), co::abort::too_short);
  bad = good;
  bad.insert(bad.end(), 4, 0);
  EXPECT_EQ(refused(bad), co::abort::too_long);
  EXPECT_EQ(refused(make_image(arm.robot, 1, 1000)), co::abort::value_too_high) << "implausible";
  EXPECT_EQ(refused(make_image(arm.robot, 0)), co::abort::value_too_low) << "sequence";
  EXPECT_EQ(arm.stage(good, 2), Answer::accepted);
  EXPECT_EQ(abort_code_of(ask(sdo_frame(0x21, co::image, 1, 100))), co::abort::busy);
  EXPECT_EQ(command(Command::commit), co::abort::busy);
  arm.run(Command::abort, 0, 2);
  EXPECT_EQ(refused(good), 0U);
}

TEST_F(Canopen, PushPullAndProbe) {
  const Bytes image = make_image(arm.robot, 5);
  for (const bool sized : {true, false}) {
    ASSERT_EQ(download(co::image, 1, image, sized), 0U);
  }
  EXPECT_EQ(expedited(0x1010, 1, co::save_signature, 4), 0U);
  for (int k = 0; k < 100; ++k) poll(1);
  EXPECT_EQ(status().active_sequence, 5U);
  EXPECT_EQ(upload(co::image, 2), image);
  EXPECT_EQ(upload(0x1001, 0), Bytes{0});

  Joints q = {real(0.1), real(-0.2), real(0.3), real(0.4), real(0.5), real(-0.6)};
  wire::ProbeRequest request;
  for (std::size_t j = 0; j < joints; ++j) request.q_rad[j] = to_binary64_bits(q[j]);
  request = arm.device->with_default_context(request);
  Bytes record(wire::probe_request_bytes);
  wire::encode(request, wire::ByteOrder::little, record.data());
  ASSERT_EQ(download(co::probe, 1, record), 0U);
  EXPECT_EQ(upload(co::probe, 1), record);
  EXPECT_EQ(number(co::probe, 0), 3U);
  wire::ProbeResponse answer;
  wire::decode(upload(co::probe, 2).data(), wire::ByteOrder::little, answer);
  const auto expected = by_the_core(arm.robot, image, q, default_context<Scalar>(arm.robot));
  for (std::size_t j = 0; j < joints; ++j) EXPECT_EQ(answer.q_rad[j], to_binary64_bits(expected.q[j]));

  // The flags are those of the response that was read last.
  EXPECT_EQ(number(co::probe, 3), 0U) << "nothing holds it back";
  request.q_rad[4] = to_binary64_bits(Scalar(0));  // the wrist is straight
  wire::encode(request, wire::ByteOrder::little, record.data());
  ASSERT_EQ(download(co::probe, 1, record), 0U);
  EXPECT_EQ(number(co::probe, 3), 0U) << "still of the one before";
  upload(co::probe, 2);
  EXPECT_EQ(upload(co::probe, 3), Bytes({step_flag::near_singular, 0}));
  EXPECT_EQ(expedited(co::probe, 3, 0, 2), co::abort::read_only);

  // A set that changes during an upload ends it.
  ask(sdo_frame(0x40, co::image, 2));
  EXPECT_EQ(abort_code_of(ask(Frame{0x60})), 0U);
  ASSERT_EQ(arm.push(make_image(arm.robot, 6, 1, 6)), Answer::accepted);
  EXPECT_EQ(abort_code_of(ask(Frame{0x70})), co::abort::device_state);

  unlock();
  EXPECT_EQ(command(Command::rollback), 0U);
  for (int k = 0; k < 100; ++k) poll(1);
  EXPECT_EQ(number(co::status_summary, 5), 5U);
  EXPECT_EQ(expedited(0x1011, 1, co::load_signature, 4), co::abort::local_control)
      << "one frame destroys nothing";
  unlock();
  EXPECT_EQ(expedited(0x1011, 1, co::load_signature, 4), 0U);
  for (int k = 0; k < 100; ++k) poll(1);
  EXPECT_EQ(number(co::status_summary, 5), 0U);
}

Bytes emcy(std::uint16_t code, std::uint8_t faults, Refusal refusal = Refusal::none) {
  Bytes out(8);
  store_u16(out.data(), code);
  out[2] = faults != 0 ? 1 : 0;
  out[3] = faults;
  store_u16(out.data() + 5, static_cast<std::uint16_t>(refusal));
  return out;
}

TEST_F(Canopen, EmergenciesForFaultsThatComeAndGo) {
  using namespace wire::fault;
  namespace ec = co::emergency_code;
  const auto told = [this](std::uint32_t ms = 1) {
    emergencies.clear();
    poll(ms);
    Bytes out;
    for (const Sent& s : emergencies) {
      EXPECT_EQ(s.id, 0x085);
      out.insert(out.end(), s.bytes.begin(), s.bytes.end());
    }
    EXPECT_LE(emergencies.size(), 1U);
    return out;
  };
  ASSERT_EQ(emergencies.size(), 1U) << "after the boot-up message";
  EXPECT_EQ(emergencies[0].bytes, emcy(ec::no_valid_set, no_valid_set));
  EXPECT_EQ(number(0x1003, 0), 1U);
  EXPECT_EQ(number(0x1003, 1), 0x00016301U);
  EXPECT_EQ(told(1000), Bytes()) << "once";

  // The fault goes with the first set; the history keeps it until it is emptied.
  download(co::image, 1, make_image(arm.robot, 5));
  expedited(0x1010, 1, co::save_signature, 4);
  Bytes all;
  for (int k = 0; k < 100; ++k) {
    const Bytes now = told();
    all.insert(all.end(), now.begin(), now.end());
  }
  EXPECT_EQ(all, emcy(ec::none, 0));
  EXPECT_EQ(upload(0x1001, 0), Bytes{0});
  EXPECT_EQ(number(0x1003, 0), 1U);
  EXPECT_EQ(expedited(0x1003, 0, 1, 1), co::abort::value);
  EXPECT_EQ(expedited(0x1003, 1, 0, 4), co::abort::read_only);
  EXPECT_EQ(expedited(0x1003, 0, 0, 1), 0U);
  EXPECT_EQ(number(0x1003, 0), 0U);
  EXPECT_EQ(abort_code_of(ask(sdo_frame(0x40, 0x1003, 1))), co::abort::no_data);
  EXPECT_EQ(abort_code_of(ask(sdo_frame(0x40, 0x1003, 9))), co::abort::no_sub_index);

  // A trial that nobody confirms: the fault is there while EMCY is off, then it is told; stopped nodes say nothing.
  EXPECT_EQ(expedited(0x1014, 0, 0x80000085U, 4), 0U);
  download(co::image, 1, make_image(arm.robot, 6));
  command(Command::commit_trial, 1);
  for (int k = 0; k < 200; ++k) EXPECT_EQ(told(), Bytes());
  EXPECT_EQ(upload(0x1001, 0), Bytes{1});
  EXPECT_EQ(number(0x1003, 1), static_cast<std::uint32_t>(ec::trial_reverted | trial_reverted << 16));
  const std::uint8_t stop[2] = {2, 0};
  const std::uint8_t start[2] = {1, 0};
  EXPECT_EQ(expedited(0x1014, 0, 0x85, 4), 0U);
  node.receive(0, stop, 2);
  EXPECT_EQ(told(1000), Bytes());
  node.receive(0, start, 2);
  full = true;
  EXPECT_EQ(told(1000), Bytes()) << "no room";
  full = false;
  EXPECT_EQ(told(), emcy(ec::trial_reverted, trial_reverted));
  EXPECT_EQ(told(1000), Bytes());
  // After a reset what is there is told again, and is no new entry of the history.
  const std::uint8_t reset[2] = {129, node_id};
  node.receive(0, reset, 2);
  EXPECT_EQ(told(), emcy(ec::trial_reverted, trial_reverted));
  EXPECT_EQ(number(0x1003, 0), 1U);
}

TEST_F(Canopen, EmergencyIdentifierAndInhibitTime) {
  EXPECT_EQ(number(0x1014, 0), 0x85U);
  EXPECT_EQ(number(0x1015, 0), 1000U);
  EXPECT_EQ(expedited(0x1014, 0, 0x86, 4), co::abort::value) << "while there is one";
  EXPECT_EQ(expedited(0x1014, 0, 0x80000086U, 4), co::abort::value);
  EXPECT_EQ(expedited(0x1014, 0, 0x80000085U, 4), 0U);
  EXPECT_EQ(expedited(0x1014, 0, 0xA0000085U, 4), co::abort::value) << "29 bits";
  EXPECT_EQ(expedited(0x1014, 0, 0xC0000085U, 4), co::abort::value) << "reserved";
  for (const std::uint32_t id :
       {0x000U, 0x07FU, 0x101U, 0x180U, 0x581U, 0x5FFU, 0x601U, 0x67FU, 0x6E0U, 0x6FFU, 0x701U, 0x7FFU}) {
    EXPECT_EQ(expedited(0x1014, 0, id, 4), co::abort::value) << id;
  }
  EXPECT_EQ(expedited(0x1014, 0, 0x123456, 4), co::abort::value);
  EXPECT_EQ(expedited(0x1014, 0, 0x0FE, 4), 0U);
  EXPECT_EQ(number(0x1014, 0), 0x0FEU);
  const std::uint8_t reset[2] = {130, node_id};
  node.receive(0, reset, 2);
  poll(1);
  EXPECT_EQ(number(0x1014, 0), 0x85U) << "back to its value at power-on";

  // Faults that flap are told with the inhibit time between: once raised, once gone, and what is there in between.
  EXPECT_EQ(expedited(0x1015, 0, 500, 2), 0U);
  const Bytes image = make_image(arm.robot, 5);
  emergencies.clear();
  std::uint32_t start_ms = arm.now_ms;
  for (std::uint32_t k = 0; k < 40; ++k) {
    arm.push(make_image(arm.robot, 5 + k));
    node.poll(arm.now_ms);
    arm.run(Command::restore_defaults, 0, 1);
    arm.until_done();
    node.poll(arm.now_ms);
  }
  EXPECT_LE(emergencies.size(), 2 + (arm.now_ms - start_ms) / 50);
  EXPECT_EQ(number(0x1003, 0), 1U) << "one entry";
  // Without it each change is told.
  EXPECT_EQ(expedited(0x1015, 0, 0, 2), 0U);
  poll(1000);
  poll(1000);
  emergencies.clear();
  for (std::uint32_t k = 0; k < 4; ++k) {
    arm.push(make_image(arm.robot, 5 + k));
    node.poll(arm.now_ms);
    arm.run(Command::restore_defaults, 0, 1);
    arm.until_done();
    node.poll(arm.now_ms);
  }
  EXPECT_EQ(emergencies.size(), 8U);
}

/// 8 bytes that may fail.
struct CanBytes {
  std::optional<Bytes> bytes;
  bool fails = false;
  CanMemory memory() {
    return {this,
            [](void* self, std::uint8_t* to) {
              const auto& m = *static_cast<CanBytes*>(self);
              if (m.bytes) std::copy(m.bytes->begin(), m.bytes->end(), to);
              return m.bytes ? 1 : 0;
            },
            [](void* self, const std::uint8_t* from) {
              auto& m = *static_cast<CanBytes*>(self);
              if (m.fails) return 0;
              m.bytes = Bytes(from, from + 8);
              return 1;
            }};
  }
};

TEST_F(Canopen, CommunicationParametersAreStoredWhereThereIsMemory) {
  const auto reset = [this](std::uint8_t how) {
    const std::uint8_t nmt[2] = {how, node_id};
    node.receive(0, nmt, 2);
    poll(1);
  };
  EXPECT_EQ(number(0x1010, 0), 2U);
  EXPECT_EQ(number(0x1011, 0), 2U);
  EXPECT_EQ(number(0x1010, 2), 0U) << "no memory";
  EXPECT_EQ(number(0x1011, 2), 0U);
  EXPECT_EQ(expedited(0x1010, 2, co::save_signature, 4), co::abort::access);
  EXPECT_EQ(expedited(0x1011, 2, co::load_signature, 4), co::abort::access);
  EXPECT_EQ(expedited(0x1010, 2, 1, 4), co::abort::not_stored);

  CanBytes kept;
  node.set_memory(kept.memory());
  EXPECT_EQ(number(0x1017, 0), 100U) << "an empty memory";
  EXPECT_EQ(number(0x1010, 2), 1U);
  EXPECT_EQ(number(0x1011, 2), 1U);
  EXPECT_EQ(expedited(0x1010, 2, co::load_signature, 4), co::abort::not_stored);
  expedited(0x1017, 0, 250, 2);
  expedited(0x1015, 0, 300, 2);
  reset(130);
  EXPECT_EQ(number(0x1017, 0), 100U) << "not saved";
  expedited(0x1017, 0, 250, 2);
  expedited(0x1015, 0, 300, 2);
  kept.fails = true;
  EXPECT_EQ(expedited(0x1010, 2, co::save_signature, 4), co::abort::hardware);
  EXPECT_FALSE(kept.bytes);
  kept.fails = false;
  EXPECT_EQ(expedited(0x1010, 2, co::save_signature, 4), 0U);
  EXPECT_EQ(arm.sequence(), 0U) << "no set is committed by it";
  expedited(0x1017, 0, 400, 2);
  for (const std::uint8_t how : {std::uint8_t{129}, std::uint8_t{130}}) {
    reset(how);
    EXPECT_EQ(number(0x1017, 0), 250U);
    EXPECT_EQ(number(0x1015, 0), 300U);
  }
  // Another node that starts with this memory; a damaged record is none.
  const Bytes good = *kept.bytes;
  const auto started = [&] {
    std::vector<Sent> answers;
    CanopenNode other(*arm.device, 2, {node_id, 100, 2000},
                      {&answers, [](void* self, std::uint16_t id, const std::uint8_t* b, std::uint8_t n) {
                         static_cast<std::vector<Sent>*>(self)->push_back({id, Bytes(b, b + n)});
                         return true;
                       }});
    other.set_memory(kept.memory());
    other.poll(0);
    const Frame f = sdo_frame(0x40, 0x1017, 0);
    other.receive(co::sdo_request_id + node_id, f.data(), 8);
    return answers.empty() ? 0 : load_u16(answers.back().bytes.data() + 4);
  };
  EXPECT_EQ(started(), 250);
  for (unsigned bit = 0; bit < 64; ++bit) {
    kept.bytes = good;
    (*kept.bytes)[bit / 8] = static_cast<std::uint8_t>((*kept.bytes)[bit / 8] ^ (1U << bit % 8));
    EXPECT_EQ(started(), 100) << bit;
  }
  for (const std::uint8_t blank : {std::uint8_t{0}, std::uint8_t{0xFF}}) {
    kept.bytes = Bytes(8, blank);
    EXPECT_EQ(started(), 100);
  }
  kept.bytes = good;
  EXPECT_EQ(expedited(0x1011, 2, co::load_signature, 4), 0U);
  EXPECT_EQ(number(0x1017, 0), 250U) << "from the next reset on";
  reset(129);
  EXPECT_EQ(number(0x1017, 0), 100U);
  EXPECT_EQ(number(0x1015, 0), 1000U);
}

TEST_F(Canopen, TheErrorHistoryKeepsTheNewest) {
  // Two faults by turns: a trial that reverts, and no set at all.
  EXPECT_EQ(expedited(0x1003, 0, 0, 1), 0U);
  for (std::uint32_t k = 0; k < 6; ++k) {
    ASSERT_EQ(arm.push(make_image(arm.robot, 1 + 2 * k)), Answer::accepted) << k;
    node.poll(arm.now_ms);
    ASSERT_EQ(arm.stage(make_image(arm.robot, 2 + 2 * k), 1), Answer::accepted);
    arm.run(Command::commit_trial, 1, 1);
    for (int n = 0; n < 200; ++n) poll(1);
    arm.run(Command::restore_defaults, 0, 1);
    arm.until_done();
    poll(1);
  }
  EXPECT_EQ(number(0x1003, 0), 8U);
  const std::uint32_t newest = number(0x1003, 1);
  EXPECT_EQ(newest & 0xFFFFU, co::emergency_code::no_valid_set);
  EXPECT_EQ(number(0x1003, 2) & 0xFFFFU, co::emergency_code::trial_reverted);
  EXPECT_EQ(number(0x1003, 7), newest);
}

TEST_F(Canopen, AnAbortedDownloadLeavesNothingBehind) {
  ask(sdo_frame(0x21, co::image, 1, 100));
  ask(Frame{0x00});
  ask(sdo_frame(0x80, co::image, 1, co::abort::general));
  EXPECT_EQ(arm.device->status().state, 0);
  ask(sdo_frame(0x21, co::image, 1, 100));
  ask(sdo_frame(0x40, co::status, 0));  // a new transfer ends the old one
  EXPECT_EQ(arm.device->status().state, 0);
  ask(sdo_frame(0x21, co::image, 1, 100));
  const std::uint8_t stop[2] = {2, 0};
  node.receive(0, stop, 2);
  EXPECT_EQ(arm.device->status().state, 0);
  // A finished one stays for verify, whatever is read meanwhile.
  const std::uint8_t start[2] = {1, 0};
  node.receive(0, start, 2);
  download(co::image, 1, make_image(arm.robot, 1));
  upload(co::status, 0);
  EXPECT_EQ(command(Command::verify), 0U);
}

TEST_F(Canopen, APollOfASmallObjectLeavesTheTransferAlone) {
  const Bytes image = make_image(arm.robot, 5);
  const auto poll_error_register = [this] {
    EXPECT_EQ(abort_code_of(ask(sdo_frame(0x40, 0x1001, 0))), 0U);
    EXPECT_EQ(abort_code_of(ask(sdo_frame(0x40, co::status_summary, 5))), 0U);
  };
  // Between all segments of a download.
  EXPECT_EQ(ask(sdo_frame(0x21, co::image, 1, static_cast<std::uint32_t>(image.size()))),
            sdo_frame(0x60, co::image, 1));
  unsigned toggle = 0;
  for (std::size_t at = 0; at < image.size(); at += 7) {
    EXPECT_EQ(ask(sdo_frame(0x40, 0x1001, 0)), sdo_frame(0x4F, 0x1001, 0, 1)) << "no set yet";
    const std::size_t n = std::min<std::size_t>(7, image.size() - at);
    Frame f{};
    f[0] = static_cast<std::uint8_t>(toggle | ((7 - n) << 1U) | (at + n == image.size() ? 1U : 0U));
    std::copy_n(image.begin() + static_cast<std::ptrdiff_t>(at), n, f.begin() + 1);
    ASSERT_EQ(ask(f), (Frame{static_cast<std::uint8_t>(0x20U | toggle)})) << at;
    toggle ^= 0x10U;
  }
  EXPECT_EQ(expedited(0x1010, 1, co::save_signature, 4), 0U);
  for (int k = 0; k < 100; ++k) poll(1);
  ASSERT_EQ(status().active_sequence, 5U);
  // Between those of an upload, of the image and of a record, which lies in the node's own memory.
  for (const std::uint16_t index : {co::image, co::robot}) {
    const std::uint8_t sub = index == co::image ? 2 : 0;
    const Bytes expected = upload(index, sub);
    const auto r = ask(sdo_frame(0x40, index, sub));
    ASSERT_EQ(abort_code_of(r), 0U);
    Bytes got;
    for (unsigned t = 0; got.size() < expected.size(); t ^= 0x10U) {
      poll_error_register();
      const auto s = ask(Frame{static_cast<std::uint8_t>(0x60U | t)});
      ASSERT_EQ(abort_code_of(s), 0U);
      got.insert(got.end(), s->begin() + 1, s->begin() + 8 - (((*s)[0] >> 1U) & 7U));
    }
    EXPECT_EQ(got, expected);
  }
  // A larger object, or a command, ends the transfer as before; polls do not keep alive what its client has left.
  ask(sdo_frame(0x21, co::image, 1, 100));
  ask(sdo_frame(0x40, 0x1008, 0));
  EXPECT_EQ(arm.device->status().state, 0);
  ask(sdo_frame(0x21, co::image, 1, 100));
  for (int k = 0; k < 25; ++k) {
    poll(100);
    poll_error_register();
  }
  EXPECT_EQ(arm.device->status().state, 0);
}

TEST_F(Canopen, ARepeatedSegmentIsAnsweredAgain) {
  const Bytes image = make_image(arm.robot, 5);
  ask(sdo_frame(0x21, co::image, 1, static_cast<std::uint32_t>(image.size())));
  unsigned toggle = 0;
  for (std::size_t at = 0; at < image.size(); at += 7) {
    const std::size_t n = std::min<std::size_t>(7, image.size() - at);
    Frame f{};
    f[0] = static_cast<std::uint8_t>(toggle | ((7 - n) << 1U) | (at + n == image.size() ? 1U : 0U));
    std::copy_n(image.begin() + static_cast<std::ptrdiff_t>(at), n, f.begin() + 1);
    for (int times = 0; times < 3; ++times) {
      ASSERT_EQ(ask(f), (Frame{static_cast<std::uint8_t>(0x20U | toggle)})) << at;
    }
    toggle ^= 0x10U;
  }
  EXPECT_EQ(expedited(0x1010, 1, co::save_signature, 4), 0U);
  for (int k = 0; k < 100; ++k) poll(1);
  Bytes got;
  ask(sdo_frame(0x40, co::image, 2));
  for (unsigned t = 0; got.size() < image.size(); t ^= 0x10U) {
    const Frame request{static_cast<std::uint8_t>(0x60U | t)};
    const auto s = ask(request);
    ASSERT_EQ(abort_code_of(s), 0U);
    EXPECT_EQ(ask(request), s);
    EXPECT_EQ(ask(request), s);
    got.insert(got.end(), s->begin() + 1, s->begin() + 8 - (((*s)[0] >> 1U) & 7U));
  }
  EXPECT_EQ(got, image);
  // Another segment with this toggle bit is none of these.
  ask(sdo_frame(0x21, co::image, 1, 100));
  EXPECT_EQ(abort_code_of(ask(Frame{0x00, 1})), 0U);
  EXPECT_EQ(abort_code_of(ask(Frame{0x00, 2})), co::abort::toggle);
  EXPECT_EQ(abort_code_of(ask(Frame{0x00, 1})), co::abort::command) << "the transfer is over";
  // Nor is one that comes long after.
  upload(co::status, 0);
  poll(1);
  poll(2000);
  EXPECT_EQ(abort_code_of(ask(Frame{0x60})), co::abort::command);
  EXPECT_EQ(abort_code_of(ask(Frame{0x70})), co::abort::command);
}

TEST_F(Canopen, TellsTheCertificateOfTheActiveSet) {
  ASSERT_EQ(arm.push(make_image(arm.robot, 4)), wire::Answer::accepted);
  const Bytes bytes = upload(co::certificate, 0);
  ASSERT_EQ(bytes.size(), wire::certificate_bytes);
  wire::CertificateRecord record;
  wire::decode(bytes.data(), wire::ByteOrder::little, record);
  EXPECT_EQ(record.sequence, 4U);
  EXPECT_EQ(record.position_m, arm.device->certificate().position_m);
  const Bytes cost = upload(co::certificate_summary, 1);
  EXPECT_EQ(load_u32(cost.data()), record.instructions);
  const Bytes shift = upload(co::certificate_summary, 2);
  float mm = 0;
  std::memcpy(&mm, shift.data(), sizeof mm);
  EXPECT_NEAR(mm, 1e3 * double_of(record.position_m), 1e-4);
  const Bytes last = upload(co::certificate_summary, 9);
  float deg = 0;
  std::memcpy(&deg, last.data(), sizeof deg);
  EXPECT_NEAR(deg, double_of(record.deflection_rad[5]) / degree, 1e-6);
}

TEST_F(Canopen, AnswersThatFoundNoRoomComeLater) {
  full = true;
  EXPECT_FALSE(ask(sdo_frame(0x40, 0x1000, 0)));
  full = false;
  sent.clear();
  poll(1);
  ASSERT_EQ(sent.size(), 1U);
  EXPECT_EQ(sent[0].id, 0x585);
}

TEST_F(Canopen, SurvivesMillionsOfBytes) {
  std::mt19937 engine(11);
  const auto random = [&engine] { return static_cast<std::uint32_t>(engine()); };
  const std::uint16_t objects[] = {0x1000, 0x1001, 0x1008, 0x1010, 0x1011, 0x1017, 0x1018,
                                   0x1200, 0x2000, 0x2001, 0x2002, 0x2003, 0x2004, 0x2005,
                                   0x2010, 0x2011, 0x2020, 0x2021, 0x2FFF};
  for (int k = 0; k < 400000; ++k) {
    Frame f;
    for (auto& b : f) b = static_cast<std::uint8_t>(random());
    if (random() % 2 != 0) {
      store_u16(f.data() + 1, objects[random() % 19]);
      f[3] = static_cast<std::uint8_t>(random() % 9);
      f[6] = 0;
      f[7] = 0;
      if (random() % 2 != 0) f[5] = 0;
    } else if (random() % 2 != 0) {
      f[0] = static_cast<std::uint8_t>(f[0] & 0x7EU);
    }
    sent.clear();
    full = random() % 64 == 0;
    const unsigned what = random() % 64;
    if (what == 0) {
      const std::uint8_t nmt[2] = {static_cast<std::uint8_t>(random() % 3 + (random() % 2 != 0 ? 128U : 0U)),
                                   0};
      node.receive(0, nmt, 2);
      const std::uint8_t start[2] = {1, 0};
      poll(1);
      node.receive(0, start, 2);
    } else if (what == 1) {
      node.receive(static_cast<std::uint16_t>(random() & 0x7FFU), f.data(), random() % 9);
    } else {
      node.receive(co::sdo_request_id + node_id, f.data(), 8);
    }
    ASSERT_LE(sent.size(), 3U + CanopenNode::segments_per_call);
    ASSERT_LE(emergencies.size(), 1U);
    emergencies.clear();
    if (k % 16 == 0) poll(random() % 50);
  }
  EXPECT_FALSE(arm.flash.double_writes);
}

}  // namespace
}  // namespace flexcomp::firmware::bench
