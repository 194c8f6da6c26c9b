// SPDX-License-Identifier: Apache-2.0
/// \file
/// XML documents as trees of elements with their places in the text, parsed by libexpat.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

#include "exchange/text_edits.hpp"

namespace flexcomp::host {

struct XmlAttribute {
  std::string name;
  std::string value;  ///< UTF-8, character references resolved
  TextSpan span;      ///< as written, between the quotes
};

struct XmlElement {
  std::string name;  ///< with its namespace prefix, as written
  std::size_t line = 0;
  TextSpan start_tag;       ///< from < to behind >
  std::size_t end_tag = 0;  ///< where </ begins; behind the start tag of <x/>
  std::vector<XmlAttribute> attributes;
  std::vector<XmlElement> children;

  const XmlAttribute* attribute(std::string_view wanted) const;  ///< null where there is none
  const XmlElement* child(std::string_view wanted) const;        ///< the first; null where there is none
};

/// Elements within each other. URDF and VAL 3 need a tenth.
constexpr std::size_t deepest_element = 64;

/// The root element of XML 1.0 in UTF-8, ISO 8859-1 or US-ASCII. Time and memory grow linearly with the text: a document type
/// declaration is refused, thus no entity but the five of XML is ever expanded.
/// \throws InputError  path:line: not well-formed; a wrong encoding or NUL (as in UTF-16); a document type declaration;
///                     deeper than deepest_element; 2 GiB or more
XmlElement parse_xml(const std::string& path, const std::string& text);

}  // namespace flexcomp::host
