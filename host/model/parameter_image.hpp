// SPDX-License-Identifier: Apache-2.0
/// \file
/// A calibration as the bytes that a controller takes, and back.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "model/calibration.hpp"
#include "model/robot.hpp"

namespace flexcomp::host {

struct ImageOptions {
  bool allow_unnamed = false;       ///< push what was found but not understood
  bool allow_inadmissible = false;  ///< to compare with: what an older controller may hold
};

/// The parameter image of a calibration, bound to the robot, and to its unit where the robot names one. Left out: effects of the measurement
/// (belongs_to_measurement()), and the base where frames were fitted. Instances and tables are numbered in order of
/// appearance, so that image -> calibration file -> image is the identity on bytes.
/// \throws InputError  unnamed effects (unless allowed), base or tool terms above 20 mm or 2 degrees, terms that the
///                     core refuses, a set beyond the limits of admission
std::vector<std::uint8_t> make_image(const Calibration& calibration, const Robot& robot,
                                     std::uint32_t sequence, const ImageOptions& options = {});

/// Effects of a calibration that no image has, because they belong to the measurement and not to the arm: their names.
std::vector<std::string> never_pushed(const Calibration& calibration, const Robot& robot);

/// Who an image is for and who answers for it.
struct ImageRecords {
  Sha256Digest unit_hash{};   ///< of the unit that it is bound to; zeros: any
  bool is_signed = false;     ///< the two below are then given; the signature itself is not verified here
  std::uint64_t counter = 0;  ///< of the signature
  std::array<std::uint8_t, 8> key_id{};  ///< of the key that signed
};

/// Reads unit and signature record of a well-formed image. \throws InputError  what is none
ImageRecords image_records(std::span<const std::uint8_t> image, const std::string& source);

/// The image without its signature record, as it was before it was signed. \throws InputError  what is none
std::vector<std::uint8_t> without_signature(std::span<const std::uint8_t> image, const std::string& source);

/// Reads an image back into named terms. `source` stands for the file in messages (a file or a bus).
/// \throws InputError  truncated, altered, for another robot or unit, or with terms that the catalogue cannot name
Calibration calibration_from_image(std::span<const std::uint8_t> bytes, const Robot& robot,
                                   const std::string& source);

}  // namespace flexcomp::host
