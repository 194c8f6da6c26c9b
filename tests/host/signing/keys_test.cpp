// SPDX-License-Identifier: Apache-2.0
// Key files: what is written is read again, what is something else is refused for what it is; the algorithm against RFC 8032.
#include "signing/keys.hpp"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <sys/stat.h>

#include <cstdlib>
#include <filesystem>

#include "support/text_file.hpp"
#include "support/thrown.hpp"

namespace signing_keys {

using namespace flexcomp::host;
using support::expect_refused;
using support::path_of;
using support::read;

std::vector<std::uint8_t> bytes(const std::string& hex) {
  std::vector<std::uint8_t> out;
  for (std::size_t k = 0; k < hex.size(); k += 2)
    out.push_back(static_cast<std::uint8_t>(std::stoul(hex.substr(k, 2), nullptr, 16)));
  return out;
}

template <class Array>
Array array_of(const std::string& hex) {
  Array out{};
  const std::vector<std::uint8_t> all = bytes(hex);
  std::copy(all.begin(), all.end(), out.begin());
  return out;
}

/// A private file with this content.
std::string secret(const std::string& name, const std::string& content) {
  std::string path = support::write(name, content);
  EXPECT_EQ(::chmod(path.c_str(), 0600), 0);
  return path;
}

/// A key pair in new files of this name.
SigningKey pair(const std::string& name) {
  SigningKey key = SigningKey::generate();
  key.write(path_of(name));
  return key;
}

struct Vector {
  const char* seed;
  const char* key;
  const char* message;
  const char* signature;
};

// RFC 8032, 7.1, TEST 1 to TEST 3.
const Vector vectors[] = {{"9d61b19deffd5a60ba844af492ec2cc44449c5697b326919703bac031cae7f60",
                           "d75a980182b10ab7d54bfed3c964073a0ee172f3daa62325af021a68f707511a", "",
                           "e5564300c360ac729086e2cc806e828a84877f1eb8e5d974d873e065224901555fb8821590a33bacc"
                           "61e39701cf9b46bd25bf5f0595bbe24655"
                           "141438e7a100b"},
                          {"4ccd089b28ff96da9db6c346ec114e0f5b8a319f35aba624da8cf6ed4fb8a6fb",
                           "3d4017c3e843895a92b70aa74d1b7ebc9c982ccf2ec4968cc0cd55f12af4660c", "72",
                           "92a009a9f0d4cab8720e820b5f642540a2b27b5416503f8fb3762223ebdb69da085ac1e43e15996e4"
                           "58f3613d0f11d8c387b2eaeb4302aeeb00"
                           "d291612bb0c00"},
                          {"c5aa8df43f9f837bedb7442f31dcb7b166d38535076f094b85ce3a2e0b4458f7",
                           "fc51cd8e6218a1a38da47ed00230f0580816ed13ba3303ac5deb911548908025", "af82",
                           "6291d657deec24024827e69c3abe01a30ce548a284743a445e3680d7db5ac3ac18ff9b538d16f290a"
                           "e67f760984dc6594a7c15e9716ed28dc02"
                           "7beceea1ec40a"}};

TEST(SigningKeys, AreThoseOfRfc8032) {
  for (const Vector& v : vectors) {
    const auto seed = array_of<std::array<std::uint8_t, 32>>(v.seed);
    const SigningKey key = SigningKey::from_seed(seed);
    EXPECT_EQ(key.public_key(), array_of<PublicKey>(v.key));
    const std::vector<std::uint8_t> message = bytes(v.message);
    const auto signature = array_of<Signature>(v.signature);
    EXPECT_EQ(key.sign(message), signature);
    EXPECT_TRUE(verify(key.public_key(), message, signature));
    for (std::size_t k = 0; k < signature.size(); ++k) {
      Signature altered = signature;
      altered[k] = static_cast<std::uint8_t>(altered[k] ^ 0x20U);
      EXPECT_FALSE(verify(key.public_key(), message, altered)) << k;
    }
    EXPECT_FALSE(verify(key.public_key(), bytes("00"), signature));
    EXPECT_FALSE(verify(SigningKey::generate().public_key(), message, signature));
    EXPECT_FALSE(verify(PublicKey{}, message, signature));
  }
}

TEST(SigningKeys, AreReadAsTheyWereWritten) {
  const SigningKey key = pair("a.key");
  const std::string path = path_of("a.key");
  EXPECT_EQ(SigningKey::read(path).public_key(), key.public_key());
  EXPECT_EQ(read_public_key(path + ".pub"), key.public_key());
  EXPECT_EQ(text(key.id()).size(), 16U);
  EXPECT_NE(key.id(), SigningKey::generate().id());
  struct stat there {};
  ASSERT_EQ(::stat(path.c_str(), &there), 0);
  EXPECT_EQ(there.st_mode & 07777U, 0600U);
  EXPECT_TRUE(read(path).starts_with("-----BEGIN PRIVATE KEY-----\n"));
  EXPECT_TRUE(read(path + ".pub").starts_with("-----BEGIN PUBLIC KEY-----\n"));
}

TEST(SigningKeys, AreNeverWrittenOverAnother) {
  const SigningKey key = pair("old.key");
  const std::string path = path_of("old.key");
  const std::string before = read(path);
  expect_refused([&] { SigningKey::generate().write(path); }, 0, "", {"old.key", "exists"});
  EXPECT_EQ(read(path), before);
  // The public one alone is there: no private one is left behind.
  support::write("new.key.pub", "mine");
  expect_refused([&] { key.write(path_of("new.key")); }, 0, "", {"new.key.pub", "exists"});
  EXPECT_FALSE(std::filesystem::exists(path_of("new.key")));
  EXPECT_EQ(read(path_of("new.key.pub")), "mine");
  std::filesystem::create_symlink(path_of("target"), path_of("link.key"));
  expect_refused([&] { key.write(path_of("link.key")); }, 0, "", {"exists"});
  EXPECT_FALSE(std::filesystem::exists(path_of("target")));
  EXPECT_THROW(key.write(path_of("no/such/folder.key")), std::runtime_error);
}

TEST(SigningKeys, ThatOthersCanReadAreRefused) {
  pair("open.key");
  const std::string path = path_of("open.key");
  for (const unsigned mode : {0640U, 0604U, 0620U, 0666U}) {
    ::chmod(path.c_str(), mode);
    expect_refused([&] { SigningKey::read(path); }, 0, "", {"chmod 600", fmt::format("mode {:03o}", mode)});
  }
  ::chmod(path.c_str(), 0400);
  EXPECT_NO_THROW(SigningKey::read(path));
}

TEST(SigningKeys, OfAnotherKindAreRefusedForWhatTheyAre) {
  pair("k.key");
  const std::string path = path_of("k.key");
  expect_refused([&] { SigningKey::read(path_of("absent.key")); }, 0, "", {"absent.key", "none"});
  expect_refused([&] { SigningKey::read(path + ".pub"); }, 0, "", {"private key", "found a public key"});
  expect_refused([&] { read_public_key(path); }, 0, "", {"public key", "found a private key"});
  const std::string both = read(path) + read(path);
  expect_refused([&] { SigningKey::read(secret("two.key", both)); }, 0, "", {"several"});
  expect_refused([&] { SigningKey::read(secret("cal.yaml", "geometric: []\n")); }, 0, "", {"no PEM"});
  expect_refused([&] { read_public_key(support::write("empty.pub", "")); }, 0, "", {"no PEM"});
  expect_refused([&] { read_public_key(support::write("c.pem", "-----BEGIN CERTIFICATE-----\n")); }, 0, "",
                 {"CERTIFICATE"});
  expect_refused(
      [&] { SigningKey::read(secret("ssh", "-----BEGIN OPENSSH PRIVATE KEY-----\nb3BlbnNzaC1rZXk=\n")); }, 0,
      "", {"OpenSSH"});
  // X25519, by openssl genpkey and openssl pkey -pubout.
  const std::string x25519 =
      "-----BEGIN PRIVATE KEY-----\n"
      "MC4CAQAwBQYDK2VuBCIEIGCfzAzyA/JaiQUO4nSTYmQoB6QDkS3LQ1gLKN+QR7RE\n"
      "-----END PRIVATE KEY-----\n";
  expect_refused([&] { SigningKey::read(secret("x.key", x25519)); }, 0, "", {"Ed25519", "X25519"});
  const std::string x25519_public =
      "-----BEGIN PUBLIC KEY-----\n"
      "MCowBQYDK2VuAyEA8F5ujH3zqxLwmC5h65opx6i+TC0D+o9c4Yz5S1KUOHM=\n"
      "-----END PUBLIC KEY-----\n";
  expect_refused([&] { read_public_key(support::write("x.pub", x25519_public)); }, 0, "",
                 {"Ed25519", "X25519"});
}

TEST(SigningKeys, ThatAreCutOrDamagedAreRefused) {
  const SigningKey key = pair("d.key");
  const std::string whole = read(path_of("d.key"));
  const std::string whole_public = read(path_of("d.key.pub"));
  // Without its last line feed a file is whole.
  for (std::size_t size = 0; size + 1 < whole.size(); ++size)
    EXPECT_THROW(SigningKey::read(secret("cut.key", whole.substr(0, size))), InputError) << size;
  for (std::size_t size = 0; size + 1 < whole_public.size(); ++size)
    EXPECT_THROW(read_public_key(support::write("cut.pub", whole_public.substr(0, size))), InputError)
        << size;
  // An altered character of the 32 bytes of the key, after the 12 that say what they are, makes
  // another key, or none; never this one.
  for (std::size_t k = 27 + 16; k < 85; ++k) {
    std::string altered = whole_public;
    altered[k] = altered[k] == 'A' ? 'B' : 'A';
    try {
      EXPECT_NE(read_public_key(support::write("altered.pub", altered)), key.public_key()) << k;
    } catch (const InputError&) {
    }
  }
}

TEST(SigningKeys, WithAPassphraseAreOpenedByIt) {
  // openssl genpkey -algorithm ED25519 | openssl pkey -aes-128-cbc -passout pass:"open sesame"
  const std::string path = secret("p.key",
                                  "-----BEGIN ENCRYPTED PRIVATE KEY-----\n"
                                  "MIGbMFcGCSqGSIb3DQEFDTBKMCkGCSqGSIb3DQEFDDAcBAjgnkdlSqa7tAICCAAw\n"
                                  "DAYIKoZIhvcNAgkFADAdBglghkgBZQMEAQIEEOft4FzR9XlSQiXzOSw+Ak8EQKg0\n"
                                  "DA39t8CS8c0TlWJkSPLlDN4ISdI7PCQKrJweCejNnNpTiTNfls7gCjzDvRLe3GZY\n"
                                  "+ldrLLO0Rj31SZi6KUE=\n"
                                  "-----END ENCRYPTED PRIVATE KEY-----\n");
  ::setenv("FLEXCOMP_KEY_PASSPHRASE", "open sesame", 1);
  EXPECT_EQ(text(SigningKey::read(path).id()), "243529d743802f42");
  ::setenv("FLEXCOMP_KEY_PASSPHRASE", "open barley", 1);
  expect_refused([&] { SigningKey::read(path); }, 0, "", {"encrypted", "passphrase does not open"});
  ::setenv("FLEXCOMP_KEY_PASSPHRASE", std::string(5000, 'x').c_str(), 1);
  EXPECT_THROW(SigningKey::read(path), InputError);
  ::unsetenv("FLEXCOMP_KEY_PASSPHRASE");
}

}  // namespace signing_keys
