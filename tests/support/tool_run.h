#pragma once
// Helpers for tests that run the command-line tools: a temporary folder, a command and its output.

#include <algorithm>
#include <array>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

#include <sys/wait.h>
#include <unistd.h>

#include <catch2/catch.hpp>

namespace lobe::test {

/// A temporary folder that is removed with its content in the destructor.
class Folder {
 public:
  Folder() {
    std::string name = (std::filesystem::temp_directory_path() / "lobe-test-XXXXXX").string();
    REQUIRE(mkdtemp(name.data()) != nullptr);
    path_ = name;
  }
  Folder(const Folder&) = delete;
  Folder& operator=(const Folder&) = delete;
  ~Folder() { std::filesystem::remove_all(path_); }
  const std::filesystem::path& path() const { return path_; }
  std::filesystem::path operator/(const std::string& name) const { return path_ / name; }
  /// Returns the path of the file.
  std::filesystem::path write(const std::string& name, const std::string& bytes) const {
    std::ofstream(path_ / name, std::ios::binary) << bytes;
    return path_ / name;
  }
  long files() const {
    return std::distance(std::filesystem::directory_iterator(path_), std::filesystem::directory_iterator());
  }

 private:
  std::filesystem::path path_;
};

inline std::string readFile(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

inline long lineCount(const std::string& text) {
  return std::ranges::count(text, '\n');
}

struct ToolRun {
  int code;  ///< exit code, −1 if ended by a signal
  std::string out, error;
};

/// Runs one of our tools in folder through the shell. The captured output is stored elsewhere.
inline ToolRun runBinary(const std::filesystem::path& folder, const std::string& arguments) {
  const Folder caught;
  const std::filesystem::path out = caught / "out", error = caught / "error";
  const std::string command =
      "cd '" + folder.string() + "' && " LOBE_BIN_DIR "/" + arguments + " >" + out.string() + " 2>" + error.string();
  const int status = std::system(command.c_str());
  return {WIFEXITED(status) ? WEXITSTATUS(status) : -1, readFile(out), readFile(error)};
}

}  // namespace lobe::test
