// SPDX-License-Identifier: Apache-2.0
// XML of other programs: places in the text are those of its bytes, and what would cost more time or memory than the text is
// long is refused.
#include "exchange/xml.hpp"

#include <gtest/gtest.h>

#include <ctime>
#include <string>
#include <vector>

#include "support/text_file.hpp"

namespace {

using namespace flexcomp::host;
using support::expect_refused;

std::string at(const std::string& text, const TextSpan& span) {
  return text.substr(span.begin, span.end - span.begin);
}

void refused(const std::string& text, std::size_t line, const std::vector<std::string>& parts) {
  expect_refused([&] { parse_xml("x.xml", text); }, line, "", parts);
}

TEST(Xml, PlacesAreThoseOfTheBytes) {
  // With a byte order mark, and with text outside of ASCII in both encodings.
  for (const std::string begin : {"\xEF\xBB\xBF<?xml version='1.0'?><!-- \xC3\xA4 -->\n",
                                  "<?xml version='1.0' encoding='iso-8859-1'?><!-- \xE4 -->\n"}) {
    const std::string text =
        begin +
        "<a b=\"\xC3\xA4>\" e = 'x=\"y\"&#x26;&lt;'\n c=''>\r\n<![CDATA[<d/>]]><d e=\"2\"/>"
        "<!-- <d/> --><n:f></n:f></a>\n";
    const XmlElement a = parse_xml("x.xml", text);
    EXPECT_EQ(a.name, "a");
    EXPECT_EQ(a.line, 2U);
    ASSERT_EQ(a.attributes.size(), 3U);
    EXPECT_EQ(at(text, a.attribute("b")->span), "\xC3\xA4>");
    EXPECT_EQ(a.attributes[1].value, "x=\"y\"&<");
    EXPECT_EQ(at(text, a.attributes[1].span), "x=\"y\"&#x26;&lt;");
    EXPECT_EQ(at(text, a.attribute("c")->span), "");
    EXPECT_EQ(a.attribute("d"), nullptr);
    ASSERT_EQ(a.children.size(), 2U);
    const XmlElement& d = *a.child("d");
    EXPECT_EQ(d.line, 4U);
    EXPECT_EQ(at(text, d.start_tag), "<d e=\"2\"/>");
    EXPECT_EQ(d.end_tag, d.start_tag.end);
    EXPECT_EQ(text.substr(a.child("n:f")->end_tag, 6), "</n:f>");
    EXPECT_EQ(text.substr(a.end_tag), "</a>\n");
    EXPECT_EQ(at(text, a.start_tag).back(), '>');
  }
}

TEST(Xml, WhatIsNotWellFormedIsRefusedInItsLine) {
  refused("", 1, {"XML", "no element"});
  refused("x", 1, {"XML"});
  refused("<a>\n<b>\n</a>", 3, {"XML", "mismatched tag"});
  refused("<a>\n<b c='1' c='2'/></a>", 2, {"duplicate attribute"});
  refused("<a>\n<!-- ", 2, {"unclosed"});
  refused("<a/>\n<b/>", 2, {"XML"});
  refused("<a>\n&b;</a>", 2, {"undefined entity"});
}

TEST(Xml, WrongBytesAreRefusedInTheirLine) {
  refused("<a>\n\xE4</a>", 2, {"XML", "not well-formed"});
  refused("<a>\n\xC0\x80</a>", 2, {"XML"});  // an overlong NUL
  refused("<?xml version='1.0' encoding='us-ascii'?>\n<a>\n\xC3\xA4</a>", 3, {"XML"});
  refused("<?xml version='1.0' encoding='ebcdic'?><a/>", 1, {"unknown encoding"});
  refused(std::string("<a>\n<b/>\n\0</a>", 13), 3, {"NUL"});
  const std::string narrow = "<a/>";
  std::string wide = "\xFF\xFE";
  for (const char c : narrow) wide += std::string{c, '\0'};
  refused(wide, 1, {"UTF-8", "UTF-16"});
}

TEST(Xml, EntitiesAndDocumentTypesAreRefused) {
  std::string laughs = "<?xml version=\"1.0\"?>\n<!DOCTYPE a [\n<!ENTITY l0 \"ha\">\n";
  for (int k = 1; k < 20; ++k) {
    laughs += "<!ENTITY l" + std::to_string(k) + " \"";
    for (int n = 0; n < 10; ++n) laughs += "&l" + std::to_string(k - 1) + ";";
    laughs += "\">\n";
  }
  const std::clock_t start = std::clock();
  refused(laughs + "]>\n<a>&l19;</a>", 2, {"document type"});
  EXPECT_LT(static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC, 1);
  refused("<!DOCTYPE a [<!ENTITY f SYSTEM \"file:///etc/passwd\">]><a>&f;</a>", 1, {"document type"});
  refused("\n<!DOCTYPE a SYSTEM \"a.dtd\">\n<a/>", 2, {"document type"});
}

TEST(Xml, NestingIsLimited) {
  const auto nested = [](std::size_t deep) {
    std::string text;
    for (std::size_t k = 0; k < deep; ++k) text += "<a>\n";
    for (std::size_t k = 0; k < deep; ++k) text += "</a>";
    return text;
  };
  const std::string most = nested(deepest_element);
  const XmlElement root = parse_xml("x.xml", most);
  EXPECT_EQ(root.children.size(), 1U);
  refused(nested(deepest_element + 1), deepest_element + 1, {"64 elements"});
  refused(nested(1000000), deepest_element + 1, {"64 elements"});
}

}  // namespace
