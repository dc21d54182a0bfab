// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// Stands in for libFuzzer where it is not available. Runs every file of the corpus folders unchanged, then a
// fixed number of mutations. The same seed gives the same inputs, so failures are repeatable.
#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <random>
#include <vector>

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size);

namespace {

using Input = std::vector<std::uint8_t>;

constexpr int mutations = 2000;
constexpr unsigned seed = 1;
constexpr std::size_t input_octets_max = 8192;

std::vector<Input> read_folder(const std::filesystem::path& folder) {
  std::vector<std::filesystem::path> files;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    if (entry.is_regular_file()) files.push_back(entry.path());
  }
  std::sort(files.begin(), files.end());  // the order of a folder differs between file systems
  std::vector<Input> inputs;
  for (const auto& path : files) {
    std::ifstream file(path, std::ios::binary);
    inputs.emplace_back(std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>());
  }
  return inputs;
}

class Mutator {
 public:
  explicit Mutator(const std::vector<Input>& corpus) : corpus_(corpus) {}

  Input next() {
    Input input = pick();
    for (std::size_t changes = 1 + below(8); changes-- > 0;) change(input);
    if (input.size() > input_octets_max) input.resize(input_octets_max);
    return input;
  }

 private:
  void change(Input& input) {
    const std::size_t at = below(input.size() + 1);
    const auto place = input.begin() + static_cast<std::ptrdiff_t>(at);
    switch (below(6)) {
      case 0:
        if (at < input.size()) input[at] ^= static_cast<std::uint8_t>(1U << below(8));
        break;
      case 1:
        if (at < input.size()) input[at] = static_cast<std::uint8_t>(random_());
        break;
      case 2:
        input.insert(place, static_cast<std::uint8_t>(random_()));
        break;
      case 3:
        input.erase(place, place + static_cast<std::ptrdiff_t>(
                                       below(std::min<std::size_t>(input.size() - at, 16) + 1)));
        break;
      case 4:
        input.resize(at);
        break;
      default: {
        const Input other = pick();
        input.insert(place, other.begin(), other.end());
      }
    }
  }

  Input pick() { return corpus_.empty() ? Input{} : corpus_[below(corpus_.size())]; }
  std::size_t below(std::size_t bound) { return static_cast<std::size_t>(random_() % bound); }

  const std::vector<Input>& corpus_;
  std::mt19937_64 random_{seed};
};

void run(const Input& input) {
  // A copy of exact size, so that AddressSanitizer detects an access one octet past the end.
  const Input exact(input.begin(), input.end());
  LLVMFuzzerTestOneInput(exact.data(), exact.size());
}

}  // namespace

int main(int argc, char** argv) {
  try {
    std::vector<Input> corpus;
    for (int i = 1; i < argc; ++i) {
      for (Input& input : read_folder(argv[i])) corpus.push_back(std::move(input));
    }
    if (corpus.empty()) {
      std::fprintf(stderr, "usage: %s CORPUS_FOLDER...   (with at least one file)\n", argv[0]);
      return 2;
    }
    for (const Input& input : corpus) run(input);
    Mutator mutator(corpus);
    for (int i = 0; i < mutations; ++i) run(mutator.next());
    std::printf("%zu inputs and %d mutations\n", corpus.size(), mutations);
    return 0;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 2;
  }
}
