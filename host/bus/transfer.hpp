// SPDX-License-Identifier: Apache-2.0
/// \file
/// Transfer of parameter sets to and from a controller.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "bus/controller_client.hpp"
#include "files/calibration_file.hpp"
#include "flexcomp/wire/store_state.hpp"
#include "model/robot.hpp"

namespace flexcomp::host {

/// Compares what an image of `source` requires (schema, bases, capacities) with the controller's capability.
/// \throws BusError  naming what the controller does not have
void refuse_beyond_capability(const ControllerClient& client, const std::string& source,
                              std::span<const std::uint8_t> image);

/// Verifies that a controller is the unit that an image is bound to, and can verify it itself. \param there  its unit()
/// \param serial  of the image's unit, for messages; empty where it is not known \throws BusError
void refuse_other_unit(const ControllerClient& client, const std::optional<ControllerUnit>& there,
                       const std::string& source, const Sha256Digest& unit_hash, const std::string& serial);

/// Next sequence number: one above the newest set of the controller; 1 after 2^32 - 1. \throws BusError
std::uint32_t next_sequence(ControllerClient& client);

struct PushOptions {
  std::optional<std::uint32_t> trial_cycles;  ///< commit on trial; 0: the controller's default
  Progress progress;
};

/// A parameter image as a controller's status tells it.
struct SetIdentity {
  std::uint32_t sequence = 0;
  std::uint32_t crc = 0;
  std::uint32_t bytes = 0;

  bool is_active(const wire::Status& status) const;
};

/// Reads sequence number and CRC from an image, whatever else is wrong with it.
SetIdentity identity(std::span<const std::uint8_t> image);

/// Stages, verifies and commits an image, reads it back and compares all bytes. Returns the status in which it is active.
/// \throws BusError  it is not active and does not become so: the controller's sets are as they were
/// \throws OutcomeOpen  after the commit, where this cannot be told now
wire::Status push_image(ControllerClient& client, std::span<const std::uint8_t> image,
                        const PushOptions& options = {});

/// Whether the active set is this image, by its identity in the status and by all bytes read back. Returns the status in which
/// it is; nothing where another set, or none, is active. Waits for a store that is working. \throws OutcomeOpen where this
/// cannot be told now
std::optional<wire::Status> read_back(ControllerClient& client, std::span<const std::uint8_t> image,
                                      const Progress& progress = {});

/// Makes the set on trial permanent; returns the status in which it is. Throws as push_image().
wire::Status confirm_trial(ControllerClient& client);

/// Returns to the set before; returns the status then. Throws as push_image().
wire::Status roll_back(ControllerClient& client);

/// Erases both sets; returns the status in which none is active. Throws as push_image().
wire::Status erase(ControllerClient& client);

/// Stages an image or a signed command and lets the controller verify it; on a refusal nothing stays staged. \throws BusError
void stage_verified(ControllerClient& client, std::span<const std::uint8_t> bytes,
                    const Progress& progress = {});

/// Lets the next rollback or erase of this connection pass where no key is trusted. \throws BusError
void unlock(ControllerClient& client);

/// Nominal robot of a controller: from `robot_path`, verified by the controller's hashes, or from its robot record.
/// \throws BusError  another robot or geometry; no path given and no robot record
/// \throws InputError  as load_robot()
Robot robot_of(ControllerClient& client, const std::string& robot_path);

/// Reads a calibration file and verifies its robot and nominal hash against the controller's.
/// \throws BusError  another robot or geometry
/// \throws InputError  as load_calibration()
Calibration load_calibration_for(ControllerClient& client, const std::string& path, const Robot& robot);

/// Reads and checks the active image. \throws BusError  none active, or damaged bytes
Bytes pull_image(ControllerClient& client, const Progress& progress = {});

/// The terms of an image that a controller holds. \throws BusError where they cannot be named
Calibration calibration_held(const ControllerClient& client, std::span<const std::uint8_t> image,
                             const Robot& robot);

/// Reads a parameter image, a file that begins with "FLXC"; nothing for other files. \throws InputError
std::optional<Bytes> read_image_file(const std::string& path);

}  // namespace flexcomp::host
