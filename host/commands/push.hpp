// SPDX-License-Identifier: Apache-2.0
/// \file
/// Options of push, which the sending and the dry run share.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "bus/controller_client.hpp"
#include "commands/bus_options.hpp"
#include "commands/key_options.hpp"
#include "commands/outcome.hpp"

namespace flexcomp::host {

/// A set as bytes, before it is signed.
struct MadeSet {
  Bytes bytes;
  std::string serial;                 ///< of the unit that it is bound to; empty where it is not known
  std::vector<std::string> left_out;  ///< effects that belong to the measurement
};

struct Push {
  BusOptions bus;
  KeyOptions signing;
  std::string set;
  std::string robot;
  std::string image;
  std::optional<std::uint32_t> sequence;
  std::optional<double> trial_s;
  bool confirm = false;
  bool allow_unnamed = false;
  bool dry_run = false;
  bool resume = false;
  std::string against;
  const CLI::Option* to = nullptr;

  void run() const;
  void send(OutcomeTask& task, const std::optional<Bytes>& ready, const SigningKey* signer) const;
  void say_active(OutcomeTask& task, const wire::Status& now, std::size_t bytes, bool sent,
                  double seconds) const;
  /// The file's set with this number, by default the next one: `ready` where the file is an image.
  MadeSet make(ControllerClient& client, const std::optional<Bytes>& ready,
               std::optional<std::uint32_t> number) const;
  /// Reads the file where it is an image, and the key. \throws InputError  also where a set that is to be signed names no unit
  std::pair<std::optional<Bytes>, std::optional<SigningKey>> read_files() const;
  /// The bytes that go out, signed where there is a key, and what is known of who is asked for in `result`.
  /// \throws BusError  this controller would not take them: nothing was sent
  Bytes authorised(ControllerClient& client, const MadeSet& made, const SigningKey* signer,
                   Json& result) const;
  /// The status in which the set is active, whoever signed it.
  std::optional<wire::Status> found_active(ControllerClient& client, const Bytes& bytes) const;
  void say_signed(const Json& result) const;
  void show_changes() const;
  void check_options() const;
  void say_left_out(const std::vector<std::string>& names) const;
};

}  // namespace flexcomp::host
