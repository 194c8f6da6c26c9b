// SPDX-License-Identifier: Apache-2.0
// Who may send a set, roll back and restore: signatures, serial numbers, unlock, turns. Ed25519 is OpenSSL's.
#include <gtest/gtest.h>
#include <openssl/evp.h>

#include <algorithm>
#include <array>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <random>

#include "bench.hpp"
#include "flexcomp/signature.hpp"

namespace flexcomp::firmware::bench {
namespace {

using wire::Answer;
using wire::Command;
using wire::StoreState;

class Key {
 public:
  explicit Key(std::uint8_t seed) {
    std::array<std::uint8_t, 32> secret{};
    secret.fill(seed);
    key_.reset(EVP_PKEY_new_raw_private_key(EVP_PKEY_ED25519, nullptr, secret.data(), secret.size()));
    std::size_t size = open.size();
    EXPECT_EQ(EVP_PKEY_get_raw_public_key(key_.get(), open.data(), &size), 1);
  }
  std::array<std::uint8_t, 64> sign(Signed what, const Bytes& bytes, std::size_t end) const {
    const auto message = signed_message(what, sha256(bytes.data(), end));
    std::array<std::uint8_t, 64> signature{};
    std::size_t size = signature.size();
    const std::unique_ptr<EVP_MD_CTX, decltype(&EVP_MD_CTX_free)> context(EVP_MD_CTX_new(), EVP_MD_CTX_free);
    EXPECT_EQ(EVP_DigestSignInit(context.get(), nullptr, nullptr, nullptr, key_.get()), 1);
    EXPECT_EQ(EVP_DigestSign(context.get(), signature.data(), &size, message.data(), message.size()), 1);
    return signature;
  }
  std::array<std::uint8_t, 32> open{};

 private:
  std::unique_ptr<EVP_PKEY, decltype(&EVP_PKEY_free)> key_{nullptr, EVP_PKEY_free};
};

int check_by_openssl(void* calls, const std::uint8_t* key, const std::uint8_t* signature,
                     const std::uint8_t* message, std::uint32_t size) {
  if (calls != nullptr) ++*static_cast<unsigned*>(calls);
  const std::unique_ptr<EVP_PKEY, decltype(&EVP_PKEY_free)> open(
      EVP_PKEY_new_raw_public_key(EVP_PKEY_ED25519, nullptr, key, 32), EVP_PKEY_free);
  const std::unique_ptr<EVP_MD_CTX, decltype(&EVP_MD_CTX_free)> context(EVP_MD_CTX_new(), EVP_MD_CTX_free);
  return EVP_DigestVerifyInit(context.get(), nullptr, nullptr, nullptr, open.get()) == 1 &&
                 EVP_DigestVerify(context.get(), signature, 64, message, size) == 1
             ? 1
             : 0;
}

Robot unit_named(const char* serial) {
  Robot robot = tx60l();
  robot.unit_hash = name_hash(serial, std::strlen(serial));
  return robot;
}

Bytes signed_image(Bytes image, const Key& key, std::uint64_t counter) {
  const std::size_t size = image.size();
  image.resize(signed_size(size));
  append_signature(image.data(), size, counter, key_id(key.open.data()));
  put_signature(image.data(), image.size(),
                key.sign(Signed::set, image, signature_offset(image.size())).data());
  return image;
}

Bytes signed_command(Command command, const Robot& robot, std::uint32_t active_crc, const Key& key,
                     std::uint64_t counter) {
  Bytes bytes(signing::command_bytes);
  SignedCommand c;
  c.command = static_cast<std::uint16_t>(command);
  c.active_crc = active_crc;
  c.counter = counter;
  c.unit_hash = robot.unit_hash;
  c.key_id = key_id(key.open.data());
  encode(c, bytes.data());
  const auto signature = key.sign(Signed::command, bytes, signing::command_signature);
  std::copy(signature.begin(), signature.end(), bytes.begin() + signing::command_signature);
  reseal(bytes);
  return bytes;
}

class Authority : public ::testing::Test {
 protected:
  const Key key{1}, other_key{2};
  const std::array<std::uint8_t, 32> keys[1] = {key.open};
  const Trust trust = trusting(keys[0].data(), 1);
  const Robot robot = unit_named("arm 5");
  Flash flash;
  std::unique_ptr<Arm> arm = started();

  static Trust trusting(const std::uint8_t* first, std::uint16_t count) {
    return {nullptr, reinterpret_cast<const std::uint8_t(*)[32]>(first), count, check_by_openssl};
  }
  std::unique_ptr<Arm> started() { return std::make_unique<Arm>(flash, DeviceSettings{}, robot, trust); }

  Answer push(std::uint32_t sequence, std::uint64_t counter, Command how = Command::commit) {
    return arm->push(signed_image(make_image(robot, sequence), key, counter), how, 1000000);
  }
  Answer run(Command c, Origin origin = 1) { return arm->device->store().run(c, 0, origin); }
  std::uint32_t active_crc() const { return arm->device->status().active_crc; }
  Answer order(Command c, std::uint64_t counter, Origin origin = 1) {
    const Answer staged = arm->stage(signed_command(c, robot, active_crc(), key, counter), origin);
    return staged == Answer::accepted ? arm->verify(origin) : staged;
  }
};

TEST_F(Authority, OnlyASignedSetIsTaken) {
  EXPECT_EQ(arm->offer(make_image(robot, 1)), Refusal::not_signed);
  EXPECT_EQ(arm->offer(signed_image(make_image(tx60l(), 1), key, 1)), Refusal::not_signed) << "for any unit";
  EXPECT_EQ(arm->offer(signed_image(make_image(unit_named("arm 6"), 1), key, 1)), Refusal::wrong_unit);
  EXPECT_EQ(arm->offer(signed_image(make_image(robot, 1), other_key, 1)), Refusal::unknown_key);
  EXPECT_EQ(arm->offer(signed_image(make_image(robot, 1), key, 0)), Refusal::counter_used);
  EXPECT_EQ(arm->sequence(), 0U);
  ASSERT_EQ(push(1, 1), Answer::accepted);
  EXPECT_EQ(arm->sequence(), 1U);
  EXPECT_EQ(arm->device->unit().counter, 1U);
  EXPECT_EQ(arm->device->unit().keys, 1U);
  EXPECT_EQ(arm->device->unit().key_ids[0], key_id(key.open.data()));
  // Someone else's signature under the id of the key that is trusted.
  Bytes forged = make_image(robot, 2);
  forged.resize(signed_size(forged.size()));
  append_signature(forged.data(), forged.size() - image::record_head_bytes - image::signature_bytes, 2,
                   key_id(key.open.data()));
  put_signature(forged.data(), forged.size(),
                other_key.sign(Signed::set, forged, signature_offset(forged.size())).data());
  EXPECT_EQ(arm->offer(forged), Refusal::wrong_signature);
  put_signature(forged.data(), forged.size(),
                key.sign(Signed::command, forged, signature_offset(forged.size())).data());
  EXPECT_EQ(arm->offer(forged), Refusal::wrong_signature) << "signed, but as a command";
}

TEST_F(Authority, NoByteMayBeAltered) {
  const Bytes good = signed_image(make_image(robot, 1), key, 5);
  for (std::size_t k = 0; k + 4 < good.size(); ++k) {
    Bytes bad = good;
    bad[k] ^= static_cast<std::uint8_t>(1U << (k % 8));
    reseal(bad);
    ASSERT_NE(arm->offer(bad), Refusal::none) << "byte " << k;
    ASSERT_NE(arm->device->status().state, static_cast<std::uint16_t>(StoreState::verified)) << "byte " << k;
  }
  EXPECT_EQ(arm->offer(good), Refusal::none);
}

TEST_F(Authority, AMalleableOrTruncatedSignatureIsRefused) {
  const Bytes good = signed_image(make_image(robot, 1), key, 5);
  // S + L is the same number modulo the order of the group: a library that does not look takes it as well.
  constexpr std::array<std::uint8_t, 32> order = {
      0xED, 0xD3, 0xF5, 0x5C, 0x1A, 0x63, 0x12, 0x58, 0xD6, 0x9C, 0xF7, 0xA2, 0xDE, 0xF9, 0xDE, 0x14,
      0,    0,    0,    0,    0,    0,    0,    0,    0,    0,    0,    0,    0,    0,    0,    0x10};
  Bytes other = good;
  unsigned carry = 0;
  for (std::size_t k = 0; k < 32; ++k) {
    std::uint8_t& byte = other[signature_offset(other.size()) + 32 + k];
    carry += static_cast<unsigned>(byte) + order[k];
    byte = static_cast<std::uint8_t>(carry);
    carry >>= 8U;
  }
  reseal(other);
  unsigned calls = 0;
  Trust counting = trust;
  counting.user = &calls;
  Flash second;
  Arm fresh(second, {}, robot, counting);
  EXPECT_EQ(fresh.offer(other), Refusal::wrong_signature);
  EXPECT_EQ(calls, 0U) << "left to nobody's library";
  EXPECT_EQ(fresh.offer(good), Refusal::none);
  EXPECT_EQ(calls, 1U);

  for (std::uint16_t length = 0; length < image::signature_bytes;
       length = static_cast<std::uint16_t>(length + 4)) {
    const std::size_t record = good.size() - 4 - image::signature_bytes - 4;
    Bytes cut(good.begin(), good.begin() + static_cast<std::ptrdiff_t>(record + 4 + length));
    store_u16(cut.data() + record + 2, length);
    cut.resize(cut.size() + 4);
    store_u32(cut.data() + 8, static_cast<std::uint32_t>(cut.size()));
    reseal(cut);
    ASSERT_NE(arm->offer(cut), Refusal::none) << length;
  }
}

TEST_F(Authority, ACounterIsUsedOnce) {
  const Bytes first = signed_image(make_image(robot, 1), key, 7);
  ASSERT_EQ(arm->push(first), Answer::accepted);
  ASSERT_EQ(push(2, 8), Answer::accepted);
  EXPECT_EQ(arm->offer(first), Refusal::counter_used);
  EXPECT_EQ(arm->offer(signed_image(make_image(robot, 3), key, 8)), Refusal::counter_used);
  arm = started();
  EXPECT_EQ(arm->sequence(), 2U);
  EXPECT_EQ(arm->offer(first), Refusal::counter_used);
  // Back to the first set, with its old counter in it: what counts is the highest.
  ASSERT_EQ(order(Command::rollback, 9), Answer::accepted);
  ASSERT_EQ(run(Command::rollback), Answer::accepted);
  arm->settle();
  EXPECT_EQ(arm->sequence(), 1U);
  arm = started();
  EXPECT_EQ(arm->sequence(), 1U);
  EXPECT_EQ(arm->device->unit().counter, 9U);
  EXPECT_EQ(arm->offer(signed_image(make_image(robot, 3), key, 9)), Refusal::counter_used);
  ASSERT_EQ(push(3, 0xFFFFFFFFFFFFFFFF), Answer::accepted) << "64 bits";
  EXPECT_EQ(arm->offer(signed_image(make_image(robot, 4), key, 0)), Refusal::counter_used) << "no wrap";
}

TEST_F(Authority, ATrialUsesItsCounterAlsoWhereItReverts) {
  ASSERT_EQ(push(1, 1), Answer::accepted);
  const Bytes tried = signed_image(make_image(robot, 2), key, 2);
  ASSERT_EQ(arm->push(tried, Command::commit_trial, 5), Answer::reverted);
  ASSERT_EQ(arm->sequence(), 1U);
  EXPECT_EQ(arm->offer(tried), Refusal::counter_used) << "without the key nobody makes it permanent";
  arm = started();
  EXPECT_EQ(arm->offer(tried), Refusal::counter_used);
  for (std::uint64_t k = 3; k < 40; ++k) {
    ASSERT_EQ(push(2, k, Command::commit_trial), Answer::accepted) << "trial after trial";
    ASSERT_EQ(run(k % 2 == 0 ? Command::rollback : Command::none),
              k % 2 == 0 ? Answer::accepted : Answer::unknown_command);
    arm = started();
    ASSERT_EQ(arm->sequence(), 1U);
    ASSERT_EQ(arm->device->unit().counter, k);
  }
  ASSERT_EQ(push(2, 40, Command::commit_trial), Answer::accepted);
  ASSERT_EQ(run(Command::confirm), Answer::accepted);
  arm->settle();
  EXPECT_EQ(arm->sequence(), 2U);
  EXPECT_EQ(arm->device->unit().counter, 40U);
}

TEST_F(Authority, ASignedCommandIsUsedUpByItsCheck) {
  ASSERT_EQ(push(1, 1), Answer::accepted);
  ASSERT_EQ(push(2, 2), Answer::accepted);
  ASSERT_EQ(order(Command::rollback, 3), Answer::accepted);
  arm = started();
  EXPECT_EQ(arm->device->unit().counter, 3U);
  EXPECT_EQ(order(Command::rollback, 3), Answer::refused);
  EXPECT_EQ(run(Command::rollback), Answer::not_authorised);
}

TEST_F(Authority, ASignedCommandIsForTheSetThatRunsThen) {
  ASSERT_EQ(push(1, 1), Answer::accepted);
  ASSERT_EQ(push(2, 2), Answer::accepted);
  for (const Command c : {Command::rollback, Command::restore_defaults}) {
    const std::uint32_t now = arm->sequence();
    ASSERT_EQ(order(c, 10 * now, 7), Answer::accepted);
    ASSERT_EQ(push(now + 1, 10 * now + 1), Answer::accepted) << "another client";
    EXPECT_EQ(run(c, 7), Answer::not_authorised);
    EXPECT_EQ(arm->sequence(), now + 1);
  }
}

// Power goes while a restore has written one mark of three: one mark voids nothing, and yet the counter in it counts.
TEST_F(Authority, ARestoreThatWasCutLeavesItsCounter) {
  ASSERT_EQ(push(1, 1), Answer::accepted);
  ASSERT_EQ(push(2, 2), Answer::accepted);
  const Flash before = flash;
  for (long power = 0; power < 3 * static_cast<long>(slot_bytes); power += power % 32 == 31 ? 1 : 31) {
    arm = nullptr;
    flash = before;
    arm = started();
    ASSERT_EQ(order(Command::restore_defaults, 9), Answer::accepted);
    flash.power = power;
    try {
      if (run(Command::restore_defaults) == Answer::accepted) arm->settle();
    } catch (const PowerCut&) {
    }
    flash.power = -1;
    for (int start = 0; start < 3; ++start) {
      arm = started();
      ASSERT_EQ(arm->device->unit().counter, 9U) << "power " << power << ", start " << start;
    }
  }
}

TEST_F(Authority, RollbackAndRestoreNeedASignedCommand) {
  ASSERT_EQ(push(1, 1), Answer::accepted);
  ASSERT_EQ(push(2, 2), Answer::accepted);
  for (const Command c : {Command::rollback, Command::restore_defaults}) {
    EXPECT_EQ(run(c), Answer::not_authorised);
    EXPECT_EQ(arm->device->status().detail, wire::needs_signature);
    EXPECT_EQ(arm->run(c), Answer::not_authorised) << "an unlock does not do";
  }
  EXPECT_EQ(arm->offer(signed_command(Command::rollback, unit_named("arm 6"), active_crc(), key, 3)),
            Refusal::wrong_unit);
  EXPECT_EQ(arm->offer(signed_command(Command::rollback, robot, active_crc() + 1, key, 3)),
            Refusal::stale_sequence);
  EXPECT_EQ(arm->offer(signed_command(Command::rollback, robot, active_crc(), other_key, 3)),
            Refusal::unknown_key);
  EXPECT_EQ(arm->offer(signed_command(Command::rollback, robot, active_crc(), key, 2)),
            Refusal::counter_used);
  const Bytes good = signed_command(Command::rollback, robot, active_crc(), key, 3);
  for (std::size_t k = 4; k + 4 < good.size(); ++k) {
    Bytes bad = good;
    bad[k] ^= static_cast<std::uint8_t>(1U << (k % 8));
    reseal(bad);
    ASSERT_NE(arm->offer(bad), Refusal::none) << "byte " << k;
    ASSERT_EQ(run(Command::rollback), Answer::not_authorised) << "byte " << k;
  }
  // It is not committed as a set, before or after it is verified.
  ASSERT_EQ(arm->stage(good), Answer::accepted);
  EXPECT_EQ(arm->run(Command::commit), Answer::accepted);
  EXPECT_EQ(arm->settle().refusal, static_cast<std::uint16_t>(Refusal::bad_magic));
  ASSERT_EQ(arm->stage(good), Answer::accepted);
  ASSERT_EQ(arm->run(Command::verify), Answer::accepted);
  arm->device->store().poll(arm->now_ms += 1);
  EXPECT_EQ(arm->run(Command::commit), Answer::wrong_state);
  arm->settle();
  EXPECT_EQ(arm->sequence(), 2U);

  EXPECT_EQ(run(Command::restore_defaults), Answer::not_authorised) << "it was for a rollback, and is gone";
  ASSERT_EQ(order(Command::rollback, 4), Answer::accepted);
  EXPECT_EQ(run(Command::rollback, 2), Answer::not_authorised) << "for another client";
  ASSERT_EQ(run(Command::rollback), Answer::accepted);
  arm->settle();
  EXPECT_EQ(arm->sequence(), 1U);
  EXPECT_EQ(run(Command::restore_defaults), Answer::not_authorised) << "once";
  ASSERT_EQ(order(Command::restore_defaults, 5), Answer::accepted);
  ASSERT_EQ(run(Command::restore_defaults), Answer::accepted);
  arm->settle();
  EXPECT_EQ(arm->sequence(), 0U);
  arm = started();
  EXPECT_EQ(arm->sequence(), 0U);
  EXPECT_EQ(arm->device->unit().counter, 5U) << "outlasts an erase of both slots";
  EXPECT_EQ(order(Command::restore_defaults, 5), Answer::refused);
  ASSERT_EQ(order(Command::restore_defaults, 6), Answer::accepted);
  ASSERT_EQ(run(Command::restore_defaults), Answer::accepted) << "without a set";
  arm->settle();
  arm = started();
  EXPECT_EQ(arm->device->unit().counter, 6U);
}

TEST_F(Authority, ASignedCommandHoldsForTenSecondsAndUntilTheNextCommand) {
  ASSERT_EQ(push(1, 1), Answer::accepted);
  ASSERT_EQ(push(2, 2), Answer::accepted);
  ASSERT_EQ(order(Command::rollback, 3), Answer::accepted);
  arm->device->store().poll(arm->now_ms += 10001);
  EXPECT_EQ(run(Command::rollback), Answer::not_authorised);
  ASSERT_EQ(order(Command::rollback, 4), Answer::accepted);
  EXPECT_EQ(run(Command::abort), Answer::accepted);
  EXPECT_EQ(run(Command::rollback), Answer::not_authorised);
  EXPECT_EQ(arm->sequence(), 2U);
}

TEST_F(Authority, TheProgramItselfAndItsHookNeedNoSignature) {
  ASSERT_EQ(push(1, 1), Answer::accepted);
  ASSERT_EQ(push(2, 2), Answer::accepted);
  Permit permit = Permit::allow;
  DeviceHooks hooks;
  hooks.user = &permit;
  hooks.permit = [](void* answer, Command, Origin) { return *static_cast<Permit*>(answer); };
  arm->device->set_hooks(hooks);
  EXPECT_EQ(arm->device->run(Command::rollback, 0, 1), Answer::not_authorised);
  permit = Permit::authorise;
  EXPECT_EQ(arm->device->run(Command::rollback, 0, 1), Answer::accepted);
  arm->settle();
  EXPECT_EQ(arm->sequence(), 1U);
  permit = Permit::refuse;
  EXPECT_EQ(arm->device->run(Command::restore_defaults, 0, 1), Answer::not_authorised);
  EXPECT_EQ(arm->device->store().run(Command::restore_defaults, 0, nobody), Answer::accepted);
}

TEST_F(Authority, WhatIsStoredIsCheckedAtTheStart) {
  // Written before there was a key, or by a key that is no longer trusted, or taken from another unit.
  Flash before;
  {
    Arm free(before, {}, robot);
    ASSERT_EQ(free.push(make_image(robot, 1)), Answer::accepted);
  }
  Arm now(before, {}, robot, trust);
  EXPECT_EQ(now.sequence(), 0U);
  EXPECT_EQ(now.device->status().refusal, static_cast<std::uint16_t>(Refusal::not_signed));
  ASSERT_EQ(push(1, 1), Answer::accepted);
  const auto others = trusting(other_key.open.data(), 1);
  {
    Arm rotated(flash, {}, robot, others);
    EXPECT_EQ(rotated.sequence(), 0U);
  }
  {
    Arm moved(flash, {}, unit_named("arm 6"), trust);
    EXPECT_EQ(moved.sequence(), 0U);
  }
  {
    Arm nameless(flash, {}, tx60l(), trust);
    EXPECT_EQ(nameless.sequence(), 0U);
  }
  std::array<std::array<std::uint8_t, 32>, 2> both = {other_key.open, key.open};
  Arm rotating(flash, {}, robot, trusting(both[0].data(), 2));
  EXPECT_EQ(rotating.sequence(), 1U) << "both keys count";
  EXPECT_EQ(rotating.push(signed_image(make_image(robot, 2), other_key, 2)), Answer::accepted);
  arm = nullptr;
  Arm last(flash, {}, robot, others);
  EXPECT_EQ(last.sequence(), 2U) << "then the old one is left out";
}

// A checking function in hardware, or a task of its own, that answers late, or never.
TEST_F(Authority, ASlowCheckHoldsUpNothing) {
  struct Slow {
    unsigned left = 0, calls = 0;
  } slow;
  Trust late = trust;
  late.user = &slow;
  late.check = [](void* user, const std::uint8_t* k, const std::uint8_t* s, const std::uint8_t* m,
                  std::uint32_t size) {
    auto& state = *static_cast<Slow*>(user);
    ++state.calls;
    return state.left != 0 ? (--state.left, 2) : check_by_openssl(nullptr, k, s, m, size);
  };
  Flash memory;
  Arm patient(memory, {}, robot, late);
  slow.left = 300;
  ASSERT_EQ(patient.push(signed_image(make_image(robot, 1), key, 1)), Answer::accepted);
  EXPECT_EQ(slow.calls, 301U) << "once in a poll";
  slow.left = 0xFFFFFFFF;
  ASSERT_EQ(patient.stage(signed_image(make_image(robot, 2), key, 2)), Answer::accepted);
  ASSERT_EQ(patient.run(Command::verify), Answer::accepted);
  for (int k = 0; k < 1000; ++k) patient.device->store().poll(patient.now_ms += 1);
  EXPECT_EQ(patient.run(Command::abort), Answer::accepted) << "its client gives it up";
  ASSERT_EQ(patient.stage(signed_image(make_image(robot, 2), key, 2)), Answer::accepted);
  ASSERT_EQ(patient.run(Command::commit), Answer::accepted);
  for (int k = 0; k < 1000; ++k) patient.device->store().poll(patient.now_ms += 1);
  EXPECT_EQ(patient.run(Command::abort), Answer::accepted) << "also of a commit, before anything is written";
  ASSERT_EQ(patient.stage(signed_image(make_image(robot, 2), key, 2)), Answer::accepted);
  ASSERT_EQ(patient.run(Command::commit), Answer::accepted);
  for (int k = 0; k < 1000; ++k) patient.device->store().poll(patient.now_ms += 50);
  EXPECT_EQ(patient.device->status().refusal, static_cast<std::uint16_t>(Refusal::wrong_signature))
      << "or nobody does";
  Arm restarted(memory, {}, robot, late);
  EXPECT_EQ(restarted.sequence(), 0U) << "a start that never hears of it ends without a set";
  // Whatever else the function answers means no.
  for (const int answer : {0, -1, 3, 256, 0x101}) {
    static int said;
    said = answer;
    late.check = [](void*, const std::uint8_t*, const std::uint8_t*, const std::uint8_t*, std::uint32_t) {
      return said;
    };
    Flash empty;
    Arm strict(empty, {}, robot, late);
    EXPECT_EQ(strict.offer(signed_image(make_image(robot, 1), key, 1)), Refusal::wrong_signature) << answer;
  }
}

// Power cuts at any byte, starts, pushes, rollbacks and restores: no counter that was acknowledged counts a second time.
// FLEXCOMP_LONG_CUTS=100000 makes the long run.
TEST_F(Authority, NoPowerCutBringsACounterBack) {
  std::mt19937 random(11);
  std::uint64_t used = 0, told = 0, next = 1;
  std::uint32_t sequence = 1;
  unsigned cuts = 0, restores = 0;
  const char* text = std::getenv("FLEXCOMP_LONG_CUTS");
  const unsigned long operations = text != nullptr ? std::strtoul(text, nullptr, 10) : 1500;
  for (unsigned long k = 0; k < operations; ++k) {
    if (!arm) arm = started();
    ASSERT_GE(arm->device->unit().counter, used) << "operation " << k;
    ASSERT_GE(arm->device->unit().counter, told) << "operation " << k;
    told = arm->device->unit().counter;
    if (arm->sequence() >= sequence) sequence = arm->sequence() + 1;
    const unsigned what = random() % 8;
    const std::uint64_t counter = next++;
    if (random() % 2 == 0) flash.power = static_cast<long>(random() % (2 * slot_bytes));
    try {
      bool done = false;
      if (what < 5) {
        done =
            push(sequence++, counter, what < 4 ? Command::commit : Command::commit_trial) == Answer::accepted;
        if (what == 4 && done) {
          done = run(random() % 2 == 0 ? Command::confirm : Command::rollback) == Answer::accepted;
          arm->settle();
        }
      } else {
        const Command c = what < 7 ? Command::rollback : Command::restore_defaults;
        done = order(c, counter) == Answer::accepted && run(c) == Answer::accepted &&
               static_cast<Answer>(arm->settle().answer) == Answer::accepted;
        restores += done && what == 7 ? 1 : 0;
      }
      if (done) used = counter;
    } catch (const PowerCut&) {
      ++cuts;
      arm = nullptr;
    }
    flash.power = -1;
    if (random() % 4 == 0) arm = nullptr;
  }
  EXPECT_GT(cuts, 200U);
  EXPECT_GT(restores, 50U);
  EXPECT_GT(used, 1000U);
}

TEST(Unlock, NoSingleFrameDestroysASet) {
  Arm arm;
  Store& store = arm.device->store();
  ASSERT_EQ(arm.push(make_image(arm.robot, 1)), Answer::accepted);
  ASSERT_EQ(arm.push(make_image(arm.robot, 2)), Answer::accepted);
  const auto challenge = [&](Origin origin) {
    EXPECT_EQ(store.run(Command::unlock, 0, origin), Answer::accepted);
    return arm.device->status().detail;
  };
  for (const Command c : {Command::rollback, Command::restore_defaults}) {
    EXPECT_EQ(store.run(c, 0, 1), Answer::not_authorised);
    EXPECT_EQ(arm.device->status().detail, wire::needs_unlock);
    challenge(1);
    EXPECT_EQ(store.run(c, 0, 1), Answer::not_authorised) << "asked, not answered";
    const std::uint32_t number = challenge(1);
    EXPECT_NE(number, 0U);
    EXPECT_EQ(store.run(Command::unlock, number + 2, 1), Answer::not_authorised);
    EXPECT_EQ(store.run(Command::unlock, number, 1), Answer::not_authorised) << "one attempt";
    EXPECT_EQ(store.run(c, 0, 1), Answer::not_authorised);
    EXPECT_EQ(store.run(Command::unlock, challenge(1), 2), Answer::not_authorised) << "another client";
    ASSERT_EQ(store.run(Command::unlock, challenge(1), 1), Answer::accepted);
    EXPECT_EQ(store.run(c, 0, 2), Answer::not_authorised);
    ASSERT_EQ(store.run(Command::unlock, challenge(1), 1), Answer::accepted);
    store.poll(arm.now_ms += 10000);
    EXPECT_EQ(store.run(c, 0, 1), Answer::not_authorised) << "too late";
    ASSERT_EQ(store.run(Command::unlock, challenge(1), 1), Answer::accepted);
    EXPECT_EQ(store.run(Command::abort, 0, 1), Answer::accepted);
    EXPECT_EQ(store.run(c, 0, 1), Answer::not_authorised) << "a command in between";
  }
  EXPECT_NE(challenge(1), challenge(1)) << "what was recorded does not open";
  const std::uint32_t twice = challenge(1);
  EXPECT_EQ(store.run(Command::unlock, twice, 1), Answer::accepted);
  EXPECT_EQ(store.run(Command::unlock, twice, 1), Answer::accepted) << "its answer was lost";
  ASSERT_EQ(arm.push(make_image(arm.robot, 3)), Answer::accepted);
  EXPECT_EQ(store.run(Command::rollback, 0, 1), Answer::not_authorised) << "another set runs now";
  EXPECT_EQ(arm.sequence(), 3U);
  ASSERT_EQ(store.run(Command::unlock, challenge(1), 1), Answer::accepted);
  EXPECT_EQ(store.run(Command::rollback, 0, 1), Answer::accepted);
  arm.settle();
  EXPECT_EQ(arm.sequence(), 2U);
  EXPECT_EQ(store.run(Command::restore_defaults, 0, 1), Answer::not_authorised) << "once";
  // The end of a trial destroys nothing.
  ASSERT_EQ(arm.push(make_image(arm.robot, 3), Command::commit_trial, 100000), Answer::accepted);
  EXPECT_EQ(store.run(Command::rollback, 0, 1), Answer::accepted);
}

TEST(Unit, ASetForAnotherUnitIsRefused) {
  const Robot five = unit_named("arm 5"), six = unit_named("arm 6");
  Arm arm({}, six);
  EXPECT_EQ(arm.offer(make_image(five, 1)), Refusal::wrong_unit);
  EXPECT_EQ(arm.push(make_image(six, 1)), Answer::accepted);
  EXPECT_EQ(arm.push(make_image(tx60l(), 2)), Answer::accepted) << "for any unit";
  Arm nameless;
  EXPECT_EQ(nameless.offer(make_image(five, 1)), Refusal::wrong_unit);
  // The set follows its unit, not the memory.
  Flash memory;
  {
    Arm there(memory, {}, five);
    ASSERT_EQ(there.push(make_image(five, 1)), Answer::accepted);
  }
  Arm here(memory, {}, six);
  EXPECT_EQ(here.sequence(), 0U);
  EXPECT_EQ(here.device->status().refusal, static_cast<std::uint16_t>(Refusal::wrong_unit));
}

// A client that begins again and again, or sends the same bytes, blocks nobody for longer than the time of a transfer.
TEST(Turns, NobodyHogsTheStagingMemory) {
  Arm arm;
  Store& store = arm.device->store();
  const Bytes image = make_image(arm.robot, 1);
  const auto size = static_cast<std::uint32_t>(image.size());
  for (const int how : {0, 1, 2}) {
    SCOPED_TRACE(how);
    ASSERT_EQ(store.run(Command::begin, size, 7), Answer::accepted);
    std::uint32_t waited = 0;
    std::uint32_t sent = 0;
    Answer a = Answer::busy;
    for (; waited < 60000 && a == Answer::busy; waited += 100) {
      store.poll(arm.now_ms += 100);
      if (how == 0) store.run(Command::begin, size, 7);                            // again and again
      if (how == 1) store.write(0, image.data(), 4, 7);                            // the same bytes
      if (how == 2 && sent < size) store.write(sent, &image[sent], 1, 7), ++sent;  // ten bytes a second
      a = store.run(Command::begin, size, 8);
    }
    EXPECT_EQ(a, Answer::accepted);
    EXPECT_LE(waited, how == 0 ? 200U : how == 1 ? 3200U : 30200U);
    EXPECT_EQ(store.run(Command::begin, size, 7), Answer::busy) << "now it is the other's turn";
    EXPECT_EQ(store.write(0, image.data(), size, 8), Answer::accepted);
    EXPECT_EQ(store.run(Command::abort, 0, 8), Answer::accepted);
  }
}

}  // namespace
}  // namespace flexcomp::firmware::bench
