// SPDX-License-Identifier: BSD-3-Clause
#include "ves/export/parquet.hpp"

#include <algorithm>
#include <cerrno>
#include <cstring>

#include "ves/core/errors.hpp"
#include "zstd.hpp"

namespace ves {
namespace {

constexpr char kEnds[] = "PAR1";
constexpr std::size_t kGroup = 1 << 16;  // [-] rows that are written at a time

// parquet.thrift's numbers.
enum { kDouble = 5, kByteArray = 6 };  // Type
enum { kOptional = 1 };                // Repetition
enum { kUtf8 = 0 };                    // Converted
enum { kPlain = 0, kRle = 3 };         // Encoding
enum { kZstd = 6 };                    // Codec
enum { kDataPage = 0 };                // Page

void littleEndian(std::uint64_t value, std::size_t size, std::string& out) {
  for (std::size_t i = 0; i < size; ++i) out += static_cast<char>(value >> (8 * i) & 0xff);
}

void varint(std::uint64_t value, std::string& out) {
  for (; value >= 0x80; value >>= 7) out += static_cast<char>(value | 0x80);
  out += static_cast<char>(value);
}

/// A struct of Thrift's compact protocol; its fields in the order of their numbers.
class Struct {
 public:
  Struct& number(int field, std::int64_t value) {
    begin(field, kI64);
    zigzag(value);
    return *this;
  }
  /// Of 32 bits, or one of a list of names.
  Struct& small(int field, std::int32_t value) {
    begin(field, kI32);
    zigzag(value);
    return *this;
  }
  Struct& text(int field, std::string_view value) {
    begin(field, kBinary);
    bytes(value);
    return *this;
  }
  Struct& inside(int field, const Struct& value) {
    begin(field, kStruct);
    bytes_ += value.encoded();
    return *this;
  }
  Struct& list(int field, const std::vector<Struct>& values) {
    beginList(field, kStruct, values.size());
    for (const Struct& value : values) bytes_ += value.encoded();
    return *this;
  }
  Struct& list(int field, const std::vector<std::int32_t>& values) {
    beginList(field, kI32, values.size());
    for (const std::int32_t value : values) zigzag(value);
    return *this;
  }
  Struct& list(int field, const std::vector<std::string>& values) {
    beginList(field, kBinary, values.size());
    for (const std::string& value : values) bytes(value);
    return *this;
  }
  std::string encoded() const { return bytes_ + '\0'; }

 private:
  enum Kind { kI32 = 5, kI64 = 6, kBinary = 8, kList = 9, kStruct = 12 };

  void begin(int field, Kind kind) {
    bytes_ += static_cast<char>((field - last_) << 4 | kind);
    last_ = field;
  }
  void beginList(int field, Kind kind, std::size_t size) {
    constexpr std::size_t kShort = 15;
    begin(field, kList);
    bytes_ += static_cast<char>(std::min(size, kShort) << 4 | static_cast<std::size_t>(kind));
    if (size >= kShort) varint(size, bytes_);
  }
  void zigzag(std::int64_t value) {
    varint(static_cast<std::uint64_t>(value) << 1 ^ static_cast<std::uint64_t>(value >> 63),
           bytes_);
  }
  void bytes(std::string_view value) {
    varint(value.size(), bytes_);
    bytes_ += value;
  }

  std::string bytes_;
  int last_ = 0;
};

/// Whether each value is there, as one run of bits.
std::string levels(const std::vector<bool>& present) {
  const std::size_t bytes = (present.size() + 7) / 8;
  std::string run;
  varint(bytes << 1 | 1, run);
  const std::size_t begin = run.size();
  run.resize(begin + bytes);
  for (std::size_t i = 0; i < present.size(); ++i)
    if (present[i]) run[begin + i / 8] = static_cast<char>(run[begin + i / 8] | 1 << i % 8);
  std::string out;
  littleEndian(run.size(), 4, out);
  return out + run;
}

std::int32_t typeOf(const ParquetWriter::Column& column) {
  return column.words ? kByteArray : kDouble;
}

}  // namespace

ParquetWriter::ParquetWriter(const std::string& file, const std::vector<Column>& columns,
                             const Map& about)
    : file_(file), out_(file, std::ios::binary), about_(about) {
  for (const Column& column : columns) columns_.push_back({column, {}, {}});
  put(kEnds);
}

void ParquetWriter::add(double cell) {
  std::uint64_t bits = 0;
  std::memcpy(&bits, &cell, sizeof bits);
  littleEndian(bits, sizeof bits, columns_[at_].values);
  next(true);
}

void ParquetWriter::add(std::string_view cell) {
  littleEndian(cell.size(), 4, columns_[at_].values);
  columns_[at_].values += cell;
  next(true);
}

void ParquetWriter::add() { next(false); }

void ParquetWriter::next(bool present) {
  columns_[at_].present.push_back(present);
  at_ = (at_ + 1) % columns_.size();
  if (at_ == 0 && columns_[0].present.size() == kGroup) writeGroup();
}

void ParquetWriter::writeGroup() {
  if (columns_[0].present.empty()) return;
  const std::size_t rows = columns_[0].present.size();
  Group group{static_cast<std::int64_t>(rows), {}};
  for (Pending& pending : columns_) {
    const std::string page = levels(pending.present) + pending.values,
                      small = compressed(page, file_);
    const std::string header = Struct()
                                   .small(1, kDataPage)
                                   .small(2, static_cast<std::int32_t>(page.size()))
                                   .small(3, static_cast<std::int32_t>(small.size()))
                                   .inside(5, Struct()
                                                  .small(1, static_cast<std::int32_t>(rows))
                                                  .small(2, kPlain)
                                                  .small(3, kRle)
                                                  .small(4, kRle))
                                   .encoded();
    group.chunks.push_back({offset_, static_cast<std::int64_t>(header.size() + small.size()),
                            static_cast<std::int64_t>(header.size() + page.size())});
    put(header + small);
    pending.values.clear();
    pending.present.clear();
  }
  groups_.push_back(std::move(group));
}

void ParquetWriter::finish() {
  writeGroup();
  std::vector<Struct> schema, groups, about;
  schema.push_back(Struct().text(4, "schema").small(5, static_cast<std::int32_t>(columns_.size())));
  for (const auto& [column, values, present] : columns_) {
    schema.push_back(Struct().small(1, typeOf(column)).small(3, kOptional).text(4, column.name));
    if (column.words) schema.back().small(6, kUtf8);
  }
  std::int64_t rows = 0;
  for (const Group& group : groups_) {
    std::vector<Struct> chunks;
    std::int64_t size = 0;
    for (std::size_t i = 0; i < columns_.size(); ++i) {
      const Chunk& chunk = group.chunks[i];
      chunks.push_back(
          Struct()
              .number(2, chunk.offset)
              .inside(3, Struct()
                             .small(1, typeOf(columns_[i].column))
                             .list(2, std::vector<std::int32_t>{kPlain, kRle})
                             .list(3, std::vector<std::string>{columns_[i].column.name})
                             .small(4, kZstd)
                             .number(5, group.rows)
                             .number(6, chunk.uncompressed)
                             .number(7, chunk.compressed)
                             .number(9, chunk.offset)));
      size += chunk.uncompressed;
    }
    groups.push_back(Struct().list(1, chunks).number(2, size).number(3, group.rows));
    rows += group.rows;
  }
  for (const auto& [key, value] : about_) about.push_back(Struct().text(1, key).text(2, value));
  std::string footer =
      Struct().small(1, 1).list(2, schema).number(3, rows).list(4, groups).list(5, about).encoded();
  littleEndian(footer.size(), 4, footer);
  put(footer + kEnds);
  out_.close();
  if (!out_) throw InputError(file_ + ": " + std::strerror(errno));
}

void ParquetWriter::put(const std::string& bytes) {
  errno = 0;
  out_ << bytes;
  if (!out_) throw InputError(file_ + ": " + std::strerror(errno));
  offset_ += static_cast<std::int64_t>(bytes.size());
}

}  // namespace ves
