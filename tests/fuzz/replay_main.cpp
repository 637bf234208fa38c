// SPDX-License-Identifier: Apache-2.0
//
// Stands in for libFuzzer where it is not built in: runs every file of the corpus, then a fixed
// number of seeded mutations of them, through LLVMFuzzerTestOneInput. The same run every time.
// The input under test is kept beside the program as NAME.last_input, so a crash leaves it behind.
//
//     fuzz_NAME [--runs N] [--max-bytes N] CORPUS_DIRECTORY_OR_FILE...

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <random>
#include <string>
#include <vector>

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size);

namespace {

namespace fs = std::filesystem;

struct Arguments {
  size_t runs = 2000;
  size_t max_bytes = 65536;
  std::vector<fs::path> inputs;
};

Arguments parse(int argc, char** argv) {
  Arguments arguments;
  for (int i = 1; i < argc; ++i) {
    const std::string word = argv[i];
    const bool has_value = i + 1 < argc;
    if (word == "--runs" && has_value) {
      arguments.runs = std::stoul(argv[++i]);
    } else if (word == "--max-bytes" && has_value) {
      arguments.max_bytes = std::stoul(argv[++i]);
    } else {
      arguments.inputs.emplace_back(word);
    }
  }
  return arguments;
}

std::vector<fs::path> files_of(const std::vector<fs::path>& inputs) {
  std::vector<fs::path> files;
  for (const fs::path& input : inputs) {
    if (fs::is_directory(input)) {
      for (const auto& entry : fs::recursive_directory_iterator(input)) {
        if (entry.is_regular_file()) files.push_back(entry.path());
      }
    } else {
      files.push_back(input);
    }
  }
  std::sort(files.begin(), files.end());
  return files;
}

std::string content_of(const fs::path& path) {
  std::ifstream stream(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>()};
}

/// Changes one to four places of a text: bytes, ranges, numbers, or a piece of another file.
class Mutator {
 public:
  explicit Mutator(const std::vector<std::string>& corpus) : corpus_(corpus) {}

  std::string mutate(std::string text) {
    const size_t edits = 1 + below(4);
    for (size_t i = 0; i < edits; ++i) edit(text);
    return text;
  }

  size_t below(size_t limit) { return limit == 0 ? 0 : rng_() % limit; }

 private:
  void edit(std::string& text) {
    static const char* const kTokens[] = {
        "nan", "inf", "-1", "0",  "99999999999999999999", "4294967295", "1e308", "-0.0",
        "\n",  "[",   "\"", "\t#"};
    const size_t at = below(text.size() + 1);
    const size_t length = std::min(text.size() - at, below(24));
    switch (below(7)) {
      case 0:
        if (at < text.size()) text[at] = static_cast<char>(rng_() & 0xff);
        break;
      case 1:
        if (at < text.size()) text[at] = static_cast<char>(text[at] ^ (1 << below(8)));
        break;
      case 2:
        text.erase(at, length);
        break;
      case 3:
        text.insert(at, text.substr(at, length));
        break;
      case 4:
        text.replace(at, length, kTokens[below(std::size(kTokens))]);
        break;
      case 5:
        text.resize(at);
        break;
      default: {
        const std::string& other = corpus_[below(corpus_.size())];
        text.insert(at, other.substr(below(other.size() + 1), below(200)));
      }
    }
  }

  const std::vector<std::string>& corpus_;
  std::mt19937_64 rng_{20240229};
};

/// Keeps the input under test in a file, for when the program dies of it.
class LastInput {
 public:
  explicit LastInput(std::string path)
      : path_(std::move(path)), fd_(::open(path_.c_str(), O_WRONLY | O_CREAT | O_CLOEXEC, 0644)) {}
  LastInput(const LastInput&) = delete;
  LastInput& operator=(const LastInput&) = delete;
  ~LastInput() {
    ::close(fd_);
    fs::remove(path_);
  }

  void keep(const std::string& text) const {
    const ssize_t written = ::pwrite(fd_, text.data(), text.size(), 0);
    if (written < 0 || ::ftruncate(fd_, written) != 0) std::perror(path_.c_str());
  }

 private:
  std::string path_;
  int fd_;
};

void run(const std::string& text, const LastInput& last_input) {
  last_input.keep(text);
  LLVMFuzzerTestOneInput(reinterpret_cast<const uint8_t*>(text.data()), text.size());
}

}  // namespace

int main(int argc, char** argv) {
  const Arguments arguments = parse(argc, argv);
  std::vector<std::string> corpus;
  for (const fs::path& file : files_of(arguments.inputs)) {
    corpus.push_back(content_of(file).substr(0, arguments.max_bytes));
  }
  if (corpus.empty()) {
    std::fprintf(stderr, "usage: %s [--runs N] [--max-bytes N] CORPUS...\n", argv[0]);
    return 2;
  }
  const LastInput last_input(std::string(argv[0]) + ".last_input");
  for (const std::string& text : corpus) run(text, last_input);
  Mutator mutator(corpus);
  for (size_t i = 0; i < arguments.runs; ++i) {
    run(mutator.mutate(corpus[mutator.below(corpus.size())]).substr(0, arguments.max_bytes),
        last_input);
  }
  std::printf("%zu files and %zu mutations of them\n", corpus.size(), arguments.runs);
  return 0;
}
