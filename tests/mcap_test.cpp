// SPDX-License-Identifier: BSD-3-Clause
//
// Logs for other viewers: the container byte by byte, and messages beside hand-made CDR. What
// others' readers make of it: tests/tools/readers.py.
#include <gtest/gtest.h>
#include <unistd.h>
#include <zstd.h>

#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>

#include "support/refusal.hpp"
#include "ves/export/lcm_definition.hpp"
#include "ves/export/mcap.hpp"

namespace ves {
namespace {

std::string written(int messages) {
  const auto file =
      std::filesystem::temp_directory_path() / ("ves_mcap_" + std::to_string(getpid()));
  {
    McapWriter out(file, "ros2", "test");
    const auto a = out.addChannel("/a", "cdr", "x/msg/A", "ros2msg", "int32 a\n");
    const auto b = out.addChannel("/b", "cdr", "x/msg/A", "ros2msg", "int32 a\n");
    for (int i = 0; i < messages; ++i) out.write(i % 3 ? a : b, 1000 + i, std::string(1000, 'x'));
    out.attach("file.yaml", "application/yaml", "key: value");
    out.describe("ves", {{"hash", "1"}});
    out.finish();
  }
  std::ifstream in(file, std::ios::binary);
  std::string bytes((std::istreambuf_iterator<char>(in)), {});
  std::filesystem::remove(file);
  return bytes;
}

template <class T>
T number(const std::string& bytes, std::size_t at) {
  T value;
  std::memcpy(&value, bytes.data() + at, sizeof value);
  return value;
}

/// CRC-32 bit by bit, as IEEE 802.3 has it.
std::uint32_t crc(const std::string& bytes) {
  std::uint32_t c = 0xffffffff;
  for (const char byte : bytes) {
    c ^= static_cast<unsigned char>(byte);
    for (int k = 0; k < 8; ++k) c = c >> 1 ^ (c & 1 ? 0xedb88320u : 0u);
  }
  return ~c;
}

struct Record {
  std::uint8_t opcode;
  std::size_t at;  // of its content
  std::string content;
};
std::vector<Record> records(const std::string& bytes, std::size_t from, std::size_t to) {
  std::vector<Record> out;
  while (from < to) {
    const auto size = number<std::uint64_t>(bytes, from + 1);
    out.push_back({static_cast<std::uint8_t>(bytes[from]), from + 9, bytes.substr(from + 9, size)});
    from += 9 + size;
  }
  EXPECT_EQ(from, to);
  return out;
}

TEST(Mcap, IsAsTheSpecificationHasIt) {
  constexpr int kMessages = 2500;  // of 1 kB: three chunks
  const std::string bytes = written(kMessages);
  const std::string magic = "\x89MCAP0\r\n";
  ASSERT_EQ(bytes.substr(0, 8), magic);
  ASSERT_EQ(bytes.substr(bytes.size() - 8), magic);
  const std::vector<Record> all = records(bytes, 8, bytes.size() - 8);
  EXPECT_EQ(all.front().opcode, 1);
  EXPECT_EQ(all.back().opcode, 2);
  int messages = 0, chunks = 0, indexed = 0;
  for (const Record& r : all) {
    if (r.opcode == 6) {
      ++chunks;
      const auto size = number<std::uint64_t>(r.content, 16);
      EXPECT_EQ(r.content.substr(32, 4), "zstd");
      std::string plain(size, '\0');
      const auto compressed = number<std::uint64_t>(r.content, 36);
      ASSERT_EQ(ZSTD_decompress(plain.data(), size, r.content.data() + 44, compressed), size);
      EXPECT_EQ(number<std::uint32_t>(r.content, 24), crc(plain));
      std::uint64_t least = UINT64_MAX, most = 0;
      for (const Record& inner : records(plain, 0, plain.size())) {
        if (inner.opcode != 5) continue;
        ++messages;
        const auto time = number<std::uint64_t>(inner.content, 6);
        least = std::min(least, time);
        most = std::max(most, time);
        EXPECT_EQ(inner.content.size(), 22u + 1000u);
      }
      EXPECT_EQ(number<std::uint64_t>(r.content, 0), least);
      EXPECT_EQ(number<std::uint64_t>(r.content, 8), most);
    }
    if (r.opcode == 7) indexed += static_cast<int>(number<std::uint32_t>(r.content, 2) / 16);
    if (r.opcode == 9) {
      EXPECT_EQ(number<std::uint32_t>(r.content, r.content.size() - 4),
                crc(r.content.substr(0, r.content.size() - 4)));
    }
    if (r.opcode == 15) {
      EXPECT_EQ(number<std::uint32_t>(r.content, 0), crc(bytes.substr(0, r.at - 9)));
    }
    if (r.opcode == 11) {
      EXPECT_EQ(number<std::uint64_t>(r.content, 0), static_cast<std::uint64_t>(kMessages));
      EXPECT_EQ(number<std::uint16_t>(r.content, 8), 1);    // schemas
      EXPECT_EQ(number<std::uint32_t>(r.content, 10), 2u);  // channels
    }
    if (r.opcode == 8) {  // a chunk's index points at a chunk
      const auto offset = number<std::uint64_t>(r.content, 16);
      EXPECT_EQ(bytes[offset], 6);
      EXPECT_EQ(number<std::uint64_t>(r.content, 24), 9 + number<std::uint64_t>(bytes, offset + 1));
    }
  }
  EXPECT_EQ(messages, kMessages);
  EXPECT_EQ(indexed, kMessages);
  EXPECT_EQ(chunks, 3);
  const auto summary = number<std::uint64_t>(all.back().content, 0);
  const std::size_t end = all.back().at + 16;
  EXPECT_EQ(number<std::uint32_t>(all.back().content, 16),
            crc(bytes.substr(summary, end - summary)));
  EXPECT_EQ(bytes[number<std::uint64_t>(all.back().content, 8)], 14);
  EXPECT_EQ(bytes, written(kMessages));
}

TEST(Mcap, RefusesAFileThatCannotBeWritten) {
  EXPECT_EQ(test::refusal([] { McapWriter("/nowhere/a.mcap", "", ""); }),
            "/nowhere/a.mcap: No such file or directory");
}

constexpr const char* kLcm = R"(package ves;
// A thing.
struct thing_t {
  header_t header;    // who
  int8_t small;       // [-] so
  double far[2];      // [m]; both
  int32_t last;
}
)";

TEST(Ros2, ADefinitionKeepsUnitsAndOrder) {
  const std::string text = LcmDefinition(kLcm).ros2();
  EXPECT_EQ(
      text.rfind("ves_msgs/Header header  # who\nint8 small  # [-] so\nfloat64[2] far  # [m]; "
                 "both\nint32 last\n" +
                     std::string(80, '=') + "\nMSG: ves_msgs/Header\n",
                 0),
      0u)
      << text;
  EXPECT_NE(text.find("int64 time_ns  # [ns]"), std::string::npos);
}

TEST(Ros2, BytesAreTurnedAndAligned) {
  std::vector<std::uint8_t> lcm(8, 0xaa);  // fingerprint
  for (int i = 0; i < 6; ++i)              // header: 1 to 6
    for (int k = 0; k < 8; ++k) lcm.push_back(k == 7 ? static_cast<std::uint8_t>(i + 1) : 0);
  lcm.push_back(0xfe);  // -2
  for (const int byte : {0x3f, 0xf0, 0, 0, 0, 0, 0, 0})
    lcm.push_back(static_cast<std::uint8_t>(byte));  // 1.0
  for (const int byte : {0xc0, 0x00, 0, 0, 0, 0, 0, 0})
    lcm.push_back(static_cast<std::uint8_t>(byte));                                    // -2.0
  for (const int byte : {0, 0, 1, 0}) lcm.push_back(static_cast<std::uint8_t>(byte));  // 256
  const std::string cdr = LcmDefinition(kLcm).cdr(lcm);
  ASSERT_EQ(cdr.size(), 4u + 48u + 8u + 16u + 4u);
  EXPECT_EQ(cdr.substr(0, 4), std::string("\0\1\0\0", 4));
  for (std::size_t i = 0; i < 6; ++i)
    EXPECT_EQ(number<std::int64_t>(cdr, 4 + 8 * i), static_cast<std::int64_t>(i + 1));
  EXPECT_EQ(number<std::int8_t>(cdr, 52), -2);
  EXPECT_EQ(number<double>(cdr, 60), 1.0);  // seven bytes of padding
  EXPECT_EQ(number<double>(cdr, 68), -2.0);
  EXPECT_EQ(number<std::int32_t>(cdr, 76), 256);
  lcm.push_back(0);
  EXPECT_EQ(LcmDefinition(kLcm).cdr(lcm), "");
  lcm.resize(20);
  EXPECT_EQ(LcmDefinition(kLcm).cdr(lcm), "");
}

}  // namespace
}  // namespace ves
