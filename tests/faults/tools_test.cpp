// Faults in lobecompare and lobedump, whose main functions run in this process: if a write or read fails, the exit code
// is not 0, a message says so, and nothing is half-written; or the outputs are those of a run without faults.

#include <cstdio>
#include <filesystem>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

#include <unistd.h>

#include <catch2/catch.hpp>

#include "runtime/image/aov.h"
#include "runtime/image/image_output.h"
#include "tests/faults/injection.h"
#include "tests/support/loberender_test_tools.h"

using Main = int(int argc, char** argv);
// Their source files are compiled for this program with these names (tests/CMakeLists.txt).
Main lobecompareMain, lobedumpMain;

namespace {

using namespace lobe;
using namespace lobe::test;
namespace fs = std::filesystem;

/// While it exists, a standard stream goes to a file.
class Redirected {
 public:
  Redirected(std::FILE* stream, const fs::path& path) : stream_(stream) {
    std::fflush(stream);
    before_ = dup(fileno(stream));
    std::FILE* const file = std::fopen(path.c_str(), "wb");  // not made to fail, unlike open
    REQUIRE(file);
    dup2(fileno(file), fileno(stream));
    std::fclose(file);
  }
  Redirected(const Redirected&) = delete;
  Redirected& operator=(const Redirected&) = delete;
  ~Redirected() {
    std::fflush(stream_);
    dup2(before_, fileno(stream_));
    close(before_);
  }

 private:
  std::FILE* stream_;
  int before_;
};

/// A tool and its arguments, in which @ stands for a folder.
class Command {
 public:
  Command(Main* tool, const fs::path& folder, const std::string& line)
      : tool_(tool), printed_(folder / "printed"), errors_(folder / "errors") {
    std::istringstream words(line);
    for (std::string word; words >> word;) {
      if (word.starts_with("@")) word.replace(0, 1, folder.string());
      words_.push_back(word);
    }
    for (std::string& word : words_) arguments_.push_back(word.data());
  }
  Command(const Command&) = delete;
  Command& operator=(const Command&) = delete;

  /// Throws if the exit code is not 0, and checks the message.
  void run() {
    int code = 0;
    {
      const Redirected printed(stdout, printed_), errors(stderr, errors_);
      code = tool_(static_cast<int>(arguments_.size()), arguments_.data());
    }
    if (code == 0) return;
    const std::string errors = readFile(errors_);
    CAPTURE(code, errors);
    // CLI11 takes values for invalid ones if it has too little memory to convert them.
    CHECK((code == 1 || (code == 2 && errors.find("--help") != std::string::npos)));
    CHECK(errors.starts_with(words_.front() + ": error: "));
    CHECK(errors.ends_with("\n"));
    throw std::runtime_error(errors);
  }

  /// What it has printed.
  std::string printed() const { return readFile(printed_); }

 private:
  Main* tool_;
  fs::path printed_, errors_;
  std::vector<std::string> words_;
  std::vector<char*> arguments_;
};

/// Runs each command line, whose first word is the name of the tool, with faults. Not of allocations: CLI11 and the
/// JSON library allocate in functions that must not throw, where a failure ends the program.
void injectInto(Countdown& countdown, Main* tool, const fs::path& folder, const std::vector<std::string>& lines) {
  for (const std::string& line : lines) {
    if (&countdown == &writes && line.find("@/out") == std::string::npos) continue;  // it writes no file
    Command command(tool, folder, line);
    CHECK(inject(countdown, {line, folder / "out", [&] { command.run(); }, [&] { return command.printed(); }}) > 0);
  }
}

/// A picture with AOVs and a long list of sample ranges.
void writePicture(const fs::path& path, float scale, const std::string& ranges) {
  Image image(16, 12);
  for (std::size_t i = 0; i < image.pixels.size(); ++i) image.pixels[i] = grey(scale * static_cast<float>(1 + i % 7));
  const Aovs aovs{{Aov::albedo, image}, {Aov::depth, image}, {Aov::variance, image}};
  writeImage(path, image, {{"integrator", "product"}, {"samples", 4.0}, {"sampleRanges", ranges}}, layersOf(aovs));
}

void injectIntoComparisons(Countdown& countdown) {
  const Folder folder;
  writePicture(folder / "a.exr", 1.0f, "product 123456789 0 2, product 123456789 4 6");
  writePicture(folder / "b.exr", 1.5f, "product 987654321 0 2, product 987654321 4 6");
  injectInto(countdown, lobecompareMain, folder.path(),
             {"lobecompare @/a.exr @/b.exr --map @/out/map.png", "lobecompare @/a.exr @/b.exr --json",
              "lobecompare --pair @/a.exr @/b.exr --map @/out/map.png",
              "lobecompare @/a.exr @/b.exr --merge @/out/merged.exr --variance @/out/variance.exr",
              "lobecompare --png @/a.exr @/out/a.png"});
}

void injectIntoDumps(Countdown& countdown) {
  const SceneFolder folder(true);
  REQUIRE(folder.run(kRender + " --save-illumination a.illum").code == 0);
  fs::rename(folder.caches().front(), folder / "a.lobe");
  injectInto(countdown, lobedumpMain, folder.path(),
             {"lobedump @/a.lobe --records --json", "lobedump @/a.lobe --plot @/out/a.png --record 0",
              "lobedump @/a.lobe --html @/out/a.html --scene @/scene.xml", "lobedump @/a.illum --records",
              "lobedump @/a.illum --html @/out/a.html", "lobedump @/a.illum --points @/out/a.ply"});
}

}  // namespace

TEST_CASE("faults: failing writes and reads of lobecompare") {
  for (Countdown* countdown : {&writes, &reads}) injectIntoComparisons(*countdown);
}

TEST_CASE("faults: failing writes and reads of lobedump") {
  for (Countdown* countdown : {&writes, &reads}) injectIntoDumps(*countdown);
}
