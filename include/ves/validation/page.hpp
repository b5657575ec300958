// SPDX-License-Identifier: BSD-3-Clause
//
// A self-contained HTML page of claims, figures and tables.
#pragma once

#include <string>
#include <vector>

#include "ves/pictures/figure.hpp"
#include "ves/validation/claims.hpp"

namespace ves {

struct Table {
  std::string title;
  std::vector<std::string> header;
  std::vector<std::vector<std::string>> rows;
  std::string note = {};  // beneath it
};

/// A self-contained HTML page: style and figures inside, no script, light and dark, prints. All
/// text is taken as text, not as HTML.
class Page {
 public:
  void section(const std::string& title);
  void text(const std::string& paragraph);
  /// Adds the claim here, and to the table on top.
  void claim(const Claim& claim);
  /// `command` prints or draws the same. One of the report's ("Figure 4.1: ...") is in the index on
  /// top.
  void figure(const std::string& caption, const std::vector<Panel>& panels,
              const std::string& command);
  /// Drawings beside each other, as SVG.
  void drawings(const std::string& caption, const std::vector<std::string>& svgs);
  void table(const std::vector<std::string>& header,
             const std::vector<std::vector<std::string>>& rows);

  /// What another page has goes on here.
  void append(const Page& other);

  std::vector<Claim> claims() const;
  std::string html(const std::string& title, const std::string& lead) const;

 private:
  struct Section {
    std::string title, body;
    std::vector<Claim> claims;
    std::vector<std::string> figures = {};  // names, each an anchor
  };
  Section& last() { return sections_.back(); }

  std::vector<Section> sections_ = {{}};  // the first is what stands before any title
};

}  // namespace ves
