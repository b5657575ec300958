// SPDX-License-Identifier: BSD-3-Clause
//
// Lines that fit a terminal, words that are meant, and what a program says of its build.
#include <gtest/gtest.h>

#include <sstream>

#include "ves/core/build.hpp"
#include "ves/core/lines.hpp"
#include "ves/core/spelling.hpp"

namespace ves {
namespace {

std::vector<std::string> split(const std::string& text, char at) {
  std::vector<std::string> out;
  std::istringstream in(text);
  for (std::string one; std::getline(in, one, at);) out.push_back(one);
  return out;
}

std::string words(const std::string& text) {
  std::istringstream in(text);
  std::string out;
  for (std::string word; in >> word;) out += word + " ";
  return out;
}

TEST(Lines, WrappedTextHasItsWordsInLinesThatFit) {
  const std::string text =
      "The legs hold where they are until somebody says reset and then arm, which nobody has to "
      "do in a hurry.";
  for (const std::size_t width : {12u, 25u, 60u, 200u}) {
    const std::string out = wrapped(text, width, 0);
    EXPECT_EQ(words(out), words(text)) << width;
    const auto lines = split(out, '\n');
    for (std::size_t i = 0; i < lines.size(); ++i) {
      EXPECT_LE(lines[i].size(), width);
      if (i == 0) continue;  // as full as it can be
      const std::string next = lines[i].substr(0, lines[i].find(' '));
      EXPECT_GT(lines[i - 1].size() + 1 + next.size(), width) << out;
    }
  }
  EXPECT_EQ(wrapped("aa bb cc", 5, 3), "aa bb\n   cc");
  EXPECT_EQ(wrapped("aa\nbb cc", 80, 2), "aa\n  bb cc");
  EXPECT_EQ(wrapped("averylongword b", 4), "averylongword\nb");
  EXPECT_EQ(wrapped("", 10), "");
}

TEST(Lines, FoldedLinesGoOnWhereTheyBegan) {
  EXPECT_EQ(folded("short\n", 10, 4), "short\n");
  EXPECT_EQ(folded("one two three\n", 8, 4), "one two\nthree\n");
  // Two blanks in stand names, and what is said of them further in.
  EXPECT_EQ(folded("  one two three\n", 10, 4), "  one two\n    three\n");
  EXPECT_EQ(folded("   one two three\n", 10, 6), "   one two\n   three\n");
  EXPECT_EQ(folded("averylongword\n", 5, 2), "averylongword\n");
  EXPECT_EQ(folded("a\n\nb", 5, 2), "a\n\nb\n");
}

TEST(Spelling, NamesTheWordThatIsMeant) {
  const std::vector<std::string> known = {"controller", "control", "compensation", "legs"};
  EXPECT_EQ(nearest("controler", known), "controller");
  EXPECT_EQ(nearest("comp", known), "compensation");  // a beginning
  EXPECT_EQ(nearest("compens", known), "compensation");
  EXPECT_EQ(nearest("leg", known), "legs");
  EXPECT_EQ(nearest("quite another", known), "");
  EXPECT_EQ(nearest("cont", std::vector<std::string>{"control", "cone"}), "control");
  EXPECT_EQ(beginning("com", known), "");  // tells too little
  EXPECT_EQ(editDistance("kitten", "sitting"), 3u);
}

// Version, revision, compiler, flags, and how it computes: of two programs the last decides
// whether their runs may be the same to the bit.
TEST(Build, IsDescribedByPieceInOrder) {
  const auto pieces = split(describeBuild(), ';');
  ASSERT_GE(pieces.size(), 5u) << describeBuild();
  EXPECT_EQ(pieces[0], VES_TEST_VERSION);
  EXPECT_EQ(pieces[1].rfind(" source ", 0), 0u) << pieces[1];
  EXPECT_EQ(pieces[1].substr(8), build().revision);
  EXPECT_NE(pieces[2].find(VES_TEST_COMPILER), std::string::npos) << pieces[2];
  EXPECT_NE(pieces[3].find("-"), std::string::npos) << pieces[3];
  EXPECT_NE(pieces.back().find("no contraction"), std::string::npos) << pieces.back();
  EXPECT_EQ(arithmeticOf(describeBuild()), build().arithmetic);
  EXPECT_EQ(arithmeticOf("1.0"), "");
  EXPECT_EQ(arithmeticOf("1.0; x86"), "x86");
}

}  // namespace
}  // namespace ves
