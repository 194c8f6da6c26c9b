// SPDX-License-Identifier: Apache-2.0
#include "exchange/xml.hpp"

#include <expat.h>
#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <memory>
#include <type_traits>
#include <utility>

#include "input_error.hpp"

namespace flexcomp::host {

namespace {

template <class Item>
const Item* named(const std::vector<Item>& items, std::string_view name) {
  const auto at = std::find_if(items.begin(), items.end(), [name](const Item& i) { return i.name == name; });
  return at == items.end() ? nullptr : &*at;
}

/// Receives expat's events.
class TreeBuilder {
 public:
  explicit TreeBuilder(const std::string& text)
      : text_(text), parser_(XML_ParserCreate(nullptr), XML_ParserFree) {
    open_.emplace_back();  // holds the root
    XML_SetUserData(parser_.get(), this);
    XML_SetElementHandler(
        parser_.get(),
        [](void* self, const char* name, const char** attributes) {
          static_cast<TreeBuilder*>(self)->start(name, attributes);
        },
        [](void* self, const char*) { static_cast<TreeBuilder*>(self)->end(); });
    XML_SetStartDoctypeDeclHandler(parser_.get(), [](void* self, const char*, const char*, const char*, int) {
      static_cast<TreeBuilder*>(self)->stop("a document type declaration");
    });
  }

  XmlElement root(const std::string& path) {
    const auto length = static_cast<int>(text_.size());
    if (XML_Parse(parser_.get(), text_.data(), length, XML_TRUE) == XML_STATUS_OK)
      return std::move(open_.front().children.front());
    throw InputError(path, line(), "", refused_.empty() ? "XML" : "XML without such",
                     refused_.empty() ? XML_ErrorString(XML_GetErrorCode(parser_.get())) : refused_,
                     ErrorCode::not_xml);
  }

 private:
  std::size_t line() const { return XML_GetCurrentLineNumber(parser_.get()); }
  std::size_t position() const { return static_cast<std::size_t>(XML_GetCurrentByteIndex(parser_.get())); }

  /// Exceptions must not pass through expat, which is C.
  void stop(std::string why) {
    refused_ = std::move(why);
    XML_StopParser(parser_.get(), XML_FALSE);
  }

  void start(const char* name, const char** attributes) {
    if (open_.size() > deepest_element)
      return stop(fmt::format("more than {} elements within each other", deepest_element));
    XmlElement element;
    element.name = name;
    element.line = line();
    const std::size_t begin = position();
    element.start_tag = {begin, begin + static_cast<std::size_t>(XML_GetCurrentByteCount(parser_.get()))};
    // expat does not tell where attributes stand; in a well-formed tag each is the next text in quotes.
    std::size_t at = begin;
    for (; *attributes != nullptr; attributes += 2) {
      const std::size_t open = text_.find_first_of("\"'", at);
      const std::size_t close = text_.find(text_[open], open + 1);
      element.attributes.push_back({attributes[0], attributes[1], {open + 1, close}});
      at = close + 1;
    }
    open_.push_back(std::move(element));
  }

  void end() {
    XmlElement element = std::move(open_.back());
    open_.pop_back();
    element.end_tag = position();
    open_.back().children.push_back(std::move(element));
  }

  const std::string& text_;
  std::unique_ptr<std::remove_pointer_t<XML_Parser>, decltype(&XML_ParserFree)> parser_;
  std::vector<XmlElement> open_;
  std::string refused_;
};

}  // namespace

const XmlAttribute* XmlElement::attribute(std::string_view wanted) const { return named(attributes, wanted); }
const XmlElement* XmlElement::child(std::string_view wanted) const { return named(children, wanted); }

XmlElement parse_xml(const std::string& path, const std::string& text) {
  if (text.size() > static_cast<std::size_t>(std::numeric_limits<int>::max()))
    throw InputError(path, 0, "", "XML of less than 2 GiB", fmt::format("{} bytes", text.size()),
                     ErrorCode::not_xml);
  // UTF-16 has them too; the places of attributes are looked for byte by byte.
  if (const std::size_t nul = text.find('\0'); nul != std::string::npos) {
    const auto line = 1 + std::count(text.begin(), text.begin() + static_cast<std::ptrdiff_t>(nul), '\n');
    throw InputError(path, static_cast<std::size_t>(line), "", "XML in UTF-8 or ISO 8859-1",
                     "a NUL byte (UTF-16 or no text)", ErrorCode::not_xml);
  }
  return TreeBuilder(text).root(path);
}

}  // namespace flexcomp::host
