// SPDX-License-Identifier: Apache-2.0
/// \file
/// Texts as files for the readers of the host: they read or refuse, nothing else.
#pragma once

#include <sys/mman.h>
#include <unistd.h>

#include <exception>
#include <fstream>
#include <initializer_list>
#include <iterator>
#include <typeinfo>

#include "errors.hpp"
#include "files/robot_file.hpp"
#include "flexcomp/crc32.hpp"
#include "fuzz.hpp"
#include "input_error.hpp"

namespace fuzz {

/// A file in memory: opened by its path as often as one likes, gone with the program.
class MemoryFile {
 public:
  MemoryFile() : descriptor_(::memfd_create("fuzz", 0)) { require(descriptor_ >= 0, "no memory file"); }
  MemoryFile(const MemoryFile&) = delete;
  MemoryFile& operator=(const MemoryFile&) = delete;
  ~MemoryFile() { ::close(descriptor_); }

  /// Its path, with this content.
  std::string with(const std::string& content) const {
    require(::ftruncate(descriptor_, 0) == 0 && ::pwrite(descriptor_, content.data(), content.size(), 0) ==
                                                    static_cast<ssize_t>(content.size()),
            "a memory file cannot be written");
    return "/proc/self/fd/" + std::to_string(descriptor_);
  }

 private:
  int descriptor_;
};

/// The path of a file with this text; there are two.
inline std::string path_of(const std::string& text, std::size_t which = 0) {
  static const MemoryFile files[2];
  return files[which].with(text);
}

/// True where `read` did not refuse. Any other exception than those of the project is a finding.
template <class Read>
bool reads(const Read& read) {
  try {
    read();
    return true;
  } catch (const flexcomp::host::InputError&) {
  } catch (const flexcomp::host::BusError&) {
  } catch (const std::exception& e) {
    finding(std::string("threw ") + typeid(e).name() + ": " + e.what());
  }
  return false;
}

/// What was written by the project itself must be read.
template <class Read>
void must_read(const std::string& text, const Read& read) {
  try {
    read();
  } catch (const std::exception& e) {
    finding(std::string("what was written is not read again: ") + e.what() + "\n" + text);
  }
}

inline void require_same(const std::string& first, const std::string& second, const char* what) {
  if (first != second)
    finding(std::string(what) + " differs when it is read and written again:\n" + first + "\n---\n" + second);
}

/// A file of the repository.
inline std::string file_of(const std::string& path) {
  std::ifstream stream(FLEXCOMP_SOURCE_DIR "/" + path, std::ios::binary);
  if (!stream) finding("cannot read " + path);
  return {std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>()};
}

inline const flexcomp::host::Robot& irb120() {
  static const flexcomp::host::Robot robot =
      flexcomp::host::parse_robot(file_of("host/robots/abb-irb120.yaml"), "abb-irb120.yaml");
  return robot;
}

inline const flexcomp::host::Robot& tx60l() {
  static const flexcomp::host::Robot robot =
      flexcomp::host::parse_robot(file_of("host/robots/tx60l.yaml"), "tx60l.yaml");
  return robot;
}

/// Byte, then text: what most readers with options take.
inline Bytes with_options(std::initializer_list<unsigned> options, const std::string& text) {
  Output out;
  for (const unsigned o : options) out.u8(o);
  return out.add(bytes_of(text)).out;
}

/// What takes a hundred times as long as reading is done for one text in 256: that whose second byte is this one.
inline unsigned ticket(const std::string& text) {
  return flexcomp::crc32(reinterpret_cast<const std::uint8_t*>(text.data()), text.size()) & 0xFFU;
}
inline Bytes ticket_seed(unsigned what, const std::string& text) {
  return with_options({what, ticket(text)}, text);
}

/// Mutations with words of a format.
template <const auto& words>
std::size_t mutate_words(std::uint8_t* data, std::size_t size, std::size_t capacity, unsigned seed) {
  return mutate_with(words, sizeof words / sizeof words[0], data, size, capacity, seed);
}

inline constexpr const char* yaml_words[] = {"\n",         "  ",
                                             "- ",         ": ",
                                             "{",          "}",
                                             "[",          "]",
                                             "#",          "&a ",
                                             "*a",         "!!str ",
                                             "|\n",        ">\n",
                                             "'",          "\"",
                                             "? ",         "---\n",
                                             "...\n",      "<<: ",
                                             ".nan",       ".inf",
                                             "1e999",      "-0",
                                             "1e-320",     "0x10",
                                             "1_000",      "~",
                                             "null",       "true",
                                             "name: ",     "joints:",
                                             "links: ",    "terms:",
                                             "of: ",       "effect:",
                                             "frames",     "_deg: ",
                                             "_mm:",       "joint: ",
                                             "link: ",     "\xEF\xBB\xBF",
                                             "\xFF",       "9007199254740993",
                                             "per_k:",     "tool",
                                             "base:",      "limits",
                                             "payload:",   "grid",
                                             "reflectors", "noise",
                                             "capsules"};

}  // namespace fuzz
