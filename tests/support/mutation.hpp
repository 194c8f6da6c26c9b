// SPDX-License-Identifier: Apache-2.0
/// \file
/// Good texts made bad at random: a reader takes them or refuses them, and nothing else happens.
#pragma once

#include <gtest/gtest.h>

#include <cstddef>
#include <exception>
#include <random>
#include <string>
#include <typeinfo>

#include "input_error.hpp"

namespace support {

struct Mutations {
  int rounds = 0;
  std::string bytes;         ///< of which one replaces another; empty: any
  std::size_t longest = 12;  ///< piece that is removed or doubled
};

/// Up to three places changed: a byte replaced, a piece removed or doubled elsewhere, or the rest cut off.
inline std::string mutated(std::string text, const Mutations& how, std::mt19937_64& random) {
  const std::size_t changes = 1 + random() % 3;
  for (std::size_t k = 0; k < changes && !text.empty(); ++k) {
    const std::size_t at = random() % text.size();
    const std::size_t length = 1 + random() % how.longest;
    switch (random() % 4) {
      case 0:
        text[at] =
            how.bytes.empty() ? static_cast<char>(random() % 256) : how.bytes[random() % how.bytes.size()];
        break;
      case 1:
        text.erase(at, length);
        break;
      case 2:
        text.insert(at, text.substr(random() % text.size(), length));
        break;
      default:
        text.resize(at);
    }
  }
  return text;
}

/// How many mutations `read` refuses with an InputError. The test fails where it throws anything else.
template <class Read>
int refused_mutations(const std::string& good, const Mutations& how, const Read& read) {
  std::mt19937_64 random(1);
  int refused = 0;
  for (int k = 0; k < how.rounds; ++k) {
    const std::string text = mutated(good, how, random);
    try {
      read(text);
    } catch (const flexcomp::host::InputError&) {
      ++refused;
    } catch (const std::exception& e) {
      ADD_FAILURE() << "threw " << typeid(e).name() << ": " << e.what() << "\n" << text;
    }
  }
  return refused;
}

}  // namespace support
