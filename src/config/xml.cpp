// SPDX-License-Identifier: BSD-3-Clause
#include "ves/config/xml.hpp"

#include <expat.h>
#include <fmt/format.h>

#include <memory>

#include "ves/core/errors.hpp"

namespace ves {
namespace {

constexpr std::size_t kMostDepth = 64;  // [-] elements in elements

/// What expat calls. Nothing may be thrown through it: `fault` is kept instead.
struct Builder {
  XML_Parser parser = nullptr;
  XmlElement document;  // its only child is the root
  std::vector<XmlElement*> open{&document};
  std::string fault;

  static Builder& of(void* self) { return *static_cast<Builder*>(self); }

  static void XMLCALL begin(void* self, const XML_Char* name, const XML_Char** attributes) {
    Builder& b = of(self);
    if (b.open.size() > kMostDepth) {
      b.fault = fmt::format("elements nested deeper than {}", kMostDepth);
      XML_StopParser(b.parser, XML_FALSE);
      return;
    }
    XmlElement& element = b.open.back()->children.emplace_back();
    element.name = name;
    element.line = static_cast<int>(XML_GetCurrentLineNumber(b.parser));
    for (; *attributes; attributes += 2)
      element.attributes.emplace_back(attributes[0], attributes[1]);
    b.open.push_back(&element);
  }
  static void XMLCALL end(void* self, const XML_Char*) {
    Builder& b = of(self);
    std::string& text = b.open.back()->text;
    const auto last = text.find_last_not_of(" \t\r\n");
    text.erase(last == std::string::npos ? 0 : last + 1);
    text.erase(0, text.find_first_not_of(" \t\r\n"));
    b.open.pop_back();
  }
  static void XMLCALL characters(void* self, const XML_Char* text, int size) {
    of(self).open.back()->text.append(text, static_cast<std::size_t>(size));
  }
};

}  // namespace

XmlElement parseXml(const std::string& text, const std::string& file) {
  if (text.rfind("version https://git-lfs", 0) == 0)
    throw InputError(fmt::format(
        "{}:1: is a Git LFS pointer, not the file itself; 'git lfs pull' fetches it", file));
  const std::unique_ptr<XML_ParserStruct, decltype(&XML_ParserFree)> parser(
      XML_ParserCreate(nullptr), XML_ParserFree);
  Builder builder;
  builder.parser = parser.get();
  XML_SetUserData(parser.get(), &builder);
  XML_SetElementHandler(parser.get(), Builder::begin, Builder::end);
  XML_SetCharacterDataHandler(parser.get(), Builder::characters);
  const bool good = text.size() < INT_MAX &&
                    XML_Parse(parser.get(), text.data(), static_cast<int>(text.size()), XML_TRUE) ==
                        XML_STATUS_OK;
  if (!good || builder.document.children.empty()) {
    const std::string what = !builder.fault.empty()
                                 ? builder.fault
                                 : fmt::format("not well-formed XML: {}",
                                               XML_ErrorString(XML_GetErrorCode(parser.get())));
    throw InputError(fmt::format("{}:{}: {}", file, XML_GetCurrentLineNumber(parser.get()), what));
  }
  return std::move(builder.document.children.front());
}

}  // namespace ves
