// SPDX-License-Identifier: Apache-2.0
/// \file
/// A parameter set on its way into a controller and out of it.
#ifndef FLEXCOMP_HOST_BUS_TRANSFER_HPP
#define FLEXCOMP_HOST_BUS_TRANSFER_HPP

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

/// What this controller could not do with a well-formed image, each a sentence without a full stop; empty where
/// nothing stands against sending it. Who the image is for is not looked at.
std::vector<std::string> beyond_capability(const wire::Capability& capability,
                                           std::span<const std::uint8_t> image);

/// \throws BusError  naming what of the image of `source` is beyond_capability()
void refuse_beyond_capability(const ControllerClient& client, const std::string& source,
                              std::span<const std::uint8_t> image);

/// One more than the newest set that the controller has. \throws BusError where there is no higher number
std::uint32_t next_sequence(ControllerClient& client);

struct PushOptions {
  std::optional<std::uint32_t> trial_cycles;  ///< on trial; 0: as long as the controller is configured
  Progress progress;
};

/// Stages, verifies, commits, reads back and compares byte for byte. Whatever is refused or fails before the commit
/// leaves the controller as it was.
void push_image(ControllerClient& client, std::span<const std::uint8_t> image,
                const PushOptions& options = {});

/// The robot that a set is made for or read for: of a file where one is given (it must be the controller's), else as
/// the controller tells it. \throws BusError where it is another one, or where neither says
Robot robot_of(ControllerClient& client, const std::string& robot_path);

/// Reads a calibration that is meant for this controller. \throws BusError where the file names another robot or
/// geometry than the controller's, InputError as load_calibration()
Calibration load_calibration_for(ControllerClient& client, const std::string& path, const Robot& robot);

/// The active set. \throws BusError where there is none or its bytes are damaged
Bytes pull_image(ControllerClient& client, const Progress& progress = {});

/// The terms of an image that a controller holds. \throws BusError where they cannot be named
Calibration calibration_held(const ControllerClient& client, std::span<const std::uint8_t> image,
                             const Robot& robot);

/// The bytes of a file if they are a parameter image, which begins with "FLXC". \throws InputError
std::optional<Bytes> read_image_file(const std::string& path);

}  // namespace flexcomp::host

#endif
