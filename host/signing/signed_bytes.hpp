// SPDX-License-Identifier: Apache-2.0
/// \file
/// Signed sets and commands as bytes (flexcomp/signature.hpp), and the counter that lets none be used twice.
#pragma once

#include <chrono>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "signing/keys.hpp"

namespace flexcomp::host {

/// The image with a signature record; one that it has is replaced. `source` stands for it in messages.
/// \throws InputError  what is no image
std::vector<std::uint8_t> sign_image(std::span<const std::uint8_t> image, const SigningKey& key,
                                     std::uint64_t counter, const std::string& source);

/// Whether an image has a signature of this key that belongs to its bytes.
bool is_signed_by(std::span<const std::uint8_t> image, const PublicKey& key);

/// A command that this key permits once. The id of the key is filled in.
std::vector<std::uint8_t> sign_command(SignedCommand command, const SigningKey& key);

/// Whether a command has a signature of this key that belongs to its bytes.
bool is_command_signed_by(std::span<const std::uint8_t> command, const PublicKey& key);

/// How far a controller's counter may be ahead of this computer's clock. One that is farther ahead was forged, or one of the two
/// clocks was wrong; to go on from there would use up the numbers of all who come after.
constexpr std::chrono::milliseconds counter_ahead = std::chrono::hours(24);

/// Whether a counter that a controller tells may be gone on from.
bool is_plausible_counter(std::uint64_t accepted, std::chrono::system_clock::time_point now);

/// The next counter: Unix time in ms, or one above the highest that was accepted, whichever is more. 0: there is none any more.
std::uint64_t next_counter(std::uint64_t accepted, std::chrono::system_clock::time_point now);

}  // namespace flexcomp::host
