// SPDX-License-Identifier: Apache-2.0
// The fuzz targets as a test for any compiler: every seed, every file that is named or lies in a named folder, and mutations of
// the seeds.
//
//     replay --targets                             their names
//     replay TARGET [--mutations N] [FILE|FOLDER…]
#include <algorithm>
#include <filesystem>
#include <fstream>
#include <iterator>

#include "fuzz.hpp"

namespace {

fuzz::Random& numbers() {
  static fuzz::Random random(1);
  return random;
}

fuzz::Bytes read(const std::filesystem::path& path) {
  std::ifstream stream(path, std::ios::binary);
  if (!stream) fuzz::finding("cannot read " + path.string());
  return {std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>()};
}

int use() {
  std::fprintf(stderr, "usage: replay --targets | TARGET [--mutations N] [FILE|FOLDER...]\n");
  return 2;
}

}  // namespace

extern "C" std::size_t LLVMFuzzerMutate(std::uint8_t* data, std::size_t size, std::size_t capacity) {
  fuzz::Random& random = numbers();
  const std::size_t at = random.below(size);
  switch (size == 0 ? 3U : random.below(4)) {
    case 0:
      data[at] = static_cast<std::uint8_t>(random());
      return size;
    case 1:
      data[at] ^= static_cast<std::uint8_t>(1U << random.below(8));
      return size;
    case 2: {
      const std::size_t length = std::min<std::size_t>(1 + random.below(8), size - at);
      std::memmove(data + at, data + at + length, size - at - length);
      return size - length;
    }
    default: {
      const std::size_t length = std::min<std::size_t>(1 + random.below(8), capacity - size);
      std::memmove(data + at + length, data + at, size - at);
      for (std::size_t k = 0; k < length; ++k) data[at + k] = static_cast<std::uint8_t>(random());
      return size + length;
    }
  }
}

int main(int argc, char** argv) {
  const std::vector<std::string> arguments(argv + 1, argv + argc);
  if (arguments.empty()) return use();
  if (arguments[0] == "--targets") {
    for (const fuzz::Target& t : fuzz::targets()) std::printf("%s\n", t.name);
    return 0;
  }
  const auto target = std::find_if(fuzz::targets().begin(), fuzz::targets().end(),
                                   [&](const fuzz::Target& t) { return t.name == arguments[0]; });
  if (target == fuzz::targets().end()) return use();
  int mutations = 0;
  std::size_t files = 0;
  const auto replay = [&](const std::filesystem::path& path) {
    // What a crash was caused by is the last line.
    std::printf("%s\n", path.c_str());
    std::fflush(stdout);
    target->run(fuzz::Input(read(path)));
    ++files;
  };
  for (std::size_t k = 1; k < arguments.size(); ++k) {
    if (arguments[k] == "--mutations" && k + 1 < arguments.size()) {
      mutations = std::atoi(arguments[++k].c_str());
    } else if (std::filesystem::is_directory(arguments[k])) {
      std::vector<std::filesystem::path> paths;
      for (const auto& entry : std::filesystem::directory_iterator(arguments[k]))
        paths.push_back(entry.path());
      std::sort(paths.begin(), paths.end());
      for (const auto& path : paths) replay(path);
    } else {
      replay(arguments[k]);
    }
  }
  const std::vector<fuzz::Bytes> seeds = target->seeds();
  for (const fuzz::Bytes& seed : seeds) target->run(fuzz::Input(seed));
  for (int k = 0; k < mutations; ++k) {
    fuzz::Bytes bytes = seeds[numbers().below(seeds.size())];
    std::size_t size = bytes.size();
    const std::size_t capacity = size + 64;
    bytes.resize(capacity);
    for (unsigned n = 1 + numbers().below(4); n != 0; --n) {
      size = target->mutate != nullptr ? target->mutate(bytes.data(), size, capacity, numbers()())
                                       : LLVMFuzzerMutate(bytes.data(), size, capacity);
    }
    bytes.resize(size);
    target->run(fuzz::Input(bytes));
  }
  std::printf("%s: %zu files, %zu seeds, %d mutations\n", target->name, files, seeds.size(), mutations);
  return 0;
}
