// SPDX-License-Identifier: BSD-3-Clause
#include "ves/validation/page.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <utility>

namespace ves {
namespace {

constexpr const char* kStyle = R"(
:root { color-scheme: light dark; --ink: #1b1f24; --soft: #57606a; --line: #d0d7de; --back: #ffffff;
  --c0: #0067a8; --c1: #c14e00; --c2: #00805e; --agrees: #1a7f37; --differs: #b42318; --open: #6e5a00; }
@media (prefers-color-scheme: dark) { :root { --ink: #e6edf3; --soft: #9aa4ae; --line: #3a424b;
  --back: #12161b; --c0: #58b4f0; --c1: #ff9a52; --c2: #41c99b; --agrees: #56d364; --differs: #ff7b72;
  --open: #e3c64c; } }
body { background: var(--back); color: var(--ink); font: 16px/1.5 system-ui, sans-serif;
  max-width: 62rem; margin: 2rem auto; padding: 0 1rem; }
h1 { font-size: 1.7rem; line-height: 1.2; } h2 { font-size: 1.25rem; margin-top: 2.5rem;
  border-bottom: 1px solid var(--line); padding-bottom: .2rem; }
a { color: var(--c0); } p { max-width: 48rem; }
.scroll { overflow-x: auto; }
table { border-collapse: collapse; font-size: .85rem; margin: .8rem 0; font-variant-numeric: tabular-nums; }
th, td { text-align: left; vertical-align: top; padding: .3rem .6rem .3rem 0;
  border-bottom: 1px solid var(--line); } th { font-weight: 600; color: var(--soft); }
table.numbers { font-size: .78rem; } table.numbers td { white-space: nowrap; }
table.numbers td:not(:first-child), table.numbers th:not(:first-child) { text-align: right; padding: .3rem 0 .3rem .7rem; }
figure { margin: 1rem 0; } figure svg { width: 100%; height: auto; display: block; }
.drawings { display: flex; gap: 1rem; } .drawings div { flex: 1; } .drawings svg { max-height: 22rem; }
figcaption { font-size: .85rem; color: var(--soft); } figcaption code { display: block; font-size: .8rem; overflow-wrap: anywhere; }
.claim { border-left: 3px solid var(--line); padding: .1rem 0 .1rem .9rem; margin: .8rem 0; font-size: .92rem; }
.claim p { margin: .25rem 0; } .claim .says { color: var(--soft); }
.verdict { font-weight: 600; white-space: nowrap; } .agrees { color: var(--agrees); }
.differs { color: var(--differs); } .open { color: var(--open); }
svg .ink { stroke: var(--ink); } svg .ink-text { fill: var(--ink); } svg .mark { stroke: var(--soft); }
svg .mark-text { fill: var(--soft); } svg .gridline { stroke: var(--line); }
svg .c0 { stroke: var(--c0); } svg .c1 { stroke: var(--c1); } svg .c2 { stroke: var(--c2); }
@media (max-width: 44rem) { table:not(.numbers), table:not(.numbers) tbody, table:not(.numbers) tr,
  table:not(.numbers) td { display: block; } table:not(.numbers) thead { display: none; }
  table:not(.numbers) td { border: 0; padding: .1rem 0; } table:not(.numbers) tr { border-bottom: 1px solid var(--line);
  padding: .4rem 0; } .verdict { white-space: normal; } }
@media print { :root { --ink: #000; --back: #fff; --line: #bbb; --c0: #0067a8; --c1: #c14e00; --c2: #00805e; }
  body { margin: 0; max-width: none; font-size: 10pt; } figure, .claim, tr { break-inside: avoid; }
  h2 { break-after: avoid; } }
)";

std::string escaped(const std::string& text) {
  std::string out;
  for (const char c : text) switch (c) {
      case '&': out += "&amp;"; break;
      case '<': out += "&lt;"; break;
      case '>': out += "&gt;"; break;
      case '"': out += "&quot;"; break;
      default: out += c;
    }
  return out;
}

/// "Figures 4.4 and 4.5" as it stands in an address.
std::string anchor(std::string name) {
  for (char& c : name)
    if (!std::isalnum(static_cast<unsigned char>(c)) && c != '.') c = '-';
  return name;
}

std::string badge(Verdict verdict) {
  const char* look = verdict == Verdict::kAgrees    ? "agrees"
                     : verdict == Verdict::kDiffers ? "differs"
                                                    : "open";
  return fmt::format("<span class=\"verdict {}\">{}</span>", look, name(verdict));
}

}  // namespace

void Page::section(const std::string& title) { sections_.push_back({title, {}, {}}); }

void Page::text(const std::string& paragraph) {
  last().body += fmt::format("<p>{}</p>\n", escaped(paragraph));
}

void Page::claim(const Claim& claim) {
  last().claims.push_back(claim);
  last().body +=
      fmt::format("<div class=\"claim\"><p class=\"says\">{}: {}</p><p>{}</p><p>{}{}</p></div>\n",
                  escaped(claim.where), escaped(claim.says), escaped(claim.reached),
                  badge(claim.verdict), claim.why.empty() ? "" : ": " + escaped(claim.why));
}

void Page::append(const Page& other) {
  const Section& first = other.sections_.front();
  last().body += first.body;
  last().claims.insert(last().claims.end(), first.claims.begin(), first.claims.end());
  last().figures.insert(last().figures.end(), first.figures.begin(), first.figures.end());
  sections_.insert(sections_.end(), other.sections_.begin() + 1, other.sections_.end());
}

std::vector<Claim> Page::claims() const {
  std::vector<Claim> all;
  for (const Section& s : sections_) all.insert(all.end(), s.claims.begin(), s.claims.end());
  return all;
}

void Page::drawings(const std::string& caption, const std::vector<std::string>& svgs) {
  std::string all;
  for (const std::string& one : svgs) all += "<div>" + one + "</div>";
  last().body +=
      fmt::format("<figure><div class=\"drawings\">{}</div><figcaption>{}</figcaption></figure>\n",
                  all, escaped(caption));
}

void Page::figure(const std::string& caption, const std::vector<Panel>& panels,
                  const std::string& command) {
  const std::string name = caption.substr(0, caption.find(':'));
  if (name.starts_with("Figure")) last().figures.push_back(name);
  last().body +=
      fmt::format("<figure id=\"{}\">\n{}<figcaption>{}<code>{}</code></figcaption></figure>\n",
                  anchor(name), svg(panels), escaped(caption), escaped(command));
}

void Page::table(const std::vector<std::string>& header,
                 const std::vector<std::vector<std::string>>& rows) {
  std::string& body = last().body;
  body += "<div class=\"scroll\"><table class=\"numbers\"><thead><tr>";
  for (const std::string& cell : header) body += "<th>" + escaped(cell) + "</th>";
  body += "</tr></thead><tbody>\n";
  for (const auto& row : rows) {
    body += "<tr>";
    for (const std::string& cell : row) body += "<td>" + escaped(cell) + "</td>";
    body += "</tr>\n";
  }
  body += "</tbody></table></div>\n";
}

std::string Page::html(const std::string& title, const std::string& lead) const {
  const std::vector<Claim> all = claims();
  std::string counts;
  for (const Verdict v :
       {Verdict::kAgrees, Verdict::kDiffers, Verdict::kRange, Verdict::kCannotTell}) {
    const auto n =
        std::count_if(all.begin(), all.end(), [v](const Claim& c) { return c.verdict == v; });
    if (n) counts += fmt::format("{}{} {}", counts.empty() ? "" : ", ", n, badge(v));
  }
  std::string rows, index, body = sections_.front().body;
  for (const Section& section : sections_)
    for (const std::string& name : section.figures)
      index += fmt::format("{}<a href=\"#{}\">{}</a>", index.empty() ? "" : " | ", anchor(name),
                           escaped(name));
  if (!index.empty()) index = "<p>" + index + "</p>\n";
  for (std::size_t i = 1; i < sections_.size(); ++i) {
    body += fmt::format("<h2 id=\"s{}\">{}</h2>\n{}", i, escaped(sections_[i].title),
                        sections_[i].body);
    for (const Claim& c : sections_[i].claims)
      rows += fmt::format(
          "<tr><td><a href=\"#s{}\">{}</a></td><td>{}</td><td>{}</td><td>{}</td></tr>\n", i,
          escaped(c.where), escaped(c.says), escaped(c.reached), badge(c.verdict));
  }
  std::string claims_table;
  if (!all.empty())
    claims_table = fmt::format(
        "<p>{} claims: {}.</p>\n<div "
        "class=\"scroll\"><table><thead><tr><th>report</th><th>claim</th>"
        "<th>reached</th><th>verdict</th></tr></thead><tbody>\n{}</tbody></table></div>\n",
        all.size(), counts, rows);
  return fmt::format(
      "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">\n"
      "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n"
      "<title>{0}</title>\n<style>{1}</style></head>\n<body>\n<h1>{0}</h1>\n<p>{2}</p>\n"
      "{3}{4}{5}</body></html>\n",
      escaped(title), kStyle, escaped(lead), index, claims_table, body);
}

}  // namespace ves
