// SPDX-License-Identifier: Apache-2.0
// The one target of this program for libFuzzer. `PROGRAM --write-seeds FOLDER` writes its seeds and ends.
#include <fstream>

#include "fuzz.hpp"

extern "C" int LLVMFuzzerInitialize(int* argc, char*** argv) {
  if (fuzz::targets().size() != 1) fuzz::finding("not one target in this program");
  if (*argc == 3 && std::string_view((*argv)[1]) == "--write-seeds") {
    const std::vector<fuzz::Bytes> seeds = fuzz::targets().front().seeds();
    for (std::size_t k = 0; k < seeds.size(); ++k) {
      std::ofstream file((*argv)[2] + std::string("/seed-") + std::to_string(k), std::ios::binary);
      file.write(reinterpret_cast<const char*>(seeds[k].data()),
                 static_cast<std::streamsize>(seeds[k].size()));
      if (!file) fuzz::finding("a seed could not be written");
    }
    std::exit(0);
  }
  return 0;
}

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  fuzz::targets().front().run(fuzz::Input(data, size));
  return 0;
}

extern "C" std::size_t LLVMFuzzerCustomMutator(std::uint8_t* data, std::size_t size, std::size_t capacity,
                                               unsigned seed) {
  const fuzz::Target& target = fuzz::targets().front();
  return target.mutate != nullptr ? target.mutate(data, size, capacity, seed)
                                  : LLVMFuzzerMutate(data, size, capacity);
}
