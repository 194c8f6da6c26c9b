// SPDX-License-Identifier: Apache-2.0
/// \file
/// Numbers as a page shows them.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <utility>

namespace flexcomp::host {

/// Three significant digits and at most five decimals; "< 0.00001" instead of a zero that is none.
std::string number_text(double v);
/// A length in mm, µm or nm.
std::string length_text(double mm);
/// "2.5 × smaller".
/// \param exact  the fit had no degree of freedom left: "–"
std::string change_text(double before, double after, bool exact = false);
/// Millimetres of a length, to the tenth of a micrometre.
std::string mm_text(double metres);
/// The unit that a parameter's name ends with.
std::string unit_of_name(std::string_view name);
/// A value and its standard deviation, both to the second digit of that; small numbers with a power of ten.
std::pair<std::string, std::string> with_uncertainty(double value, const std::optional<double>& sigma);

}  // namespace flexcomp::host
