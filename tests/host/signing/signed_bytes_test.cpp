// SPDX-License-Identifier: Apache-2.0
// Signed sets and commands: what was signed is verified, whatever byte is altered is not; counters only go up.
#include "signing/signed_bytes.hpp"

#include <gtest/gtest.h>

#include <chrono>
#include <filesystem>
#include <fstream>
#include <limits>
#include <utility>

#include "files/calibration_file.hpp"
#include "model/parameter_image.hpp"
#include "support/robot_files.hpp"
#include "support/text_file.hpp"

namespace signed_bytes {

using namespace flexcomp;        // NOLINT(google-build-using-namespace)
using namespace flexcomp::host;  // NOLINT(google-build-using-namespace)
using Image = std::vector<std::uint8_t>;

Image image_of(const std::string& serial) {
  Robot robot = support::tx60l();
  if (!serial.empty()) set_serial(robot, serial);
  const std::string path =
      support::write("s.yaml", "geometric: [{link: 2, a_mm: 0.3}, {link: 3, theta_deg: 0.02}]\n");
  return make_image(load_calibration(path, robot), robot, 5);
}

/// The core reads every record of an image, and nothing is left over.
void walk(const Image& image) {
  struct Nothing {
    Refusal table(const Table&, const std::uint8_t*) { return Refusal::none; }
    Refusal term(const Term<double>&) { return Refusal::none; }
  };
  ImageCursor cursor;
  while (!at_end(cursor, image.size())) {
    EXPECT_EQ(visit_record<double>(image.data(), image.size(), cursor, Nothing{}), Refusal::none);
  }
}

TEST(SignedBytes, ASetIsSignedAsTheCoreHasIt) {
  const SigningKey key = SigningKey::generate();
  for (const char* serial : {"", "A-1"}) {
    const Image plain = image_of(serial);
    const Image out = sign_image(plain, key, 0x0102030405060708, "i");
    ASSERT_EQ(out.size(), signed_size(plain.size()));
    ImageHeader header;
    const Robot& robot = support::tx60l();
    EXPECT_EQ(
        check_image(out.data(), out.size(), nominal_hash(robot.nominal), robot.nominal.name_hash, header),
        Refusal::none);
    EXPECT_EQ(header.schema_minor, 1);
    walk(out);
    const std::uint8_t* const record = signature_of(out.data(), out.size());
    ASSERT_NE(record, nullptr);
    ASSERT_EQ(record + signing::record_signature, out.data() + signature_offset(out.size()));
    EXPECT_EQ(load_u64(record + signing::record_counter), 0x0102030405060708U);
    Signature signature{};
    std::copy_n(out.begin() + static_cast<std::ptrdiff_t>(signature_offset(out.size())), 64,
                signature.begin());
    EXPECT_TRUE(verify(key.public_key(),
                       signed_message(Signed::set, sha256(out.data(), signature_offset(out.size()))),
                       signature));
    EXPECT_TRUE(is_canonical_signature(signature.data()));
    EXPECT_TRUE(is_signed_by(out, key.public_key()));
    EXPECT_FALSE(is_signed_by(plain, key.public_key()));
    EXPECT_FALSE(is_signed_by(out, SigningKey::generate().public_key()));
    // Taken off, put on again.
    EXPECT_EQ(without_signature(out, "i"), plain);
    EXPECT_EQ(sign_image(out, key, 0x0102030405060708, "i"), out);
    const SigningKey next = SigningKey::generate();
    const Image again = sign_image(out, next, 9, "i");
    EXPECT_EQ(again.size(), out.size());
    EXPECT_TRUE(is_signed_by(again, next.public_key()));
    const ImageRecords records = image_records(again, "i");
    EXPECT_TRUE(records.is_signed);
    EXPECT_EQ(records.counter, 9U);
    EXPECT_EQ(records.key_id, next.id());
    // The terms are those of the set that was signed.
    EXPECT_EQ(calibration_from_image(again, robot, "i").terms.terms.size(), 2U);
  }
}

TEST(SignedBytes, NoByteOfASetCanBeAltered) {
  const SigningKey key = SigningKey::generate();
  const Image out = sign_image(image_of("A-1"), key, 77, "i");
  const std::size_t crc_at = out.size() - image::crc_bytes;
  for (std::size_t k = 0; k < crc_at; ++k) {
    for (const unsigned bit : {0x01U, 0x80U}) {
      Image altered = out;
      altered[k] = static_cast<std::uint8_t>(altered[k] ^ bit);
      EXPECT_FALSE(is_signed_by(altered, key.public_key())) << k;
      // Who alters bytes can calculate a CRC.
      store_u32(altered.data() + crc_at, crc32(altered.data(), crc_at));
      EXPECT_FALSE(is_signed_by(altered, key.public_key())) << k;
    }
  }
  for (std::size_t size = 0; size < out.size(); ++size)
    EXPECT_FALSE(is_signed_by(std::span(out).first(size), key.public_key())) << size;
  EXPECT_THROW(sign_image(std::span(out).first(90), key, 1, "i"), InputError);
  // A record that says it is a signature, but is not the last one.
  Image moved = out;
  store_u16(moved.data() + image::header_bytes, image::record_signature);
  EXPECT_THROW(image_records(moved, "i"), InputError);
}

TEST(SignedBytes, NoByteOfACommandCanBeAltered) {
  const SigningKey key = SigningKey::generate();
  SignedCommand wanted;
  wanted.command = 6;
  wanted.active_crc = 0x12345678;
  wanted.counter = 0xFFFFFFFFFFFFFFFE;
  wanted.unit_hash = name_hash("A-1", 3);
  const Image out = sign_command(wanted, key);
  ASSERT_EQ(out.size(), signing::command_bytes);
  SignedCommand read;
  ASSERT_EQ(decode(out.data(), out.size(), read), Refusal::none);
  EXPECT_EQ(read.command, wanted.command);
  EXPECT_EQ(read.active_crc, wanted.active_crc);
  EXPECT_EQ(read.counter, wanted.counter);
  EXPECT_EQ(read.unit_hash, wanted.unit_hash);
  EXPECT_EQ(read.key_id, key.id());
  EXPECT_TRUE(is_command_signed_by(out, key.public_key()));
  EXPECT_FALSE(is_command_signed_by(out, SigningKey::generate().public_key()));
  for (std::size_t k = 0; k < signing::command_crc; ++k) {
    Image altered = out;
    altered[k] = static_cast<std::uint8_t>(altered[k] ^ 0x04U);
    EXPECT_FALSE(is_command_signed_by(altered, key.public_key())) << k;
    store_u32(altered.data() + signing::command_crc, crc32(altered.data(), signing::command_crc));
    EXPECT_FALSE(is_command_signed_by(altered, key.public_key())) << k;
  }
  for (std::size_t size = 0; size < out.size(); ++size)
    EXPECT_FALSE(is_command_signed_by(std::span(out).first(size), key.public_key())) << size;
  // A signature of a set is none of a command, and the other way round.
  EXPECT_FALSE(is_signed_by(out, key.public_key()));
}

TEST(SignedBytes, CountersOnlyGoUp) {
  using std::chrono::hours;
  using std::chrono::milliseconds;
  constexpr std::uint64_t most = std::numeric_limits<std::uint64_t>::max();
  constexpr std::uint64_t day_ms = 86400000;
  const std::chrono::system_clock::time_point now{milliseconds(1795000000000)};
  EXPECT_EQ(next_counter(0, now), 1795000000000U);
  EXPECT_EQ(next_counter(1795000000000 - 1, now), 1795000000000U);
  EXPECT_EQ(next_counter(1795000000000, now), 1795000000001U);
  EXPECT_EQ(next_counter(1795000000500, now), 1795000000501U);
  EXPECT_EQ(next_counter(most - 1, now), most);
  EXPECT_EQ(next_counter(most, now), 0U);
  EXPECT_TRUE(is_plausible_counter(0, now));
  EXPECT_TRUE(is_plausible_counter(1795000000000 + day_ms, now));
  EXPECT_FALSE(is_plausible_counter(1795000000000 + day_ms + 1, now));
  EXPECT_FALSE(is_plausible_counter(most, now));
  // A clock that stands before 1970, or at its start.
  const std::chrono::system_clock::time_point before{-hours(48)};
  EXPECT_EQ(next_counter(5, before), 6U);
  EXPECT_EQ(next_counter(0, before), 1U);
  EXPECT_FALSE(is_plausible_counter(1795000000000, before));
}

// For openssl_test.sh, which runs this beside a key: files that another program verifies.
TEST(SignedFiles, ForOpenssl) {
  if (!std::filesystem::exists("arm.key")) GTEST_SKIP() << "no arm.key here";
  const SigningKey key = SigningKey::read("arm.key");
  SignedCommand command;
  command.command = 6;
  command.counter = 3;
  for (const auto& [name, bytes] : {std::pair{"set.bin", sign_image(image_of("A-1"), key, 2, "i")},
                                    {"command.bin", sign_command(command, key)}}) {
    std::ofstream(name, std::ios::binary)
        .write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
  }
}

}  // namespace signed_bytes
