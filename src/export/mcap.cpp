// SPDX-License-Identifier: BSD-3-Clause
#include "ves/export/mcap.hpp"

#include <fmt/format.h>
#include <zlib.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

#include "ves/core/errors.hpp"
#include "zstd.hpp"

namespace ves {
namespace {

constexpr char kMagic[] = "\x89MCAP0\r\n";
constexpr std::size_t kChunk = 1 << 20;  // [B] not compressed

enum Opcode : std::uint8_t {
  kHeader = 1,
  kFooter,
  kSchemaRecord,
  kChannel,
  kMessage,
  kChunkRecord,
  kMessageIndex,
  kChunkIndex,
  kAttachment,
  kAttachmentIndex,
  kStatistics,
  kMetadata,
  kMetadataIndex,
  kSummaryOffset,
  kDataEnd
};

/// Little-endian numbers and texts behind their length.
class Fields {
 public:
  template <class T>
  Fields& number(T value) {
    for (std::size_t i = 0; i < sizeof(T); ++i)
      bytes_ += static_cast<char>(static_cast<std::uint64_t>(value) >> (8 * i) & 0xff);
    return *this;
  }
  Fields& text(const std::string& text) {
    number(static_cast<std::uint32_t>(text.size()));
    bytes_ += text;
    return *this;
  }
  Fields& raw(const std::string& bytes) {
    bytes_ += bytes;
    return *this;
  }
  Fields& map(const McapWriter::Map& map) {
    Fields all;
    for (const auto& [key, value] : map) all.text(key).text(value);
    return text(all.bytes_);
  }
  const std::string& bytes() const { return bytes_; }

 private:
  std::string bytes_;
};

std::string record(Opcode opcode, const Fields& content) {
  return Fields()
      .number(static_cast<std::uint8_t>(opcode))
      .number(static_cast<std::uint64_t>(content.bytes().size()))
      .raw(content.bytes())
      .bytes();
}

std::uint32_t crc(const std::string& bytes, std::uint32_t before = 0) {
  return static_cast<std::uint32_t>(
      crc32_z(before, reinterpret_cast<const unsigned char*>(bytes.data()), bytes.size()));
}

}  // namespace

McapWriter::McapWriter(const std::string& file, const std::string& profile,
                       const std::string& library)
    : name_(file), file_(file, std::ios::binary) {
  put(std::string(kMagic, 8));
  put(record(kHeader, Fields().text(profile).text(library)));
}

void McapWriter::put(const std::string& bytes) {
  file_.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  if (!file_) throw InputError(fmt::format("{}: {}", name_, std::strerror(errno)));
  data_crc_ = crc(bytes, data_crc_);
  at_ += bytes.size();
}

std::uint16_t McapWriter::addChannel(const std::string& topic, const std::string& encoding,
                                     const std::string& schema, const std::string& schema_encoding,
                                     const std::string& schema_text) {
  // Schemas are numbered from one; zero means none.
  const auto [at, fresh] =
      schema_ids_.emplace(schema, static_cast<std::uint16_t>(schema_ids_.size() + 1));
  if (fresh) {
    schemas_.push_back(
        record(kSchemaRecord,
               Fields().number(at->second).text(schema).text(schema_encoding).text(schema_text)));
    chunk_ += schemas_.back();
  }
  const auto id = static_cast<std::uint16_t>(channels_.size());
  channels_.push_back(
      {record(kChannel, Fields().number(id).number(at->second).text(topic).text(encoding).map({})),
       at->second, 0});
  chunk_ += channels_.back().record;
  return id;
}

void McapWriter::write(std::uint16_t channel, std::int64_t time, const std::string& data) {
  const auto t = static_cast<std::uint64_t>(time);
  Channel& to = channels_[channel];
  if (chunk_index_.empty()) chunk_start_ = chunk_end_ = t;
  if (messages_ == 0) start_ = end_ = t;
  chunk_start_ = std::min(chunk_start_, t);
  chunk_end_ = std::max(chunk_end_, t);
  start_ = std::min(start_, t);
  end_ = std::max(end_, t);
  chunk_index_[channel].push_back({t, chunk_.size()});
  chunk_ += record(kMessage, Fields()
                                 .number(channel)
                                 .number(static_cast<std::uint32_t>(to.messages))
                                 .number(t)
                                 .number(t)
                                 .raw(data));
  ++to.messages;
  ++messages_;
  if (chunk_.size() >= kChunk) endChunk();
}

void McapWriter::endChunk() {
  if (chunk_.empty()) return;
  const std::string small = compressed(chunk_, name_);
  Chunk chunk{chunk_start_, chunk_end_, at_, 0, 0, small.size(), chunk_.size(), {}};
  put(record(kChunkRecord, Fields()
                               .number(chunk_start_)
                               .number(chunk_end_)
                               .number(static_cast<std::uint64_t>(chunk_.size()))
                               .number(crc(chunk_))
                               .text("zstd")
                               .number(static_cast<std::uint64_t>(small.size()))
                               .raw(small)));
  chunk.length = at_ - chunk.offset;
  const std::uint64_t indexes = at_;
  for (const auto& [channel, entries] : chunk_index_) {
    chunk.indexes[channel] = at_;
    Fields all;
    for (const Entry& entry : entries) all.number(entry.time).number(entry.offset);
    put(record(kMessageIndex, Fields().number(channel).text(all.bytes())));
  }
  chunk.index_length = at_ - indexes;
  chunks_.push_back(chunk);
  chunk_.clear();
  chunk_index_.clear();
  chunk_start_ = chunk_end_ = 0;
}

void McapWriter::attach(const std::string& name, const std::string& media_type,
                        const std::string& data) {
  const Fields content = Fields()
                             .number(std::uint64_t{0})
                             .number(std::uint64_t{0})
                             .text(name)
                             .text(media_type)
                             .number(static_cast<std::uint64_t>(data.size()))
                             .raw(data);
  const std::uint64_t offset = at_;
  put(record(kAttachment, Fields(content).number(crc(content.bytes()))));
  attachment_indexes_.push_back(
      record(kAttachmentIndex, Fields()
                                   .number(offset)
                                   .number(at_ - offset)
                                   .number(std::uint64_t{0})
                                   .number(std::uint64_t{0})
                                   .number(static_cast<std::uint64_t>(data.size()))
                                   .text(name)
                                   .text(media_type)));
}

void McapWriter::describe(const std::string& name, const Map& metadata) {
  const std::uint64_t offset = at_;
  put(record(kMetadata, Fields().text(name).map(metadata)));
  metadata_indexes_.push_back(
      record(kMetadataIndex, Fields().number(offset).number(at_ - offset).text(name)));
}

void McapWriter::finish() {
  endChunk();
  put(record(kDataEnd, Fields().number(data_crc_)));

  const std::uint64_t summary = at_;
  std::string all;
  struct Group {
    Opcode opcode;
    std::uint64_t start, length;
  };
  std::vector<Group> groups;
  const auto group = [&](Opcode opcode, const std::vector<std::string>& records) {
    const std::uint64_t start = summary + all.size();
    for (const std::string& one : records) all += one;
    if (!records.empty()) groups.push_back({opcode, start, summary + all.size() - start});
  };
  group(kSchemaRecord, schemas_);
  std::vector<std::string> records;
  for (const Channel& channel : channels_) records.push_back(channel.record);
  group(kChannel, records);
  Fields counts;
  for (std::size_t i = 0; i < channels_.size(); ++i)
    if (channels_[i].messages > 0)
      counts.number(static_cast<std::uint16_t>(i)).number(channels_[i].messages);
  group(kStatistics,
        {record(kStatistics, Fields()
                                 .number(messages_)
                                 .number(static_cast<std::uint16_t>(schemas_.size()))
                                 .number(static_cast<std::uint32_t>(channels_.size()))
                                 .number(static_cast<std::uint32_t>(attachment_indexes_.size()))
                                 .number(static_cast<std::uint32_t>(metadata_indexes_.size()))
                                 .number(static_cast<std::uint32_t>(chunks_.size()))
                                 .number(start_)
                                 .number(end_)
                                 .text(counts.bytes()))});
  records.clear();
  for (const Chunk& chunk : chunks_) {
    Fields indexes;
    for (const auto& [channel, offset] : chunk.indexes) indexes.number(channel).number(offset);
    records.push_back(record(kChunkIndex, Fields()
                                              .number(chunk.start)
                                              .number(chunk.end)
                                              .number(chunk.offset)
                                              .number(chunk.length)
                                              .text(indexes.bytes())
                                              .number(chunk.index_length)
                                              .text("zstd")
                                              .number(chunk.compressed)
                                              .number(chunk.uncompressed)));
  }
  group(kChunkIndex, records);
  group(kAttachmentIndex, attachment_indexes_);
  group(kMetadataIndex, metadata_indexes_);
  const std::uint64_t offsets = summary + all.size();
  for (const Group& one : groups)
    all += record(kSummaryOffset, Fields()
                                      .number(static_cast<std::uint8_t>(one.opcode))
                                      .number(one.start)
                                      .number(one.length));
  // The footer's own checksum is over all of the summary and the footer up to it.
  constexpr std::uint64_t kFooterSize = 8 + 8 + 4;
  all += Fields()
             .number(static_cast<std::uint8_t>(kFooter))
             .number(kFooterSize)
             .number(summary)
             .number(offsets)
             .bytes();
  put(all + Fields().number(crc(all)).bytes() + std::string(kMagic, 8));
  file_.close();
  if (!file_) throw InputError(fmt::format("{}: {}", name_, std::strerror(errno)));
}

}  // namespace ves
