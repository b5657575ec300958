// SPDX-License-Identifier: BSD-3-Clause
//
// What --help prints, in lines of 80 columns.
#pragma once

#include <CLI/CLI.hpp>
#include <string>

#include "ves/core/lines.hpp"

namespace ves::app {

inline constexpr std::size_t kColumns = 80;

class EightyColumns : public CLI::Formatter {
 public:
  std::string make_description(const CLI::App* app) const override {
    return wrapped(app->get_description(), kColumns) + "\n";
  }
  std::string make_option(const CLI::Option* option, bool positional) const override {
    const std::size_t at = get_column_width();
    const std::string name = "  " + make_option_name(option, positional) + make_option_opts(option);
    const std::string what = wrapped(make_option_desc(option), kColumns - at, at);
    if (what.empty()) return name + "\n";
    if (name.size() + 1 > at) return name + "\n" + std::string(at, ' ') + what + "\n";
    return name + std::string(at - name.size(), ' ') + what + "\n";
  }
  /// "[log...]" in place of "[log(0x)]".
  std::string make_option_usage(const CLI::Option* option) const override {
    std::string out = CLI::Formatter::make_option_usage(option);
    if (const std::size_t at = out.find('('); at != std::string::npos)
      out.replace(at, out.find(')', at) + 1 - at, "...");
    return out;
  }
  std::string make_subcommand(const CLI::App* sub) const override {
    const std::size_t at = get_column_width();
    std::string name = "  " + sub->get_name();
    name.resize(std::max(at, name.size() + 1), ' ');
    return name + wrapped(sub->get_description(), kColumns - at, at) + "\n";
  }
};

}  // namespace ves::app
