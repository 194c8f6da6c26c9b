// SPDX-License-Identifier: Apache-2.0
// The Modbus client against a server made with libmodbus, over TCP and over a pseudo-terminal, which can be told to
// misbehave.
#include <gmock/gmock.h>

#include <chrono>
#include <thread>

#include "bus/controller_client.hpp"
#include "bus/transfer.hpp"
#include "host/bus/bus_fake_modbus.hpp"
#include "support/thrown.hpp"

namespace flexcomp::host {
namespace {

using fake::ModbusServer;
using fake::numbered_image;
using fake::quick;
using std::chrono::milliseconds;
using std::chrono::steady_clock;
using support::thrown;
using testing::HasSubstr;

class ModbusClient : public testing::TestWithParam<bool> {
 protected:
  ModbusServer server{GetParam()};
};
INSTANTIATE_TEST_SUITE_P(Lines, ModbusClient, testing::Values(false, true),
                         [](const auto& line) { return line.param ? "Rtu" : "Tcp"; });

TEST_P(ModbusClient, PushesAndReadsBack) {
  server.device.working_polls = 3;
  const auto client = server.client();
  EXPECT_EQ(client->capability().values, 768U);
  // Whole windows, an odd length, less than a window.
  std::uint32_t sequence = 0;
  for (const std::size_t size : {484U, 1001U, 100U, 2000U, 246U}) {
    const Bytes image = numbered_image(size, ++sequence);
    push_image(*client, image);
    EXPECT_EQ(server.device.active, image) << size;
  }
  EXPECT_EQ(next_sequence(*client), 6U);
}

TEST_P(ModbusClient, SaysWhyASetWasRefused) {
  server.device.verify_refuses = Refusal::wrong_nominal;
  const auto client = server.client();
  const RefusedByController e =
      thrown<RefusedByController>([&] { push_image(*client, numbered_image(100)); });
  EXPECT_EQ(e.answer(), wire::Answer::refused);
  EXPECT_EQ(e.refusal(), Refusal::wrong_nominal);
  EXPECT_EQ(std::string(e.what()), client->where() +
                                       ": asked to verify the set, the controller refused: the image is "
                                       "for another nominal geometry (Modbus "
                                       "exception 04, server device failure)");
  EXPECT_TRUE(server.device.active.empty());
  EXPECT_TRUE(server.device.staged.empty());
  EXPECT_THAT(thrown<RefusedByController>([&] { roll_back(*client); }).what(),
              HasSubstr("asked to roll back, the controller refused: there is no previous set"));
}

TEST_P(ModbusClient, SaysWhatFailedInTheBackground) {
  server.device.commit_ends = wire::Answer::storage_failed;
  server.device.working_polls = 2;
  const auto client = server.client();
  EXPECT_THAT(thrown<RefusedByController>([&] { push_image(*client, numbered_image(100)); }).what(),
              HasSubstr("asked to commit the set, the controller failed: the controller's non-volatile"));
}

TEST_P(ModbusClient, JudgesACommitByWhatItDid) {
  server.device.overtaken = true;
  const auto client = server.client();
  push_image(*client, numbered_image(100));
  EXPECT_EQ(server.device.active.size(), 100U);
  server.device.commit_ends = wire::Answer::wrong_state;
  EXPECT_THROW(push_image(*client, numbered_image(100, 2)), RefusedByController);
}

TEST_P(ModbusClient, ACommitWhoseAnswerIsLostIsJudgedByTheStatus) {
  server.loses_commits = true;
  const auto client = server.client();
  EXPECT_EQ(push_image(*client, numbered_image(100, 4)).active_sequence, 4U);
  server.device.commit_ends = wire::Answer::storage_failed;
  EXPECT_THAT(thrown<RefusedByController>([&] { push_image(*client, numbered_image(100, 5)); }).what(),
              HasSubstr("non-volatile memory failed"));
  EXPECT_EQ(server.device.status.active_sequence, 4U);
}

TEST_P(ModbusClient, AControllerThatGoesAwayAfterTheCommitLeavesItOpen) {
  server.loses_commits = true;
  const auto client = server.client();
  // The last window has gone out: announce and verify are answered, the commit and all after it are not.
  server.device.on_commit = [this] { server.silent = true; };
  const OutcomeOpen e = thrown<OutcomeOpen>([&] { push_image(*client, numbered_image(100, 4)); });
  EXPECT_THAT(e.what(), HasSubstr(": open: the controller was asked to commit the set, then: "));
  server.silent = false;
  server.loses_commits = false;
  EXPECT_TRUE(read_back(*client, numbered_image(100, 4)).has_value());
  EXPECT_FALSE(read_back(*client, numbered_image(100, 5)).has_value());
}

TEST_P(ModbusClient, FindsADamagedSet) {
  server.device.damages_image = true;
  const auto client = server.client();
  EXPECT_THAT(thrown<OutcomeOpen>([&] { push_image(*client, numbered_image(100)); }).what(),
              HasSubstr("byte 50 of the active set is 0x3B, 0x3A was sent"));
}

TEST_P(ModbusClient, ProbesWithAllBitsAndTellsTheRobot) {
  const auto client = server.client();
  fake::expect_exact_probe(*client);
  EXPECT_EQ(robot_of(*client, "").nominal.links[1].a_m, 0.4);
  server.device.tells_robot = false;
  EXPECT_FALSE(client->robot().has_value());
}

TEST_P(ModbusClient, ReadsTheFlagsOfAProbeWhereTheControllerTellsThem) {
  server.device.capability.flags |= wire::capability_flag::probe_flags;
  fake::expect_exact_probe(*server.client(), true);
}

TEST_P(ModbusClient, WaitsForABusyControllerButNotForEver) {
  server.device.busy = 3;
  const auto client = server.client();
  push_image(*client, numbered_image(50));
  server.device.busy = 1000000;
  const RefusedByController e = thrown<RefusedByController>([&] { client->run(wire::Command::verify); });
  EXPECT_EQ(e.answer(), wire::Answer::busy);
  EXPECT_THAT(e.what(), HasSubstr("busy for 0.6 s (Modbus exception 06, server device busy)"));
}

TEST_P(ModbusClient, WaitsLongerForTheStagingAreaThanForAnAnswer) {
  server.device.busy = 10;
  ClientOptions options = quick();
  options.response_timeout = milliseconds(100);
  const auto client = connect(server.address(), options);
  push_image(*client, numbered_image(50));
  EXPECT_EQ(server.device.active.size(), 50U);
}

TEST_P(ModbusClient, TellsWhichUnitItIsAndWhomItTrusts) {
  EXPECT_FALSE(server.client()->unit().has_value());
  const SigningKey key = SigningKey::generate();
  server.device.belongs_to("S/N ä-1", {key.public_key()});
  server.device.unit.counter = 0x1122334455667788;
  const auto client = server.client();
  const ControllerUnit unit = *client->unit();
  EXPECT_EQ(unit.serial, "S/N ä-1");
  EXPECT_EQ(unit.hash, server.device.unit.unit_hash);
  EXPECT_EQ(unit.counter, 0x1122334455667788U);
  EXPECT_EQ(unit.keys, 1U);
  EXPECT_EQ(unit.key_ids, std::vector{key.id()});
  EXPECT_EQ(client->robot()->serial, "S/N ä-1");
  EXPECT_EQ(client->robot()->nominal.unit_hash, unit.hash);
  // More keys than the record lists, and a serial number that is too long for it.
  server.device.unit.keys = 9;
  server.device.unit.serial_size = 0;
  EXPECT_EQ(client->unit()->key_ids.size(), 4U);
  EXPECT_EQ(client->unit()->serial, "");
  EXPECT_EQ(client->robot()->nominal.unit_hash, unit.hash);
  // A serial number that is not its own, or that would write to the terminal.
  server.device.unit.serial_size = 7;
  EXPECT_THAT(thrown<BusError>([&] { client->unit(); }).what(), HasSubstr("does not have the hash"));
  server.device.belongs_to("\x1b[31mred");
  EXPECT_THAT(thrown<BusError>([&] { client->robot(); }).what(), testing::Not(HasSubstr("\x1b")));
}

TEST_P(ModbusClient, UnlocksWhatDestroysSets) {
  server.device.belongs_to("A-1");
  const auto fill = [this] {
    server.device.previous = numbered_image(40, 6);
    server.device.activate(numbered_image(50, 7));
  };
  fill();
  const auto client = server.client();
  const RefusedByController e = thrown<RefusedByController>([&] { roll_back(*client); });
  EXPECT_EQ(e.answer(), wire::Answer::not_authorised);
  EXPECT_THAT(e.what(), HasSubstr("not authorised at the controller: an unlock has to come before"));
  EXPECT_THROW(erase(*client), RefusedByController);
  EXPECT_EQ(server.device.status.active_sequence, 7U);
  unlock(*client);
  EXPECT_EQ(roll_back(*client).active_sequence, 6U);
  // One unlock, one command.
  fill();
  EXPECT_THROW(erase(*client), RefusedByController);
  // Another client's answer stands where the number was, twice; then for good.
  server.device.numbers_overtaken = 2;
  unlock(*client);
  const wire::Status now = erase(*client);
  EXPECT_EQ(now.active_slot, wire::no_slot);
  EXPECT_TRUE(server.device.active.empty() && server.device.previous.empty());
  server.device.numbers_overtaken = 3;
  EXPECT_THROW(unlock(*client), RefusedByController);
  // Nothing there: only the answer says that it was done.
  EXPECT_THROW(erase(*client), RefusedByController);
  unlock(*client);
  EXPECT_NO_THROW(erase(*client));
}

TEST_P(ModbusClient, RefusesAnotherUnit) {
  const std::optional<ControllerUnit> none;
  const auto client = server.client();
  const std::string serial = "A-1";
  const Sha256Digest unit = name_hash(serial.data(), serial.size());
  EXPECT_NO_THROW(refuse_other_unit(*client, none, "c.yaml", {}, ""));
  EXPECT_THAT(thrown<BusError>([&] { refuse_other_unit(*client, none, "c.yaml", unit, serial); }).what(),
              testing::AllOf(HasSubstr("unit 'A-1'"), HasSubstr("cannot check"), HasSubstr("update it")));
  ControllerUnit there;
  there.serial = "B-2";
  there.hash = name_hash("B-2", 3);
  EXPECT_THAT(thrown<BusError>([&] { refuse_other_unit(*client, there, "c.yaml", unit, serial); }).what(),
              HasSubstr("c.yaml is for unit 'A-1', the controller belongs to unit 'B-2'; nothing was sent"));
  EXPECT_THAT(
      thrown<BusError>([&] { refuse_other_unit(*client, ControllerUnit(), "c.yaml", unit, ""); }).what(),
      testing::AllOf(HasSubstr("SHA-256 " + hex(unit).substr(0, 12)), HasSubstr("without a serial number")));
  there.hash = unit;
  EXPECT_NO_THROW(refuse_other_unit(*client, there, "c.yaml", unit, serial));
}

TEST_P(ModbusClient, SaysWhoIsNotLetIn) {
  const auto client = server.client();
  for (const auto& [refusal, words] : {std::pair{Refusal::wrong_unit, "for another unit"},
                                       {Refusal::not_signed, "only what is signed"},
                                       {Refusal::unknown_key, "does not trust"},
                                       {Refusal::wrong_signature, "the signature is wrong"},
                                       {Refusal::counter_used, "counter is not above"}}) {
    server.device.verify_refuses = refusal;
    const RefusedByController e =
        thrown<RefusedByController>([&] { push_image(*client, numbered_image(100)); });
    EXPECT_EQ(e.refusal(), refusal);
    EXPECT_THAT(e.what(), HasSubstr(words));
  }
}

TEST_P(ModbusClient, SaysWhoDidNotAnswerAndWhen) {
  server.silent = true;
  const auto start = steady_clock::now();
  const NoAnswer e = thrown<NoAnswer>([&] { server.client(); });
  EXPECT_THAT(e.what(), HasSubstr(server.address().text()));
  EXPECT_THAT(e.what(), HasSubstr("did not answer when asked to read 64 registers from 0x0000"));
  EXPECT_LT(steady_clock::now() - start, milliseconds(2000));
}

TEST(ModbusRtuClient, LosesAnAnswerAndAsksAgain) {
  ModbusServer server(true);
  server.lose = 2;
  const auto client = server.client();
  EXPECT_EQ(client->capability().terms, 64);
}

TEST(ModbusRtuClient, TakesTurnsOnOneLine) {
  ModbusServer server(true);
  auto first = server.client();
  EXPECT_THAT(thrown<BusError>([&] { server.client(); }).what(),
              HasSubstr("another program on this machine has been using"));
  first.reset();
  EXPECT_NO_THROW(server.client());
}

TEST(ModbusClientOpening, SaysWhatCannotBeOpened) {
  const auto complaint = [](const BusAddress& address) -> std::string {
    return thrown<BusError>([&] { connect(address, quick()); }).what();
  };
  EXPECT_EQ(complaint({ModbusRtuAddress{"/dev/no-such-line"}}),
            "modbus-rtu:/dev/no-such-line:19200:E:1: cannot be opened: No such file or directory");
  EXPECT_EQ(complaint({ModbusTcpAddress{"127.0.0.1", 9}}),
            "modbus-tcp:127.0.0.1:9:255: cannot be opened: Connection refused");
  EXPECT_THAT(complaint({ModbusTcpAddress{"no-such-host.invalid"}}),
              HasSubstr("the host 'no-such-host.invalid' cannot be found"));
  EXPECT_THAT(complaint({CanAddress{"nocan0"}}), HasSubstr("can:nocan0:1: "));
}

}  // namespace
}  // namespace flexcomp::host
