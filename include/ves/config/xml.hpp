// SPDX-License-Identifier: BSD-3-Clause
//
// XML as a tree that remembers its lines. Expat parses: white space, comments, entities and
// encodings are XML's own.
#pragma once

#include <list>
#include <string>
#include <utility>
#include <vector>

namespace ves {

struct XmlElement {
  std::string name;
  std::vector<std::pair<std::string, std::string>> attributes;  // in the file's order
  std::list<XmlElement> children;
  std::string text;  // directly in it, without the blanks around it
  int line = 0;

  /// Nothing where it is not given.
  const std::string* attribute(std::string_view key) const {
    for (const auto& [given, value] : attributes)
      if (given == key) return &value;
    return nullptr;
  }
};

/// The root of a document. Throws InputError, `file` and line in it.
XmlElement parseXml(const std::string& text, const std::string& file);

}  // namespace ves
