// SPDX-License-Identifier: Apache-2.0
#include "report/html.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <utility>

#include "utf8.hpp"

namespace flexcomp::host {
namespace {

constexpr std::array<std::pair<char, const char*>, 5> entities{
    {{'&', "&amp;"}, {'<', "&lt;"}, {'>', "&gt;"}, {'"', "&quot;"}, {'\'', "&#39;"}}};

bool is_number(const std::string& cell) {
  return cell.empty() || cell.starts_with("–") ||
         std::string_view("0123456789+-.<>").find(cell[0]) != std::string_view::npos;
}

bool is_long(const std::string& cell) { return cell.size() > 40; }

std::string class_attribute(const std::string& name) {
  return name.empty() ? "" : fmt::format(" class=\"{}\"", name);
}

}  // namespace

std::string escaped(std::string_view text) {
  std::string out;
  out.reserve(text.size());
  for (std::size_t at = 0; at < text.size();) {
    const std::size_t bytes = utf8_length(text.substr(at));
    if (bytes != 1) {
      out += bytes == 0 ? std::string_view("\xEF\xBF\xBD") : text.substr(at, bytes);  // U+FFFD
      at += std::max<std::size_t>(bytes, 1);
      continue;
    }
    const char c = text[at++];
    const auto entity = std::ranges::find_if(entities, [&](const auto& e) { return e.first == c; });
    // Control characters are not allowed in HTML at all, whatever they would mean.
    const bool control = (static_cast<unsigned char>(c) < 0x20 && c != '\n' && c != '\t') || c == 0x7F;
    if (entity != entities.end()) {
      out += entity->second;
    } else {
      out += control ? ' ' : c;
    }
  }
  return out;
}

std::string figure(const std::string& svg, const std::string& caption) {
  if (svg.empty()) return "";  // nothing to draw
  return fmt::format("<figure>{}<figcaption>{}</figcaption></figure>\n", svg, escaped(caption));
}

std::string code_list(const std::vector<std::string>& names) {
  std::string out;
  for (const std::string& name : names) {
    out += fmt::format("{}<code>{}</code>", out.empty() ? "" : ", ", escaped(name));
  }
  return out;
}

std::string section(const std::string& title, const std::string& body) {
  return fmt::format("<section><h2>{}</h2>\n{}</section>\n", escaped(title), body);
}

std::string paragraph(const std::string& text) { return fmt::format("<p>{}</p>\n", escaped(text)); }

std::string table(const Cells& columns, const std::vector<Cells>& rows, const std::string& kind,
                  const std::vector<bool>& pale) {
  if (columns.empty()) return "";
  std::vector<std::string> classes(columns.size());
  for (const Cells& row : rows) {
    for (std::size_t k = 1; k < std::min(row.size(), classes.size()); ++k) {
      if (!is_number(row[k]) && classes[k].empty()) classes[k] = "text";
      if (is_long(row[k])) classes[k] = "text long";
    }
  }
  std::string out = fmt::format("<div class=\"scroll\"><table{}><thead><tr>", class_attribute(kind));
  for (std::size_t k = 0; k < columns.size(); ++k)
    out += fmt::format("<th scope=\"col\"{}>{}</th>", class_attribute(classes[k]), escaped(columns[k]));
  out += "</tr></thead><tbody>\n";
  for (std::size_t n = 0; n < rows.size(); ++n) {
    out += fmt::format("<tr{}>", class_attribute(n < pale.size() && pale[n] ? "pale" : ""));
    for (std::size_t k = 0; k < rows[n].size(); ++k) {
      const std::string& cell = rows[n][k];
      out += k == 0 ? fmt::format("<th scope=\"row\"{}>{}</th>", class_attribute(is_long(cell) ? "long" : ""),
                                  escaped(cell))
                    : fmt::format("<td{}>{}</td>", class_attribute(k < classes.size() ? classes[k] : ""),
                                  escaped(cell));
    }
    out += "</tr>\n";
  }
  return out + "</tbody></table></div>\n";
}

}  // namespace flexcomp::host
