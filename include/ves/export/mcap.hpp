// SPDX-License-Identifier: BSD-3-Clause
//
// Files of the MCAP format (mcap.dev/spec), version 0: chunks compressed by zstd, indexed, with
// statistics and checksums. The same calls make the same bytes.
#pragma once

#include <cstdint>
#include <fstream>
#include <map>
#include <string>
#include <vector>

namespace ves {

class McapWriter {
 public:
  using Map = std::map<std::string, std::string>;

  /// Throws InputError when the file cannot be written, here and later.
  McapWriter(const std::string& file, const std::string& profile, const std::string& library);

  /// Returns the channel's number; `encoding` is of the messages, `schema_encoding` of the text.
  std::uint16_t addChannel(const std::string& topic, const std::string& encoding,
                           const std::string& schema, const std::string& schema_encoding,
                           const std::string& schema_text);
  void write(std::uint16_t channel, std::int64_t time, const std::string& data);  // time [ns]
  void attach(const std::string& name, const std::string& media_type, const std::string& data);
  void describe(const std::string& name, const Map& metadata);

  /// Index, statistics and end. Nothing may follow.
  void finish();

 private:
  struct Channel {
    std::string record;  // of the channel
    std::uint16_t schema = 0;
    std::uint64_t messages = 0;
  };
  struct Chunk {
    std::uint64_t start, end, offset, length, index_length, compressed, uncompressed;
    std::map<std::uint16_t, std::uint64_t> indexes;  // offset by channel
  };
  struct Entry {
    std::uint64_t time, offset;
  };
  void put(const std::string& bytes);
  void endChunk();

  std::string name_;
  std::ofstream file_;
  std::uint64_t at_ = 0;        // [B] written
  std::uint32_t data_crc_ = 0;  // of everything so far
  std::vector<std::string> schemas_;
  std::map<std::string, std::uint16_t> schema_ids_;  // by name
  std::vector<Channel> channels_;
  std::string chunk_;  // records, not compressed yet
  std::map<std::uint16_t, std::vector<Entry>> chunk_index_;
  std::vector<Chunk> chunks_;
  std::vector<std::string> attachment_indexes_, metadata_indexes_;
  std::uint64_t messages_ = 0, start_ = 0, end_ = 0, chunk_start_ = 0, chunk_end_ = 0;
};

}  // namespace ves
