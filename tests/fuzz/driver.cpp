// SPDX-License-Identifier: BSD-3-Clause
//
// Runs a fuzz target without libFuzzer: the files of a folder, and seeded mutations of them.
//   TARGET FOLDER RUNS [SEED]
#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <random>
#include <vector>

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size);

int main(int argc, char** argv) {
  if (argc < 3) {
    std::fprintf(stderr, "usage: %s FOLDER RUNS [SEED]\n", argv[0]);
    return 2;
  }
  using Input = std::vector<std::uint8_t>;
  std::vector<Input> seeds = {{}};
  std::vector<std::filesystem::path> files;
  for (const auto& entry : std::filesystem::directory_iterator(argv[1]))
    files.push_back(entry.path());
  std::sort(files.begin(), files.end());
  for (const auto& file : files) {
    std::ifstream in(file, std::ios::binary);
    seeds.emplace_back(std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>());
  }
  std::mt19937 random(argc > 3 ? static_cast<unsigned>(std::atol(argv[3])) : 1u);
  const auto pick = [&](std::size_t n) { return n ? random() % n : 0; };
  const long runs = std::atol(argv[2]);
  for (const Input& seed : seeds) LLVMFuzzerTestOneInput(seed.data(), seed.size());
  for (long i = 0; i < runs; ++i) {
    Input input = seeds[pick(seeds.size())];
    for (std::size_t edits = 1 + pick(8); edits > 0; --edits) {
      const std::size_t at = pick(input.size() + 1);
      const auto here = input.begin() + static_cast<std::ptrdiff_t>(at);
      const auto byte = static_cast<std::uint8_t>(random());
      switch (pick(5)) {
        case 0:
          if (here != input.end()) *here = byte;
          break;
        case 1:
          if (here != input.end()) *here = static_cast<std::uint8_t>(*here ^ (1u << pick(8)));
          break;
        case 2: input.insert(here, 1 + pick(16), byte); break;
        case 3:
          input.erase(here, here + static_cast<std::ptrdiff_t>(
                                       pick(std::min<std::size_t>(16, input.size() - at) + 1)));
          break;
        default: {
          const Input& other = seeds[pick(seeds.size())];
          const std::size_t from = pick(other.size() + 1);
          const std::size_t n = pick(std::min<std::size_t>(256, other.size() - from) + 1);
          input.insert(here, other.begin() + static_cast<std::ptrdiff_t>(from),
                       other.begin() + static_cast<std::ptrdiff_t>(from + n));
        }
      }
    }
    LLVMFuzzerTestOneInput(input.data(), input.size());
  }
  return 0;
}
