// SPDX-License-Identifier: BSD-3-Clause
//
// Holds the module diagram of docs/architecture.md: who may include whom, and what the control path
// is free of.
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <map>
#include <regex>
#include <set>

namespace {

namespace fs = std::filesystem;
using Names = std::set<std::string>;

const fs::path kRoot = VES_TEST_SOURCE_DIR;

/// What a module may include beside itself.
const std::map<std::string, Names> kMayInclude = [] {
  std::map<std::string, Names> may = {{"core", {}}, {"math", {}}};
  const auto add = [&](const std::string& module, const Names& more, const std::string& below) {
    may[module] = more;
    if (!below.empty()) {
      may[module].insert(below);
      may[module].insert(may[below].begin(), may[below].end());
    }
  };
  add("kinematics", {}, "math");
  add("robot", {}, "math");
  add("contract", {"robot"}, "kinematics");
  add("realtime", {}, "core");
  add("bus", {"realtime", "core"}, "contract");
  add("vehicle", {}, "contract");
  add("control", {}, "vehicle");
  add("contact", {}, "robot");
  add("planning", {"core", "contact"}, "contract");
  add("plant", {"planning", "core", "contact"}, "control");
  add("srms", {"planning", "core", "contact"}, "vehicle");
  add("analysis", {"planning", "core", "contact"}, "control");  // what judges cannot see the plant
  add("config", {"srms", "analysis"}, "plant");
  add("identification", {}, "config");
  add("devices", {"bus", "realtime"}, "config");
  add("run", {}, "devices");
  add("series", {}, "run");
  add("evaluation", {"identification"}, "series");
  add("pictures", {}, "evaluation");
  add("results", {}, "pictures");
  add("export", {}, "series");
  add("page", {}, "evaluation");
  add("validation", {"page"}, "pictures");
  add("acceptance", {}, "validation");
  add("doctor", {}, "run");
  add("sweep", {}, "evaluation");
  add("faults", {}, "run");
  add("console", {}, "results");
  return may;
}();

const Names kPure = {"math", "kinematics", "robot", "contract", "vehicle", "control"};

struct Include {
  fs::path file;
  std::string module, name;
};

std::vector<Include> includes() {
  std::vector<Include> out;
  const std::regex line(R"(^\s*#\s*include\s*[<"]([^>"]+)[>"])");
  for (const fs::path& top : {kRoot / "include/ves", kRoot / "src"})
    for (const auto& entry : fs::recursive_directory_iterator(top)) {
      const std::string extension = entry.path().extension();
      if (extension != ".hpp" && extension != ".cpp") continue;
      std::ifstream in(entry.path());
      std::string text;
      std::smatch match;
      while (std::getline(in, text))
        if (std::regex_search(text, match, line))
          out.push_back({entry.path(), entry.path().parent_path().filename(), match[1]});
    }
  return out;
}

TEST(Layering, NothingPointsUp) {
  const std::regex ours(R"(^ves/([a-z]+)/)");
  int seen = 0;
  for (const Include& i : includes()) {
    ASSERT_TRUE(kMayInclude.count(i.module)) << i.file << " is in no known module";
    std::smatch match;
    if (!std::regex_search(i.name, match, ours)) continue;
    ++seen;
    const std::string target = match[1];
    EXPECT_TRUE(target == i.module || kMayInclude.at(i.module).count(target))
        << i.file << " includes " << i.name;
  }
  EXPECT_GT(seen, 50);
}

TEST(Layering, ControlPathKnowsEigenAndTheLanguageOnly) {
  const Names allowed = {"algorithm",
                         "array",
                         "cassert",
                         "cmath",
                         "complex",
                         "concepts",
                         "cstdint",
                         "optional",
                         "span",
                         "string_view",
                         "tuple",
                         "utility",
                         "variant",
                         "Eigen/Cholesky",
                         "Eigen/Core",
                         "Eigen/Eigenvalues",
                         "Eigen/Geometry",
                         "Eigen/LU",
                         "Eigen/QR",
                         "Eigen/SVD",
                         "unsupported/Eigen/MatrixFunctions"};
  for (const Include& i : includes())
    if (kPure.count(i.module) && i.name.rfind("ves/", 0) != 0) {
      EXPECT_TRUE(allowed.count(i.name)) << i.file << " includes " << i.name;
    }
}

TEST(Layering, LinkGraphIsTheSameDiagram) {
  std::ifstream in(kRoot / "src/CMakeLists.txt");
  const std::string text((std::istreambuf_iterator<char>(in)), {});
  const std::regex module(R"(ves_module\((\w+)([^)]*)\))"), link(R"(ves::(\w+))");
  int seen = 0;
  for (std::sregex_iterator m(text.begin(), text.end(), module), end; m != end; ++m) {
    if ((*m)[1] == "name") continue;
    const std::string name = (*m)[1], body = (*m)[2];
    ASSERT_TRUE(kMayInclude.count(name)) << name;
    ++seen;
    for (std::sregex_iterator l(body.begin(), body.end(), link); l != end; ++l)
      EXPECT_TRUE(kMayInclude.at(name).count((*l)[1])) << name << " links " << (*l)[1];
  }
  EXPECT_EQ(seen, static_cast<int>(kMayInclude.size()));
}

TEST(Layering, ControlPathNeitherThrowsNorAllocatesNorPrints) {
  const std::regex banned(
      R"(\b(throw|new|malloc|std::vector|std::string|printf|std::cout|std::function|std::mutex|std::chrono)\b)");
  for (const fs::path& top : {kRoot / "include/ves", kRoot / "src"})
    for (const std::string& module : kPure)
      for (const auto& entry : fs::directory_iterator(top / module)) {
        std::ifstream in(entry.path());
        std::string text;
        for (int n = 1; std::getline(in, text); ++n) {
          const std::string code = text.substr(0, text.find("//"));
          std::smatch match;
          if (std::regex_search(code, match, banned) &&
              code.find("std::string_view") == std::string::npos)
            ADD_FAILURE() << entry.path() << ":" << n << ": " << match[1];
        }
      }
}

TEST(Laws, AreHeldByTestsThatExist) {
  const auto text = [](const fs::path& file) {
    std::ifstream in(file);
    return std::string((std::istreambuf_iterator<char>(in)), {});
  };
  std::string tests;
  for (const auto& entry : fs::directory_iterator(kRoot / "tests"))
    if (entry.path().extension() == ".cpp") tests += text(entry.path());
  const std::string page = text(kRoot / "docs/safety.md");
  const std::string laws = page.substr(page.find("## The laws"),
                                       page.find("## The stability") - page.find("## The laws"));
  const std::regex name("`([A-Z]\\w+)\\.(\\w*)(\\.\\.\\.|\\*)?`");
  int seen = 0;
  for (std::sregex_iterator at(laws.begin(), laws.end(), name), end; at != end; ++at, ++seen) {
    const std::regex test("TEST(_F|_P)?\\(" + (*at)[1].str() + ",\\s*" + (*at)[2].str() +
                          ((*at)[3].matched ? "\\w*" : "") + "\\)");
    EXPECT_TRUE(std::regex_search(tests, test)) << (*at)[0];
  }
  EXPECT_GE(seen, 12);
}

}  // namespace
