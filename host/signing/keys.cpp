// SPDX-License-Identifier: Apache-2.0
#include "signing/keys.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <openssl/bio.h>
#include <openssl/crypto.h>
#include <openssl/err.h>
#include <openssl/evp.h>
#include <openssl/pem.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <stdexcept>
#include <string_view>
#include <utility>

#include "files/read_file.hpp"
#include "input_error.hpp"

namespace flexcomp::host {

namespace {

constexpr const char* passphrase_variable = "FLEXCOMP_KEY_PASSPHRASE";

struct FreeBio {
  void operator()(BIO* bio) const { BIO_free_all(bio); }
};
using Bio = std::unique_ptr<BIO, FreeBio>;
struct FreeContext {
  void operator()(EVP_MD_CTX* context) const { EVP_MD_CTX_free(context); }
};
using Key = std::unique_ptr<EVP_PKEY, FreeKey>;
using Context = std::unique_ptr<EVP_MD_CTX, FreeContext>;

/// The reason of OpenSSL's last error, which is taken off its queue.
std::string last_error() {
  const unsigned long code = ERR_peek_last_error();
  ERR_clear_error();
  const char* reason = code == 0 ? nullptr : ERR_reason_error_string(code);
  return reason == nullptr ? "no reason is told" : reason;
}

[[noreturn]] void fail(const std::string& what) {
  throw std::runtime_error(fmt::format("{}: {}", what, last_error()));
}

/// What became of the question for a passphrase.
struct Passphrase {
  bool wanted = false;
  bool given = false;
};

/// OpenSSL's callback (pem_password_cb). Its own reads standard input where there is no terminal, and would wait there.
int give_passphrase(char* to, int size, int for_writing, void* user) {
  auto& passphrase = *static_cast<Passphrase*>(user);
  passphrase.wanted = true;
  if (const char* variable = std::getenv(passphrase_variable)) {
    const std::string_view known(variable);
    if (known.size() > static_cast<std::size_t>(size)) return -1;
    passphrase.given = true;
    std::copy(known.begin(), known.end(), to);
    return static_cast<int>(known.size());
  }
  const int terminal = ::open("/dev/tty", O_RDWR | O_CLOEXEC | O_NOCTTY);
  if (terminal < 0) return -1;
  ::close(terminal);
  passphrase.given = true;
  return PEM_def_callback(to, size, for_writing, nullptr);
}

/// What the first line of a PEM block says that it is; empty where there is none.
std::string_view pem_label(std::string_view pem) {
  constexpr std::string_view begin = "-----BEGIN ";
  const std::size_t at = pem.find(begin);
  if (at == std::string_view::npos) return {};
  const std::size_t from = at + begin.size();
  const std::size_t end = pem.find("-----", from);
  return end == std::string_view::npos ? std::string_view{} : pem.substr(from, end - from);
}

bool has_several(std::string_view pem) {
  const std::size_t first = pem.find("-----BEGIN ");
  return first != std::string_view::npos && pem.find("-----BEGIN ", first + 1) != std::string_view::npos;
}

/// Reads a file that holds one key, of which `is_wanted` knows the label. \throws InputError
std::string pem_of(const std::string& path, const std::string& expected, bool is_private) {
  std::string pem = read_file(path);
  const std::string_view label = pem_label(pem);
  const auto refuse = [&](const std::string& found) {
    OPENSSL_cleanse(pem.data(), pem.size());
    throw InputError(path, 0, "", expected, found);
  };
  if (label.empty()) refuse("no PEM");
  if (label == "OPENSSH PRIVATE KEY") refuse("a key of OpenSSH, which has a format of its own");
  const bool found_private = label.ends_with("PRIVATE KEY");
  const bool found_public = label.ends_with("PUBLIC KEY");
  if (!found_private && !found_public) refuse(fmt::format("PEM of something else ({})", label));
  if (is_private && !found_private) refuse("a public key");
  if (!is_private && found_private)
    refuse("a private key, which is kept secret: give the file with its public key");
  if (has_several(pem)) refuse("several");
  return pem;
}

void require_ed25519(EVP_PKEY* key, const std::string& path, const std::string& expected) {
  if (EVP_PKEY_get_id(key) == EVP_PKEY_ED25519) return;
  const char* type = EVP_PKEY_get0_type_name(key);
  throw InputError(path, 0, "", expected, fmt::format("one of {}", type == nullptr ? "another kind" : type));
}

PublicKey public_key_of(EVP_PKEY* key) {
  PublicKey out{};
  std::size_t size = out.size();
  if (EVP_PKEY_get_raw_public_key(key, out.data(), &size) != 1 || size != out.size()) fail("a public key");
  return out;
}

/// As ssh has it: a secret that others can read is none. Pipes and what is not ours have no mode of ours.
void require_secret(const std::string& path, const std::string& expected) {
  struct stat there {};
  if (::stat(path.c_str(), &there) != 0 || !S_ISREG(there.st_mode) || there.st_uid != ::geteuid()) return;
  if ((there.st_mode & 077U) == 0) return;
  throw InputError(path, 0, "", expected + " that only its owner may read and write (chmod 600)",
                   fmt::format("mode {:03o}", there.st_mode & 0777U));
}

/// A file that did not exist before, and does not afterwards unless keep() was called.
class NewFile {
 public:
  NewFile(std::string path, mode_t mode)
      : path_(std::move(path)), file_(::open(path_.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, mode)) {
    if (file_ >= 0) return;
    if (errno == EEXIST)
      throw InputError(path_, 0, "", "a new file", "one that exists; a key is never written over another");
    fail_to_write(errno);
  }
  NewFile(const NewFile&) = delete;
  NewFile& operator=(const NewFile&) = delete;
  ~NewFile() {
    ::close(file_);
    if (!keep_) ::unlink(path_.c_str());
  }
  void write(std::string_view content) {
    while (!content.empty()) {
      const ssize_t n = ::write(file_, content.data(), content.size());
      if (n < 0 && errno == EINTR) continue;
      if (n <= 0) fail_to_write(errno);
      content.remove_prefix(static_cast<std::size_t>(n));
    }
    if (::fsync(file_) != 0) fail_to_write(errno);
  }
  void keep() { keep_ = true; }

 private:
  [[noreturn]] void fail_to_write(int error) const {
    throw std::runtime_error(path_ + ": cannot be written: " + std::strerror(error));
  }

  std::string path_;
  int file_;
  bool keep_ = false;
};

std::string_view content_of(const Bio& bio) {
  char* data = nullptr;
  const long size = BIO_get_mem_data(bio.get(), &data);
  return {data, static_cast<std::size_t>(size)};
}

}  // namespace

std::string text(const KeyId& id) {
  std::string out;
  for (const std::uint8_t byte : id) out += fmt::format("{:02x}", byte);
  return out;
}

void FreeKey::operator()(evp_pkey_st* key) const { EVP_PKEY_free(key); }

SigningKey::SigningKey(evp_pkey_st* key) : key_(key) {
  if (!key_) fail("a key could not be made");
  public_key_ = public_key_of(key);
}

SigningKey SigningKey::generate() { return SigningKey(EVP_PKEY_Q_keygen(nullptr, nullptr, "ED25519")); }

SigningKey SigningKey::from_seed(std::span<const std::uint8_t, 32> seed) {
  return SigningKey(EVP_PKEY_new_raw_private_key(EVP_PKEY_ED25519, nullptr, seed.data(), seed.size()));
}

SigningKey SigningKey::read(const std::string& path) {
  const std::string expected = "an Ed25519 private key in PEM";
  std::string pem = pem_of(path, expected, true);
  require_secret(path, expected);
  Passphrase passphrase;
  Key key;
  {
    // Its own memory is cleansed when it is freed.
    const Bio bio(BIO_new(BIO_s_secmem()));
    BIO_write(bio.get(), pem.data(), static_cast<int>(pem.size()));
    OPENSSL_cleanse(pem.data(), pem.size());
    key.reset(PEM_read_bio_PrivateKey(bio.get(), nullptr, give_passphrase, &passphrase));
  }
  if (!key) {
    const std::string why = last_error();
    if (passphrase.wanted) {
      throw InputError(path, 0, "", expected,
                       passphrase.given
                           ? "an encrypted one that this passphrase does not open"
                           : fmt::format("an encrypted one, and neither the environment variable {} nor a "
                                         "terminal to ask for its passphrase",
                                         passphrase_variable));
    }
    throw InputError(path, 0, "", expected, fmt::format("a damaged one ({})", why));
  }
  require_ed25519(key.get(), path, expected);
  return SigningKey(key.release());
}

void SigningKey::write(const std::string& path) const {
  constexpr mode_t owner_only = 0600;
  constexpr mode_t readable = 0644;
  NewFile secret(path, owner_only);
  NewFile open(path + ".pub", readable);
  const Bio of_secret(BIO_new(BIO_s_secmem()));
  const Bio of_open(BIO_new(BIO_s_mem()));
  if (PEM_write_bio_PKCS8PrivateKey(of_secret.get(), key_.get(), nullptr, nullptr, 0, nullptr, nullptr) !=
          1 ||
      PEM_write_bio_PUBKEY(of_open.get(), key_.get()) != 1) {
    fail(path);
  }
  secret.write(content_of(of_secret));
  open.write(content_of(of_open));
  secret.keep();
  open.keep();
}

Signature SigningKey::sign(std::span<const std::uint8_t> message) const {
  const Context context(EVP_MD_CTX_new());
  Signature out{};
  std::size_t size = out.size();
  if (!context || EVP_DigestSignInit(context.get(), nullptr, nullptr, nullptr, key_.get()) != 1 ||
      EVP_DigestSign(context.get(), out.data(), &size, message.data(), message.size()) != 1 ||
      size != out.size()) {
    fail("a signature could not be made");
  }
  return out;
}

PublicKey read_public_key(const std::string& path) {
  const std::string expected = "an Ed25519 public key in PEM";
  const std::string pem = pem_of(path, expected, false);
  const Bio bio(BIO_new_mem_buf(pem.data(), static_cast<int>(pem.size())));
  const Key key(PEM_read_bio_PUBKEY(bio.get(), nullptr, nullptr, nullptr));
  if (!key) throw InputError(path, 0, "", expected, fmt::format("a damaged one ({})", last_error()));
  require_ed25519(key.get(), path, expected);
  return public_key_of(key.get());
}

bool verify(const PublicKey& key, std::span<const std::uint8_t> message, const Signature& signature) {
  const Key held(EVP_PKEY_new_raw_public_key(EVP_PKEY_ED25519, nullptr, key.data(), key.size()));
  const Context context(EVP_MD_CTX_new());
  const bool good =
      held && context && EVP_DigestVerifyInit(context.get(), nullptr, nullptr, nullptr, held.get()) == 1 &&
      EVP_DigestVerify(context.get(), signature.data(), signature.size(), message.data(), message.size()) ==
          1;
  ERR_clear_error();
  return good;
}

}  // namespace flexcomp::host
