// SPDX-License-Identifier: Apache-2.0
/// \file
/// HTML in parts: escaped text, tables, figures. All take plain text and escape it, unless they say otherwise.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

namespace flexcomp::host {

/// Text from files and users made safe for element content and attributes.
std::string escaped(std::string_view text);

/// \return empty where there is no drawing
std::string figure(const std::string& svg, const std::string& caption);

/// \param body  HTML
std::string section(const std::string& title, const std::string& body);
std::string paragraph(const std::string& text);

/// Names as <code>, separated by commas.
std::string code_list(const std::vector<std::string>& names);

using Cells = std::vector<std::string>;

/// A table whose first column names its rows. Columns of numbers are aligned to the right, text to the left; long text
/// may take several lines.
/// \param kind  its class, or empty
/// \param pale  which rows are pale, or empty
/// \return empty without columns
std::string table(const Cells& columns, const std::vector<Cells>& rows, const std::string& kind = "",
                  const std::vector<bool>& pale = {});

}  // namespace flexcomp::host
