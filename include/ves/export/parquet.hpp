// SPDX-License-Identifier: BSD-3-Clause
//
// Tables in files of the Parquet format (parquet.apache.org), version 1: columns of numbers and of
// words, plain, compressed by zstd. The same calls make the same bytes.
#pragma once

#include <cstdint>
#include <fstream>
#include <map>
#include <string>
#include <string_view>
#include <vector>

namespace ves {

class ParquetWriter {
 public:
  struct Column {
    std::string name;
    bool words = false;  // UTF-8; else doubles
  };
  /// What readers show as the file's metadata.
  using Map = std::map<std::string, std::string>;

  /// Throws InputError when the file cannot be written, here and later.
  ParquetWriter(const std::string& file, const std::vector<Column>& columns, const Map& about);

  /// The next cell, row by row; `cell` is of a column of words, `add()` of either: null.
  void add(double cell);
  void add(std::string_view cell);
  void add();

  /// The table's description, and the end. Nothing may follow.
  void finish();

 private:
  /// A column of the rows that are not written yet.
  struct Pending {
    Column column;
    std::string values;         // one after the other
    std::vector<bool> present;  // one a row
  };
  /// Where a column of a group of rows is.
  struct Chunk {
    std::int64_t offset, compressed, uncompressed;  // [B] with its header
  };
  struct Group {
    std::int64_t rows;
    std::vector<Chunk> chunks;
  };

  void next(bool present);
  void writeGroup();
  void put(const std::string& bytes);

  std::string file_;
  std::ofstream out_;
  Map about_;
  std::vector<Pending> columns_;
  std::vector<Group> groups_;
  std::size_t at_ = 0;       // the next cell's column
  std::int64_t offset_ = 0;  // [B] written
};

}  // namespace ves
