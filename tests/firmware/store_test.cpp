// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <string_view>

#include "firmware/bench.hpp"

namespace flexcomp::firmware::bench {
namespace {

using wire::Answer;
using wire::Command;
using wire::StoreState;

StoreState state(const Arm& arm) { return static_cast<StoreState>(arm.device->status().state); }

TEST(Store, TakesASetInAndGivesItBackByteForByte) {
  Arm arm;
  EXPECT_EQ(arm.device->status().faults, wire::fault::no_valid_set);
  const Bytes image = make_image(arm.robot, 1);
  EXPECT_EQ(arm.push(image), Answer::accepted);
  EXPECT_EQ(arm.sequence(), 1U);
  EXPECT_EQ(arm.pull(), image);
  EXPECT_EQ(arm.device->status().faults, 0);
  EXPECT_EQ(arm.device->status().settled, 1);
  EXPECT_FALSE(arm.flash.double_writes);
  Arm after(arm.flash);
  EXPECT_EQ(after.sequence(), 1U);
  EXPECT_EQ(after.pull(), image);
}

TEST(Store, AlternatesBetweenTheSlotsAndRollsBackOnce) {
  Arm arm;
  for (std::uint32_t n = 1; n <= 5; ++n)
    ASSERT_EQ(arm.push(make_image(arm.robot, n, 1, n)), Answer::accepted);
  EXPECT_EQ(arm.device->status().previous_sequence, 4U);
  EXPECT_EQ(arm.run(Command::rollback), Answer::accepted);
  EXPECT_EQ(static_cast<Answer>(arm.settle().answer), Answer::accepted);
  EXPECT_EQ(arm.sequence(), 4U);
  EXPECT_EQ(arm.pull(), make_image(arm.robot, 4, 1, 4));
  EXPECT_EQ(arm.run(Command::rollback), Answer::no_previous);
  Arm after(arm.flash);  // the set that was left behind does not come back
  EXPECT_EQ(after.sequence(), 4U);
  EXPECT_EQ(after.push(make_image(arm.robot, 5)), Answer::accepted);
}

TEST(Store, RefusesASequenceThatIsNotAboveTheActiveOne) {
  Arm arm;
  EXPECT_EQ(arm.offer(make_image(arm.robot, 0)), Refusal::stale_sequence);
  ASSERT_EQ(arm.push(make_image(arm.robot, 7)), Answer::accepted);
  EXPECT_EQ(arm.offer(make_image(arm.robot, 7)), Refusal::stale_sequence);
  EXPECT_EQ(arm.offer(make_image(arm.robot, 6)), Refusal::stale_sequence);
  EXPECT_EQ(arm.device->status().detail, 7U);
  EXPECT_EQ(arm.offer(make_image(arm.robot, 8)), Refusal::none);
}

// The last number of all must not end the pushes for good.
TEST(Store, SequencesFollowSerialNumberArithmetic) {
  Arm arm;
  ASSERT_EQ(arm.push(make_image(arm.robot, 0xFFFFFFFEU)), Answer::accepted);
  EXPECT_EQ(arm.offer(make_image(arm.robot, 0xFFFFFFFDU)), Refusal::stale_sequence);
  ASSERT_EQ(arm.push(make_image(arm.robot, 0xFFFFFFFFU)), Answer::accepted);
  EXPECT_EQ(arm.offer(make_image(arm.robot, 0)), Refusal::stale_sequence);
  ASSERT_EQ(arm.push(make_image(arm.robot, 1)), Answer::accepted);
  EXPECT_EQ(arm.offer(make_image(arm.robot, 0xFFFFFFFFU)), Refusal::stale_sequence);
  EXPECT_EQ(arm.offer(make_image(arm.robot, 1 + 0x10001U)), Refusal::sequence_too_far);
  EXPECT_EQ(arm.device->status().detail, 1U);
  EXPECT_EQ(Arm(arm.flash).sequence(), 1U);
  ASSERT_EQ(arm.push(make_image(arm.robot, 1 + 0x10000U)), Answer::accepted);
}

// Until then the other slot may hold the only set that can still be read.
TEST(Store, TheSetInUseIsReadBeforeTheOtherIsErased) {
  Arm arm;
  ASSERT_EQ(arm.push(make_image(arm.robot, 1)), Answer::accepted);
  ASSERT_EQ(arm.push(make_image(arm.robot, 2, 1, 2)), Answer::accepted);
  const std::uint16_t active = arm.device->status().active_slot;
  arm.flash.slots[active][300] ^= 4U;
  EXPECT_EQ(arm.push(make_image(arm.robot, 3)), Answer::storage_failed);
  EXPECT_EQ(arm.device->status().faults, wire::fault::storage);
  EXPECT_EQ(Arm(arm.flash).sequence(), 1U);
}

TEST(Store, RefusesEveryFlippedBit) {
  Arm arm;
  const Bytes good = make_image(arm.robot, 1);
  for (std::size_t bit = 0; bit < 8 * good.size(); ++bit) {
    Bytes bad = good;
    bad[bit / 8] = static_cast<std::uint8_t>(bad[bit / 8] ^ (1U << (bit % 8)));
    ASSERT_NE(arm.offer(bad), Refusal::none) << "bit " << bit;
    ASSERT_EQ(state(arm), StoreState::idle);
  }
  EXPECT_EQ(arm.flash.erased_slots, 0U);
}

TEST(Store, RefusesEveryTruncation) {
  Arm arm;
  const Bytes good = make_image(arm.robot, 1);
  for (std::size_t size = 1; size < good.size(); ++size) {
    const Bytes cut(good.begin(), good.begin() + static_cast<std::ptrdiff_t>(size));
    ASSERT_EQ(arm.offer(cut), Refusal::truncated) << size;
    // Announced in full and not sent in full.
    arm.run(Command::begin, static_cast<std::uint32_t>(good.size()));
    arm.device->store().write(0, good.data(), static_cast<std::uint32_t>(size), 1);
    ASSERT_EQ(arm.run(Command::commit), Answer::incomplete);
    ASSERT_EQ(arm.device->status().detail, size);
    arm.run(Command::abort);
  }
}

TEST(Store, NamesWhatIsWrong) {
  Arm arm;
  const Bytes good = make_image(arm.robot, 1);
  const auto changed = [&good](std::size_t at, std::uint8_t value) {
    Bytes b = good;
    b[at] = value;
    reseal(b);
    return b;
  };
  EXPECT_EQ(arm.offer(changed(0, 'X')), Refusal::bad_magic);
  EXPECT_EQ(arm.offer(changed(4, 2)), Refusal::schema);
  EXPECT_EQ(arm.offer(changed(6, 92)), Refusal::bad_length);
  EXPECT_EQ(arm.offer(changed(20, static_cast<std::uint8_t>(good[20] ^ 1U))), Refusal::wrong_nominal);
  EXPECT_EQ(arm.offer(changed(50, static_cast<std::uint8_t>(good[50] ^ 1U))), Refusal::wrong_robot);
  EXPECT_EQ(arm.offer(changed(80, 1)), Refusal::bad_length);
  Bytes longer = good;
  longer.insert(longer.end(), 4, 0);
  EXPECT_EQ(arm.offer(longer), Refusal::bad_length);

  const std::size_t term = good.size() - 4 - 32;  // the last record before the CRC is a term of 32 bytes
  EXPECT_EQ(arm.offer(changed(term, 99)), Refusal::unknown_record);
  EXPECT_EQ(arm.offer(changed(term + 6, 200)), Refusal::unknown_basis);
  EXPECT_EQ(arm.device->status().detail, 200U);
  EXPECT_EQ(arm.offer(changed(term + 4, 9)), Refusal::bad_place);
  EXPECT_EQ(arm.offer(changed(term + 7, 6)), Refusal::bad_value);
  const auto with_coefficient = [&](std::uint64_t bits) {
    Bytes b = good;
    store_u64(b.data() + term + 24, bits);
    reseal(b);
    return arm.offer(b);
  };
  EXPECT_EQ(with_coefficient(0x7FF8000000000000ULL), Refusal::bad_value) << "not a number";
  EXPECT_NE(with_coefficient(0x7FEFFFFFFFFFFFFFULL), Refusal::none) << "the largest number";

  Robot other = arm.robot;
  other.links[1].a_m += 1e-12;
  EXPECT_EQ(arm.offer(make_image(other, 1)), Refusal::wrong_nominal);
  other = arm.robot;
  other.name_hash = name_hash("other", 5);
  EXPECT_EQ(arm.offer(make_image(other, 1)), Refusal::wrong_robot);
  EXPECT_EQ(arm.offer(make_image(arm.robot, 1, 1000)), Refusal::implausible);
  EXPECT_GT(arm.device->status().detail, 50000U);
  EXPECT_EQ(arm.run(Command::begin, staging_bytes + 1), Answer::refused);
  EXPECT_EQ(static_cast<Refusal>(arm.device->status().refusal), Refusal::too_long);
  EXPECT_EQ(arm.run(Command::begin, 0), Answer::bad_argument);
  EXPECT_EQ(arm.offer(good), Refusal::none);
}

// A tool that is turned by half a turn has a sine of 0: it must not pass for no change.
TEST(Store, RefusesHalfATurn) {
  Robot robot = tx60l();
  robot.tool_xyz_m = {0, 0, 0};
  Arm arm({}, robot);
  Term<Scalar> t;
  t.place = {body::tool, slot::rz};
  t.coefficient = real(pi);
  EXPECT_EQ(arm.offer(image_of(robot, 1, {&t, 1, nullptr, 0, nullptr, 0})), Refusal::implausible);
}

TEST(Store, HasRoomForWhatItPromises) {
  Arm arm;
  std::vector<Term<Scalar>> terms(FirmwareCapacity::terms);
  for (auto& t : terms) {
    t.place = {1, slot::theta};
    t.basis = Basis::sine;
    t.argument = 1;
    t.coefficient = real(1e-6);
  }
  const auto offered = [&] {
    return arm.offer(image_of(arm.robot, 1, {terms.data(), terms.size(), nullptr, 0, nullptr, 0}));
  };
  EXPECT_EQ(offered(), Refusal::none);
  terms.push_back(terms.back());
  EXPECT_EQ(offered(), Refusal::too_many_terms);
}

/// The image of one term with a table of its own.
Bytes image_of_one(const Robot& robot, const Term<Scalar>& term, const Table& table = {},
                   const std::vector<Scalar>& values = {}) {
  return image_of(robot, 1, {&term, 1, &table, values.empty() ? 0U : 1U, values.data(), values.size()});
}

// What no arm can mean, and what the probe poses do not show.
TEST(Store, RefusesByItsBoundsWhatNoArmCanMean) {
  Robot robot = tx60l();
  robot.payload_kg = 0;
  Arm arm({}, robot);
  Term<Scalar> t;
  t.place = {6, slot::theta};
  t.joint = 5;
  const auto offered = [&](const Table& table = {}, const std::vector<Scalar>& values = {}) {
    return arm.offer(image_of_one(robot, t, table, values));
  };
  t.basis = Basis::load_torque;
  t.coefficient = real(1);
  EXPECT_EQ(offered(), Refusal::too_compliant);
  EXPECT_EQ(arm.device->status().detail, 0U);
  t.basis = Basis::sine;
  t.coefficient = real(0.02);
  for (const double order : {100.0, 300.0, 5000.0}) {
    t.argument = real(order);
    EXPECT_EQ(offered(), Refusal::too_steep) << order;
  }
  t.basis = Basis::curve;
  t.coefficient = real(1);
  t.table = 0;
  Table spike;
  spike.size = 256;
  std::vector<Scalar> values(256);
  values[77] = real(0.03);
  EXPECT_EQ(offered(spike, values), Refusal::too_large);
  t.basis = Basis::grid;
  Table grid;
  grid.rows = grid.columns = 2;
  grid.size = 8;
  for (const Covariate c : {Covariate::time, Covariate::relative_speed}) {
    grid.column_covariate = c;
    EXPECT_EQ(offered(grid, {real(-1), real(1), real(0), real(1), 0, real(1e-3), 0, real(1e-3)}),
              Refusal::not_allowed_covariate);
  }
  t = {};
  t.place = {4, slot::d};
  t.basis = Basis::thermal;
  t.coefficient = real(0.02);
  EXPECT_EQ(offered(), Refusal::too_large);
}

TEST(Store, NamesTheTermThatABoundIsExceededBy) {
  Arm arm;
  std::vector<Term<Scalar>> terms = some_terms(1, 1);
  terms.pop_back();  // the curve
  std::uint32_t effects = 0;
  for (const Term<Scalar>& t : terms) effects += is_constant(t) ? 0U : 1U;
  Term<Scalar> steep;
  steep.place = {1, slot::theta};
  steep.basis = Basis::sine;
  steep.argument = real(80);
  steep.coefficient = real(4e-3);
  terms.insert(terms.begin(), steep);
  EXPECT_EQ(arm.offer(image_of(arm.robot, 1, {terms.data(), terms.size(), nullptr, 0, nullptr, 0})),
            Refusal::too_steep);
  EXPECT_EQ(arm.device->status().detail, 0U);
  terms.erase(terms.begin());
  terms.push_back(steep);
  EXPECT_EQ(arm.offer(image_of(arm.robot, 1, {terms.data(), terms.size(), nullptr, 0, nullptr, 0})),
            Refusal::too_steep);
  EXPECT_EQ(arm.device->status().detail, effects);
}

TEST(Store, RefusesWhatAStepHasNoTimeFor) {
  DeviceSettings settings;
  settings.store.limits.instructions = 12000;
  Arm arm(settings);
  EXPECT_EQ(arm.offer(make_image(arm.robot, 1)), Refusal::too_costly);
  EXPECT_GT(arm.device->status().detail, 12000U);
}

TEST(Store, TellsTheBoundsOfTheActiveSetOnly) {
  Arm arm;
  EXPECT_EQ(arm.device->certificate().sequence, 0U);
  EXPECT_EQ(arm.device->certificate().instructions, 0U);
  EXPECT_EQ(arm.device->certificate().most_instructions, 100000U);
  ASSERT_EQ(arm.push(make_image(arm.robot, 1)), Answer::accepted);
  const wire::CertificateRecord one = arm.device->certificate();
  EXPECT_EQ(one.sequence, 1U);
  EXPECT_GT(one.instructions, 10000U);
  EXPECT_GT(double_of(one.position_m), 1e-4);
  arm.stage(make_image(arm.robot, 2, 2));
  ASSERT_EQ(arm.verify(), Answer::accepted);
  EXPECT_EQ(arm.device->certificate().position_m, one.position_m) << "what is staged is not what runs";
  arm.run(Command::commit);
  arm.settle();
  EXPECT_GT(double_of(arm.device->certificate().position_m), 1.5 * double_of(one.position_m));
  ASSERT_EQ(arm.run(Command::rollback), Answer::accepted);
  arm.settle();
  EXPECT_EQ(arm.device->certificate().position_m, one.position_m);
  Arm after(arm.flash);
  EXPECT_EQ(after.device->certificate().position_m, one.position_m);
}

TEST(Store, ATransferThatEndsHalfwayChangesNothing) {
  Arm arm;
  const Bytes first = make_image(arm.robot, 1);
  ASSERT_EQ(arm.push(first), Answer::accepted);
  const auto before = arm.flash.slots;
  const Bytes second = make_image(arm.robot, 2, 1, 2);
  Store& store = arm.device->store();

  arm.run(Command::begin, static_cast<std::uint32_t>(second.size()));
  store.write(0, second.data(), 100, 1);
  arm.run(Command::abort);
  EXPECT_EQ(arm.run(Command::commit), Answer::wrong_state);

  arm.run(Command::begin, static_cast<std::uint32_t>(second.size()));
  store.write(0, second.data(), 100, 1);
  store.disconnect(2);  // somebody else
  EXPECT_EQ(state(arm), StoreState::receiving);
  store.disconnect(1);
  EXPECT_EQ(state(arm), StoreState::idle);

  arm.stage(second);
  ASSERT_EQ(arm.verify(), Answer::accepted);
  store.poll(arm.now_ms);
  store.poll(arm.now_ms + 30000);  // left alone too long
  EXPECT_EQ(state(arm), StoreState::idle);
  EXPECT_EQ(arm.run(Command::commit), Answer::wrong_state);

  EXPECT_EQ(arm.flash.slots, before);
  EXPECT_EQ(arm.pull(), first);
}

TEST(Store, ChecksInSlicesAndSaysWorkingMeanwhile) {
  Arm arm;
  arm.stage(make_image(arm.robot, 1));
  EXPECT_EQ(arm.run(Command::verify), Answer::accepted);
  unsigned polls = 0;
  for (; state(arm) == StoreState::working && polls < 1000; ++polls) {
    EXPECT_EQ(arm.device->status().answer, static_cast<std::uint16_t>(Answer::accepted));
    EXPECT_EQ(arm.run(Command::verify), Answer::accepted) << "the same client asks again";
    EXPECT_EQ(arm.run(Command::verify, 0, 2), Answer::busy);
    EXPECT_EQ(arm.run(Command::begin, 100), Answer::busy);
    arm.run(Command::verify);
    arm.device->store().poll(++arm.now_ms);
  }
  EXPECT_EQ(state(arm), StoreState::verified);
  EXPECT_GT(polls, 36U) << "32 probe poses, and the rest";
  EXPECT_EQ(arm.run(Command::abort), Answer::accepted);
}

TEST(Store, ACommitDuringACheckFollowsByItself) {
  Arm arm;
  const Bytes image = make_image(arm.robot, 1);
  arm.stage(image);
  EXPECT_EQ(arm.run(Command::verify), Answer::accepted);
  arm.device->store().poll(++arm.now_ms);
  EXPECT_EQ(arm.run(Command::commit, 0, 2), Answer::busy);
  EXPECT_EQ(arm.run(Command::commit), Answer::accepted);
  EXPECT_EQ(static_cast<Answer>(arm.settle().answer), Answer::accepted);
  EXPECT_EQ(arm.pull(), image);
  // And of what is refused nothing is written.
  const unsigned erased = arm.flash.erased_slots;
  Bytes bad = make_image(arm.robot, 2);
  bad[120] ^= 1U;
  arm.stage(bad);
  EXPECT_EQ(arm.run(Command::verify), Answer::accepted);
  EXPECT_EQ(arm.run(Command::commit), Answer::accepted);
  EXPECT_EQ(static_cast<Answer>(arm.settle().answer), Answer::refused);
  EXPECT_EQ(state(arm), StoreState::idle);
  EXPECT_EQ(arm.flash.erased_slots, erased);
  EXPECT_EQ(arm.sequence(), 1U);
}

TEST(Store, ACheckIsGivenUpByItsClient) {
  Arm arm;
  for (const bool by_command : {true, false}) {
    arm.stage(make_image(arm.robot, 1));
    EXPECT_EQ(arm.run(Command::verify), Answer::accepted);
    arm.device->store().poll(++arm.now_ms);
    EXPECT_EQ(arm.run(Command::abort, 0, 2), Answer::busy);
    if (by_command) {
      EXPECT_EQ(arm.run(Command::abort), Answer::accepted);
    } else {
      arm.device->store().disconnect(2);
      EXPECT_EQ(state(arm), StoreState::working);
      arm.device->store().disconnect(1);
    }
    EXPECT_EQ(state(arm), StoreState::idle);
    arm.settle();
    EXPECT_EQ(arm.run(Command::commit), Answer::wrong_state);
  }
  EXPECT_EQ(arm.offer(make_image(arm.robot, 1)), Refusal::none);
}

TEST(Store, ARollbackChecksBeforeItErases) {
  Arm arm;
  ASSERT_EQ(arm.push(make_image(arm.robot, 1)), Answer::accepted);
  ASSERT_EQ(arm.push(make_image(arm.robot, 2, 1, 2)), Answer::accepted);
  for (auto& slot : arm.flash.slots) {
    if (load_u32(slot.data() + 12) == 1) slot[200] ^= 1U;  // damaged since
  }
  EXPECT_EQ(arm.run(Command::rollback), Answer::accepted);
  EXPECT_EQ(state(arm), StoreState::working);
  EXPECT_EQ(static_cast<Answer>(arm.settle().answer), Answer::no_previous);
  EXPECT_EQ(arm.sequence(), 2U);
  EXPECT_EQ(arm.pull(), make_image(arm.robot, 2, 1, 2));
}

TEST(Store, OneClientAtATime) {
  Arm arm;
  const Bytes image = make_image(arm.robot, 1);
  ASSERT_EQ(arm.stage(image, 1), Answer::accepted);
  EXPECT_EQ(arm.stage(image, 2), Answer::busy);
  EXPECT_EQ(arm.device->store().write(0, image.data(), 4, 2), Answer::busy);
  for (const Command c : {Command::verify, Command::commit, Command::commit_trial, Command::abort,
                          Command::rollback, Command::restore_defaults}) {
    EXPECT_EQ(arm.run(c, 0, 2), Answer::busy) << static_cast<int>(c);
  }
  EXPECT_EQ(arm.run(Command::confirm, 0, 2), Answer::wrong_state);
  EXPECT_EQ(arm.run(Command::commit, 0, 1), Answer::accepted);
  // Its own client may still give it up: nothing is written yet (authority_test.cpp).
  for (const int c : {1, 2, 3, 4, 5, 6, 8})
    EXPECT_EQ(arm.run(static_cast<Command>(c), 100, 1), Answer::busy) << c;
  arm.settle();
  EXPECT_EQ(arm.sequence(), 1U);
  EXPECT_EQ(arm.run(static_cast<Command>(99)), Answer::unknown_command);
}

TEST(Store, BytesMayComeTwiceButLeaveNoGap) {
  Arm arm;
  const Bytes image = make_image(arm.robot, 1);
  const auto size = static_cast<std::uint32_t>(image.size());
  Store& store = arm.device->store();
  EXPECT_EQ(store.write(0, image.data(), 4, 1), Answer::wrong_state);
  arm.run(Command::begin, size);
  EXPECT_EQ(store.write(1, image.data(), 4, 1), Answer::bad_argument);
  EXPECT_EQ(store.write(0, image.data(), 100, 1), Answer::accepted);
  EXPECT_EQ(store.write(50, image.data() + 50, 100, 1), Answer::accepted);
  EXPECT_EQ(store.write(151, image.data(), 1, 1), Answer::bad_argument);
  EXPECT_EQ(store.write(150, image.data() + 150, size - 149, 1), Answer::bad_argument);
  EXPECT_EQ(store.write(0xFFFFFFFF, image.data(), 4, 1), Answer::bad_argument);
  EXPECT_EQ(store.write(150, image.data() + 150, size - 150, 1), Answer::accepted);
  EXPECT_EQ(arm.run(Command::commit), Answer::accepted);
  arm.settle();
  EXPECT_EQ(arm.pull(), image);
}

TEST(Store, NothingIsTakenInWhileTheCycleStandsStill) {
  Flash flash;
  Device device(tx60l(), flash.hooks(), {});
  device.store().boot();
  const Bytes image = make_image(tx60l(), 1);
  Store& store = device.store();
  const auto take = [&](std::uint32_t sequence) {
    const Bytes b = make_image(tx60l(), sequence);
    store.run(Command::begin, static_cast<std::uint32_t>(b.size()), 1);
    store.write(0, b.data(), static_cast<std::uint32_t>(b.size()), 1);
    const Answer a = store.run(Command::commit, 0, 1);
    for (std::uint32_t k = 0; k < 100; ++k) store.poll(k);
    return a;
  };
  EXPECT_EQ(take(1), Answer::accepted);  // the first: no model was ever handed over
  EXPECT_EQ(take(2), Answer::busy);      // the cycle may be about to take the first one
  device.step({}, default_context<Scalar>(tx60l()));
  EXPECT_EQ(store.run(Command::commit, 0, 1), Answer::accepted);
}

TEST(Store, ATrialRevertsByItself) {
  Arm arm;
  const Bytes first = make_image(arm.robot, 1);
  ASSERT_EQ(arm.push(first), Answer::accepted);
  arm.stage(make_image(arm.robot, 2, 1, 2));
  ASSERT_EQ(arm.run(Command::commit_trial, 500), Answer::accepted);
  while (state(arm) == StoreState::working) arm.device->store().poll(++arm.now_ms);
  EXPECT_EQ(state(arm), StoreState::trial);
  EXPECT_EQ(arm.sequence(), 2U);
  EXPECT_EQ(arm.run(Command::begin, 100), Answer::wrong_state);
  // The cycle counts, also when the background hangs.
  for (int k = 0; k < 500; ++k) arm.step();
  EXPECT_EQ(arm.device->store().active_model()->effect_count(), 8U);
  EXPECT_EQ(arm.device->status().trial_cycles_left, 0U);
  arm.step();
  arm.device->store().poll(++arm.now_ms);
  const wire::Status s = arm.device->status();
  EXPECT_EQ(static_cast<Answer>(s.answer), Answer::reverted);
  EXPECT_EQ(s.faults, wire::fault::trial_reverted);
  EXPECT_EQ(arm.sequence(), 1U);
  EXPECT_EQ(arm.pull(), first);
  EXPECT_EQ(arm.run(Command::confirm), Answer::reverted);
  EXPECT_EQ(arm.push(make_image(arm.robot, 2)), Answer::accepted);
  EXPECT_EQ(arm.device->status().faults, 0);
}

TEST(Store, AConfirmedTrialStays) {
  Arm arm;
  const Bytes image = make_image(arm.robot, 2, 1, 2);
  ASSERT_EQ(arm.push(image, Command::commit_trial, 1000), Answer::accepted);
  EXPECT_EQ(state(arm), StoreState::trial);
  EXPECT_EQ(arm.pull(), image);
  {
    Flash as_it_is = arm.flash;
    EXPECT_EQ(Arm(as_it_is).sequence(), 0U) << "not before it is confirmed";
  }
  EXPECT_EQ(arm.run(Command::confirm), Answer::accepted);
  EXPECT_EQ(static_cast<Answer>(arm.settle().answer), Answer::accepted);
  for (int k = 0; k < 2000; ++k) arm.step();
  EXPECT_EQ(arm.settle().active_sequence, 2U);
  EXPECT_EQ(Arm(arm.flash).pull(), image);
}

TEST(Store, AConfirmationThatComesTooLateSaysSo) {
  Arm arm;
  arm.stage(make_image(arm.robot, 1));
  arm.run(Command::commit_trial, 10);
  while (state(arm) == StoreState::working) arm.device->store().poll(++arm.now_ms);
  for (int k = 0; k < 10; ++k) arm.step();
  EXPECT_EQ(arm.run(Command::confirm), Answer::accepted);
  arm.step();  // sees the confirmation in time …
  EXPECT_EQ(static_cast<Answer>(arm.settle().answer), Answer::accepted);

  Flash other;
  Arm late(other);
  late.stage(make_image(late.robot, 1));
  late.run(Command::commit_trial, 10);
  while (state(late) == StoreState::working) late.device->store().poll(++late.now_ms);
  for (int k = 0; k < 11; ++k) late.step();
  EXPECT_EQ(late.run(Command::confirm), Answer::reverted);  // … and here too late
  EXPECT_EQ(late.settle().active_sequence, 0U);
  EXPECT_EQ(Arm(other).sequence(), 0U);
}

TEST(Store, RollbackOutOfATrial) {
  Arm arm;
  ASSERT_EQ(arm.push(make_image(arm.robot, 1)), Answer::accepted);
  ASSERT_EQ(arm.push(make_image(arm.robot, 2, 1, 2), Command::commit_trial, 100000), Answer::accepted);
  EXPECT_EQ(arm.run(Command::rollback), Answer::accepted);
  EXPECT_EQ(arm.settle().active_sequence, 1U);
  EXPECT_EQ(arm.device->status().trial_cycles_left, 0U);
}

TEST(Store, RestoreDefaultsForgetsBothSlots) {
  Arm arm;
  for (std::uint32_t n = 1; n <= 2; ++n) ASSERT_EQ(arm.push(make_image(arm.robot, n)), Answer::accepted);
  EXPECT_EQ(arm.run(Command::restore_defaults), Answer::accepted);
  const wire::Status s = arm.settle();
  EXPECT_EQ(s.active_sequence, 0U);
  EXPECT_EQ(s.active_slot, wire::no_slot);
  EXPECT_TRUE(arm.pull().empty());
  EXPECT_EQ(arm.step().status, StepStatus::no_set);
  EXPECT_EQ(Arm(arm.flash).sequence(), 0U);
  EXPECT_EQ(arm.push(make_image(arm.robot, 1)), Answer::accepted);
}

TEST(Store, FailingMemoryChangesNothingThatRuns) {
  Arm arm;
  const Bytes first = make_image(arm.robot, 1);
  ASSERT_EQ(arm.push(first), Answer::accepted);
  arm.flash.fails = true;
  EXPECT_EQ(arm.push(make_image(arm.robot, 2)), Answer::storage_failed);
  EXPECT_EQ(arm.device->status().faults, wire::fault::storage);
  EXPECT_EQ(arm.pull(), first);
  Device bare(tx60l(), Storage{}, {});
  bare.store().boot();
  bare.step({}, default_context<Scalar>(tx60l()));
  bare.store().run(Command::begin, static_cast<std::uint32_t>(first.size()), 1);
  bare.store().write(0, first.data(), static_cast<std::uint32_t>(first.size()), 1);
  EXPECT_EQ(bare.store().run(Command::commit, 0, 1), Answer::storage_failed);
}

// The memory says that no seal could be written although all were: the client is told that the commit failed,
// so the next start must not bring the set after all.
TEST(Store, ASealThatFailedIsNotFoundAtTheNextStart) {
  for (const bool trial : {false, true}) {
    Flash flash;
    { ASSERT_EQ(Arm(flash).push(make_image(tx60l(), 1)), Answer::accepted); }
    Storage storage = flash.hooks();
    storage.write = [](void* self, unsigned slot, std::uint32_t offset, const std::uint8_t* from,
                       std::uint32_t size) {
      const StorageResult r = static_cast<Flash*>(self)->hooks().write(self, slot, offset, from, size);
      return offset >= slot_bytes - 5 * 32 ? StorageResult::failed : r;
    };
    Arm arm(flash);
    arm.device = std::make_unique<Device>(tx60l(), storage, DeviceSettings{});
    arm.device->store().boot();
    arm.step();
    const Answer a =
        arm.push(make_image(tx60l(), 2), trial ? Command::commit_trial : Command::commit, 100000);
    if (trial) {
      EXPECT_EQ(a, Answer::accepted);
      EXPECT_EQ(arm.run(Command::confirm), Answer::accepted);
      arm.settle();
    }
    EXPECT_EQ(static_cast<Answer>(arm.device->status().answer), Answer::storage_failed);
    EXPECT_EQ(arm.device->status().faults, wire::fault::storage);
    EXPECT_EQ(arm.sequence(), 1U);
    EXPECT_EQ(state(arm), StoreState::idle);
    EXPECT_EQ(Arm(flash).sequence(), 1U);
  }
}

TEST(Store, StartsWithTheOlderSetWhereTheNewestIsDamaged) {
  Flash flash;
  {
    Arm arm(flash);
    arm.push(make_image(arm.robot, 1));
    arm.push(make_image(arm.robot, 2, 1, 2));
  }
  flash.slots[1][200] ^= 1U;
  Arm arm(flash);
  EXPECT_EQ(arm.sequence(), 1U);
  EXPECT_EQ(arm.device->status().faults, wire::fault::older_slot);
  flash.slots[0][200] ^= 1U;
  Arm none(flash);
  EXPECT_EQ(none.sequence(), 0U);
  EXPECT_EQ(none.step().status, StepStatus::no_set);
  EXPECT_EQ(none.device->status().faults, wire::fault::no_valid_set);
}

// Two sets that this start refuses, and a new one with a lower sequence: at a start that would accept them again
// they must not come back in its place.
TEST(Store, WhatWasRefusedAtTheStartDoesNotReplaceANewerSet) {
  for (const bool trial : {false, true}) {
    Flash flash;
    {
      Arm arm(flash);
      ASSERT_EQ(arm.push(make_image(arm.robot, 5)), Answer::accepted);
      ASSERT_EQ(arm.push(make_image(arm.robot, 6)), Answer::accepted);
    }
    const Bytes image = make_image(tx60l(), 1, 0.01);
    {
      DeviceSettings strict;
      strict.store.plausible_position_m = real(5e-5);
      Arm arm(flash, strict);
      ASSERT_EQ(arm.sequence(), 0U);
      ASSERT_EQ(arm.push(image, trial ? Command::commit_trial : Command::commit, 100000), Answer::accepted);
      if (trial) {
        ASSERT_EQ(arm.run(Command::confirm), Answer::accepted);
        ASSERT_EQ(static_cast<Answer>(arm.settle().answer), Answer::accepted);
      }
      EXPECT_EQ(arm.pull(), image);
    }
    Arm after(flash);
    EXPECT_EQ(after.pull(), image);
    EXPECT_EQ(after.device->status().faults, 0);
  }
}

// The power goes at every single byte that a commit, a confirmed trial, a rollback or a restore erases or
// programs. After the start there is the set from before or the one from after, whole; after an
// acknowledgement only the one from after.
TEST(Store, SurvivesAPowerCutAtEveryByte) {
  const Robot robot = tx60l();
  const Bytes one = make_image(robot, 1);
  const Bytes two = make_image(robot, 2, 1, 2);
  const Bytes three = make_image(robot, 3, 1, 3);
  Flash prepared;
  {
    Arm arm(prepared);
    ASSERT_EQ(arm.push(one), Answer::accepted);
    ASSERT_EQ(arm.push(two), Answer::accepted);
  }
  struct Operation {
    const char* name;
    Bytes after;
    Answer (*run)(Arm&, const Bytes&);
  };
  const Operation operations[] = {
      {"commit", three, [](Arm& arm, const Bytes& image) { return arm.push(image); }},
      {"trial", three,
       [](Arm& arm, const Bytes& image) {
         const Answer a = arm.push(image, Command::commit_trial, 100000);
         if (a != Answer::accepted || arm.run(Command::confirm) != Answer::accepted) return Answer::busy;
         return static_cast<Answer>(arm.settle().answer);
       }},
      {"rollback", one,
       [](Arm& arm, const Bytes&) {
         arm.run(Command::rollback);
         return static_cast<Answer>(arm.settle().answer);
       }},
      {"restore",
       {},
       [](Arm& arm, const Bytes&) {
         arm.run(Command::restore_defaults);
         return static_cast<Answer>(arm.settle().answer);
       }},
  };
  for (const Operation& operation : operations) {
    bool ended = false;
    std::size_t cuts = 0;
    // Every byte of what a commit programs; elsewhere a sample. An erased slot is a matter of chance anyway.
    const bool dense = operation.name == std::string_view("commit");
    const long erased = static_cast<long>(slot_bytes) - 2;
    for (long power = 0; !ended; power += power < erased ? 101 : dense ? 1 : 9) {
      Flash flash = prepared;
      flash.power = power;
      bool acknowledged = false;
      try {
        Arm arm(flash);
        acknowledged = operation.run(arm, operation.after) == Answer::accepted;
        ended = true;
        ASSERT_TRUE(acknowledged) << operation.name;
      } catch (const PowerCut&) {
        ++cuts;
      }
      flash.power = -1;
      Arm after(flash);
      const Bytes now = after.pull();
      if (acknowledged) {
        ASSERT_EQ(now, operation.after) << operation.name;
      } else {
        ASSERT_TRUE(now == two || now == operation.after || (operation.after.empty() && now == one))
            << operation.name << " " << power;
      }
      // And it goes on from there.
      if (cuts % 16 == 0) {
        ASSERT_EQ(after.push(make_image(robot, 9)), Answer::accepted) << operation.name << " " << power;
      }
      ASSERT_FALSE(flash.double_writes);
    }
    EXPECT_GT(cuts, 100U) << operation.name;
  }
}

// Any commands with any arguments and bytes, in any order, from several clients.
TEST(Store, SurvivesAnything) {
  std::mt19937 engine(3);
  const auto random = [&engine] { return static_cast<std::uint32_t>(engine()); };
  Arm arm;
  const Bytes garbage = [&random] {
    Bytes b(staging_bytes);
    for (auto& x : b) x = static_cast<std::uint8_t>(random());
    return b;
  }();
  std::uint32_t sequence = 1;
  for (int k = 0; k < 200000; ++k) {
    const auto origin = static_cast<Origin>(1 + random() % 3);
    switch (random() % 8) {
      case 0:
        arm.run(static_cast<Command>(random() % 12), random() % 20000, origin);
        break;
      case 1:
        arm.device->store().write(random() % 16000, garbage.data(), random() % 300, origin);
        break;
      case 2:
        arm.device->store().begin_unknown(origin);
        break;
      case 3:
        arm.device->store().end(origin);
        break;
      case 4:
        arm.device->store().poll(arm.now_ms += random() % 100);
        break;
      case 5:
        arm.step();
        break;
      case 6:
        if (random() % 50 == 0) {
          ++sequence;
          arm.stage(make_image(arm.robot, sequence, 1, sequence), origin);
        }
        break;
      default:
        arm.device->store().disconnect(origin);
    }
    ASSERT_FALSE(arm.flash.double_writes);
  }
  arm.run(Command::rollback);
  arm.settle();
  const Bytes now = arm.pull();
  const std::uint32_t active = arm.sequence();
  if (!now.empty()) {
    ImageHeader header;
    EXPECT_EQ(check_image(now.data(), now.size(), nominal_hash(arm.robot), arm.robot.name_hash, header),
              Refusal::none);
    EXPECT_EQ(header.sequence, active);
  }
}

}  // namespace
}  // namespace flexcomp::firmware::bench
