// What the tools do when files, pipes and signals fail: diagnostics are never essential, one output does not take the
// others with it, and inputs are never overwritten.

#include <chrono>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <set>
#include <span>
#include <string>
#include <thread>
#include <vector>

#include <fcntl.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <fmt/format.h>
#include <catch2/catch.hpp>

#include "runtime/image/image.h"
#include "runtime/image/image_output.h"
#include "runtime/tools/checkpoint.h"
#include "tests/support/json.h"
#include "tests/support/loberender_test_tools.h"

using namespace lobe;
using namespace lobe::test;
namespace fs = std::filesystem;
using Catch::Contains;

namespace {

const std::string kPath = "loberender scene.xml --integrator path";

/// A command that runs for minutes unless it is interrupted.
const std::string kLong = kPath + " -o a.exr --spp 1000000000";

/// Runs a tool in the background.
class Background {
 public:
  Background(const SceneFolder& folder, const std::string& arguments) : process_(fork()) {
    if (process_ != 0) return;
    // A shell would ignore SIGINT in its background jobs.
    std::signal(SIGINT, SIG_DFL);
    const std::string command =
        "cd '" + folder.path().string() + "' && exec " LOBE_BIN_DIR "/" + arguments + " >out 2>error";
    execl("/bin/sh", "sh", "-c", command.c_str(), nullptr);
    _exit(127);
  }
  Background(const Background&) = delete;
  Background& operator=(const Background&) = delete;
  ~Background() {
    if (running_) send(SIGKILL), wait();
  }

  void send(int signal) const { kill(process_, signal); }
  /// The exit code, or −1 if it was ended by a signal.
  int wait() {
    int status = 0;
    waitpid(process_, &status, 0);
    running_ = false;
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  }

 private:
  pid_t process_;
  bool running_ = true;
};

/// Waits until the condition holds; fails the test after a long time.
template <class Condition>
void waitFor(const Condition& condition) {
  for (int i = 0; i < 6000 && !condition(); ++i) std::this_thread::sleep_for(std::chrono::milliseconds(10));
  REQUIRE(condition());
}

/// Hidden files are temporary files.
long hiddenFiles(const fs::path& folder) {
  return std::ranges::count_if(fs::directory_iterator(folder),
                               [](const auto& entry) { return entry.path().filename().string().starts_with("."); });
}

ImageAttributes attributesOf(const SceneFolder& folder, const std::string& name) {
  return readAttributes(folder / name);
}

std::string runIn(const SceneFolder& folder, const std::string& shell) {
  const std::string command = "cd '" + folder.path().string() + "' && " + shell;
  const int status = std::system(command.c_str());
  return WIFEXITED(status) ? std::to_string(WEXITSTATUS(status)) : "signal";
}

/// A scene for which a note is printed after reading.
std::string sceneWithNote() {
  std::string text = kScene;
  return text.insert(text.find("<sensor"), "<integrator type=\"volpath\"/>");
}

const std::string kBin = LOBE_BIN_DIR "/";

}  // namespace

TEST_CASE("tools: a full or closed standard error loses nothing") {
  const SceneFolder folder(false);
  folder.write("noted.xml", sceneWithNote());
  const std::string render = kBin + "loberender noted.xml --integrator path --spp 1 -o ";
  CHECK(runIn(folder, render + "full.exr 2>/dev/full") == "0");
  CHECK(runIn(folder, render + "closed.exr 2>&-") == "0");
  CHECK(runIn(folder, render + "all.exr <&- >&- 2>&-") == "0");
  CHECK(runIn(folder, "(" + render + "pipe.exr; echo $? >code) 2>&1 | true; grep -q 0 code") == "0");
  for (const char* name : {"full.exr", "closed.exr", "all.exr", "pipe.exr"})
    CHECK(folder.bytes(name) == folder.bytes("full.exr"));
  CHECK(runIn(folder, kBin + "loberender none.xml -o a.exr --spp 1 2>/dev/full") == "1");
  CHECK(runIn(folder, kBin + "loberender --none 2>/dev/full") == "2");
  CHECK(runIn(folder, kBin + kQuickFit + " >/dev/null 2>/dev/full") == "0");
  CHECK(runIn(folder, kBin + kQuickFit + " --force >/dev/null 2>&-") == "0");
}

TEST_CASE("tools: help and results that cannot be printed are errors") {
  const SceneFolder folder(true);
  for (const std::string tool : {"loberender", "lobefit", "lobedump", "lobecompare"})
    for (const std::string option : {" --help", " --version"}) {
      CAPTURE(tool, option);
      CHECK(runIn(folder, kBin + tool + option + " >/dev/full 2>/dev/null") == "1");
      CHECK(runIn(folder, kBin + tool + option + " >&- 2>/dev/null") == "1");
      CHECK(runIn(folder, kBin + tool + option + " >/dev/null") == "0");
    }
  // Longer output fails when it is printed, shorter output at the end.
  for (const std::string arguments :
       {"lobedump lobes/*.lobe", "lobedump --json lobes/*.lobe lobes/*.lobe lobes/*.lobe lobes/*.lobe lobes/*.lobe",
        "lobefit scene.xml --elevations 4 --samples 256 --json"}) {
    CAPTURE(arguments);
    CHECK(runIn(folder, kBin + arguments + " >/dev/full 2>error") == "1");
    CHECK_THAT(folder.bytes("error"), Contains(": error: cannot write to standard output: No space left on device\n"));
  }
}

TEST_CASE("tools: end quietly when the reader of their output has ended") {
  const SceneFolder folder(false);
  // The other side of the pipe is closed before anything is printed.
  CHECK(runIn(folder, "{ sleep 0.3; " + kBin + "lobefit --help 2>error; echo $? >code; } | true; grep -q 141 code") ==
        "0");
  CHECK(folder.bytes("error").empty());
}

TEST_CASE("tools: a wrong name of a value is one line with the permitted names") {
  const SceneFolder folder(false);
  for (const auto& [option, names] :
       {std::pair("--sampler", "sobol, independent"), std::pair("--russian-roulette", "throughput, efficiency"),
        std::pair("--integrator", "auto, path, bdpt, vcm, guided, product"),
        std::pair("--bsdf-fraction", "fixed, learnt"), std::pair("--train", "both, paths, photons")}) {
    const std::string line = fault(folder, kRender + " " + option + " bogus", 2);
    CHECK_THAT(line, Contains(std::string(option) + ": must be one of " + names + ", not 'bogus'"));
    CHECK_THAT(fault(folder, kRender + " " + option + " 1", 2), Contains("must be one of"));
  }
}

TEST_CASE("tools: an empty value of an option is wrong usage") {
  const SceneFolder folder(false);
  const std::string render = kPath + " --spp 1 -o a.exr ";
  std::vector<std::pair<std::string, std::string>> cases;
  for (const std::string option :
       {"--resume", "--checkpoint", "--stats", "--save-illumination", "--illumination", "--camera", "--reference",
        "--convergence", "--cache", "--record-image", "--size", "--record", "--aov", "--output", "--integrator"})
    cases.emplace_back(render, option);
  for (const std::string option : {"--merge", "--map", "--variance", "--agree-with"})
    cases.emplace_back("lobecompare a.exr b.exr ", option);
  for (const std::string option : {"--html", "--points", "--plot", "--scene"})
    cases.emplace_back("lobedump a.lobe ", option);
  for (const std::string option : {"--output", "--camera", "--method"})
    cases.emplace_back("lobefit scene.xml ", option);
  for (const auto& [command, option] : cases) {
    CAPTURE(command, option);
    const ToolRun run = folder.run(command + option + " ''");
    CHECK(run.code == 2);
    CHECK_THAT(run.error, Contains(option + ": must"));
    CHECK(lineCount(run.error) == 1);
  }
  for (const std::string command :
       {"loberender '' -o a.exr --spp 1", "lobefit ''", "lobedump ''", "lobedump --diff a ''", "lobecompare '' a.exr",
        "lobecompare a.exr ''", "lobecompare --png a.exr ''"}) {
    CAPTURE(command);
    const ToolRun run = folder.run(command);
    CHECK(run.code == 2);
    CHECK_THAT(run.error, Contains("must not be empty"));
  }
  CHECK(folder.files() == 1);
}

TEST_CASE("tools: outputs are not written through names of open files") {
  const SceneFolder folder(false);
  fs::create_symlink("/dev/stdout", folder / "link.json");
  fs::create_directory_symlink("/proc/self/fd", folder / "open");
  const std::string render = kBin + kPath + " --spp 1 -o a.exr --stats ";
  for (const std::string name :
       {"/dev/stdout", "/dev/fd/1", "/proc/self/fd/1", "link.json", "open/1", "/dev/none.json", "/proc/none.json"}) {
    CAPTURE(name);
    folder.write("log", "before\n");
    CHECK(runIn(folder, render + name + " >>log 2>error") == "1");
    CHECK(folder.bytes("log") == "before\n");
    CHECK_THAT(folder.bytes("error"), Contains(name + ": cannot write: files below /dev and /proc are not replaced"));
    CHECK(runIn(folder, "(" + render + name + " 2>error; echo $? >code) | cat; grep -q 1 code") == "0");
    CHECK_THAT(folder.bytes("error"), Contains(name + ": cannot write: "));
  }
  CHECK_FALSE(folder.has("a.exr"));
}

TEST_CASE("tools: outputs are written to /dev/shm") {
  if (!fs::is_directory("/dev/shm")) return;
  const SceneFolder folder(false);
  const std::string picture = fmt::format("/dev/shm/lobe-test-{}.exr", getpid());
  CHECK(runIn(folder, kBin + kPath + " --spp 1 -o " + picture) == "0");
  CHECK(fs::remove(picture));
}

TEST_CASE("loberender: outputs beyond the file size limit are errors, and leave no temporary files") {
  const SceneFolder folder(true);
  // The limit lets the statistics through, but neither the pictures nor the illumination.
  const std::string render = kBin + "loberender scene.xml -o a.exr -o b.png --stats s.json --spp 1 --size 200x150" +
                             kTraining + " --save-illumination a.illum --record 100,140 --record-image r.png";
  CHECK(runIn(folder, "ulimit -f 28; " + render + " 2>error") == "1");
  const std::string errors = folder.bytes("error");
  CAPTURE(errors);
  for (const char* name : {"a.exr", "b.png", "a.illum", "r.png"}) {
    CHECK_THAT(errors, Contains(std::string("loberender: error: ") + name + ": cannot write: File too large"));
    CHECK_FALSE(folder.has(name));
  }
  CHECK(parseJson(folder.bytes("s.json"))["spp"] == 1);
  CHECK(hiddenFiles(folder.path()) == 0);
}

TEST_CASE("tools: names of any length and any bytes") {
  const SceneFolder folder(false);
  for (const std::size_t length : {244u, 245u, 251u, 255u}) {
    const std::string name = std::string(length - 4, 'x') + ".exr";
    CHECK(folder.run(kPath + " --spp 1 -o " + name).code == 0);
    CHECK(folder.has(name));
  }
  CHECK_THAT(fault(folder, kPath + " --spp 1 -o " + std::string(252, 'x') + ".exr", 1), Contains("too long"));
  REQUIRE(folder.run(kPath + " --spp 1 -o a.exr").code == 0);
  const std::string odd = "b\xff.exr";
  fs::copy(folder / "a.exr", folder / odd);
  const ToolRun compare = folder.run("lobecompare a.exr " + odd + " --json");
  CHECK(compare.code == 0);
  CHECK(parseJson(compare.out)[0]["image"] == "b\xef\xbf\xbd.exr");
}

TEST_CASE("tools: a pipe as an input is an error and does not block") {
  const SceneFolder folder(false);
  REQUIRE(folder.run(kPath + " --spp 1 -o a.exr").code == 0);
  for (const char* name : {"p.exr", "p.png", "p.lobe", "p.xml"}) REQUIRE(mkfifo((folder / name).c_str(), 0600) == 0);
  for (const std::string command :
       {"lobecompare a.exr p.exr", "lobecompare a.exr p.png", "lobecompare a.exr p.exr --merge c.exr",
        "lobedump p.lobe", "loberender p.xml -o b.exr --spp 1",
        "loberender scene.xml --illumination p.lobe -o b.exr --spp 1",
        "loberender scene.xml --resume p.lobe -o b.exr --spp 1", "lobefit p.xml"}) {
    CAPTURE(command);
    CHECK(runIn(folder, kBin + command + " 2>/dev/null") == "1");
  }
}

TEST_CASE("tools: no output replaces a file that the run reads") {
  const SceneFolder folder(true);
  REQUIRE(folder.run(kRender).code == 0);
  REQUIRE(folder.run("loberender scene.xml -o wall.png --spp 1 --integrator path").code == 0);
  folder.write("floor.xml",
               "<scene version=\"0.6.0\"><bsdf type=\"diffuse\" id=\"floor\"><texture name=\"reflectance\" "
               "type=\"bitmap\"><string name=\"filename\" value=\"wall.png\"/></texture></bsdf></scene>");
  folder.write("plane.obj", "v -1 0 -1\nv 1 0 -1\nv 0 0 1\nf 1 2 3\nmtllib plane.mtl\n");
  folder.write("plane.mtl", "newmtl a\nKd 1 1 1\n");
  std::string text = kScene;
  text.insert(text.find("<sensor"), "<include filename=\"floor.xml\"/>");
  text.insert(text.find("<shape"), "<shape type=\"obj\"><string name=\"filename\" value=\"plane.obj\"/></shape>");
  folder.write("scene.xml", text);
  fs::create_symlink("wall.png", folder / "link.png");
  const std::string cache = fs::relative(folder.caches().front(), folder.path()).string();
  const std::string render = "loberender scene.xml --spp 1" + kTraining;
  for (const std::string output :
       {"-o wall.png", "-o link.png", "-o ./lobes/../wall.png", "-o a.exr --stats plane.obj",
        "-o a.exr --stats floor.xml", "-o a.exr --stats plane.mtl", "-o a.exr --checkpoint scene.xml"})
    CHECK_THAT(fault(folder, render + " " + output, 2), Contains("would be overwritten"));
  CHECK_THAT(fault(folder, render + " -o a.exr --stats " + cache, 2), Contains("would be overwritten"));
  fs::copy(folder / "a.exr", folder / "b.exr");
  fs::rename(folder / "b.exr", folder / "b.png");  // an EXR is recognised by its content
  const std::string before = folder.bytes("b.png");
  CHECK(folder.run("lobecompare a.exr b.png --map b.png").code == 2);
  CHECK(folder.run("lobecompare b.png a.exr --map b.png").code == 2);
  CHECK(folder.bytes("b.png") == before);
  CHECK(folder.run("lobedump " + cache + " --scene scene.xml --plot wall.png").code == 2);
}

TEST_CASE("tools: hard links to files that the run reads are not replaced") {
  const SceneFolder folder(true);
  REQUIRE(folder.run(kRender + " --save-illumination a.illum --checkpoint run.ckpt").code == 0);
  const std::string cache = fs::relative(folder.caches().front(), folder.path()).string();
  for (const auto& [input, options] :
       std::vector<std::pair<std::string, std::string>>{{"scene.xml", kTraining},
                                                        {cache, kTraining},
                                                        {"a.illum", " --illumination a.illum"},
                                                        {"run.ckpt", kTraining + " --resume run.ckpt"},
                                                        {"a.exr", kTraining + " --reference a.exr --convergence c"}}) {
    fs::create_hard_link(folder / input, folder / "link");
    CHECK_THAT(fault(folder, "loberender scene.xml --spp 2 -o b.exr --stats link" + options, 2),
               Contains("link: is both an input and an output"));
    fs::remove(folder / "link");
  }
}

TEST_CASE("tools: no two outputs are one file") {
  const SceneFolder folder(false);
  REQUIRE(folder.run(kPath + " --spp 1 -o whole.exr").code == 0);
  fs::create_hard_link(folder / "whole.exr", folder / "hard.exr");
  fs::create_symlink("s.json", folder / "a.exr");  // the targets of these do not exist
  fs::create_symlink("c.exr", folder / "b.exr");
  for (const std::string outputs : {"-o a.exr --stats s.json", "-o a.exr --stats ./s.json", "-o b.exr -o c.exr",
                                    "-o c.exr -o b.exr", "-o d.exr -o ./d.exr", "-o whole.exr -o hard.exr"})
    CHECK_THAT(fault(folder, kPath + " --spp 1 " + outputs, 2), Contains("is used for more than one output"));
  const ToolRun merge = folder.run("lobecompare whole.exr whole.exr --merge b.exr --variance c.exr");
  CHECK(merge.code == 2);
  CHECK_THAT(merge.error, Contains("is used for more than one output"));
}

TEST_CASE("loberender: all outputs that cannot be written are reported before rendering") {
  const SceneFolder folder(false);
  const std::set<std::string> before = folder.names();
  const ToolRun render =
      folder.run(kPath + " --spp 1 -o /nonexistent/a.exr -o b.exr --stats /nonexistent/s.json --checkpoint /dev/null");
  CHECK(render.code == 1);
  CHECK(render.error ==
        "loberender: error: /nonexistent/a.exr: cannot write: No such file or directory\n"
        "loberender: error: /nonexistent/s.json: cannot write: No such file or directory\n"
        "loberender: error: /dev/null: cannot write: not a regular file\n");
  CHECK(folder.names() == before);
}

TEST_CASE("loberender: an interrupted render writes the picture so far") {
  for (const auto& [signal, code] : {std::pair(SIGINT, 130), std::pair(SIGTERM, 143)}) {
    const SceneFolder folder(false);
    Background render(folder, kLong + " -o b.png --stats s.json --snapshot-every 0.1 --checkpoint run.ckpt");
    waitFor([&] { return folder.has("s.json"); });  // a snapshot
    render.send(signal);
    CHECK(render.wait() == code);
    CHECK_THAT(folder.bytes("error"),
               Contains("loberender: interrupted: ") &&
                   Contains(" of 1000000000 samples per pixel are rendered and written; --resume run.ckpt"));
    CHECK(readImage(folder / "a.exr").width == 16);
    CHECK(readImage(folder / "b.png").width == 16);
    CHECK(parseJson(folder.bytes("s.json"))["spp"] > 0);
    const ImageAttributes attributes = attributesOf(folder, "a.exr");
    CHECK(attributes.contains("samples") != attributes.contains("interrupted"));
    CHECK(hiddenFiles(folder.path()) == 0);
  }
}

TEST_CASE("loberender: a render that is interrupted in its first pass says that pixels are black") {
  const SceneFolder folder(false);
  Background render(folder, kPath +
                                " -o a.exr --stats s.json --spp 1000000 --size 1200x900 --firefly-limit 1 "
                                "--checkpoint run.ckpt");
  waitFor([&] { return folder.has("run.ckpt"); });  // written before the first pass
  std::this_thread::sleep_for(std::chrono::milliseconds(50));
  render.send(SIGINT);
  CHECK(render.wait() == 130);
  // Usually the first pass is interrupted; it may have ended, or not begun, on a machine that is busy or fast.
  if (!folder.has("a.exr")) return;
  const ImageAttributes attributes = attributesOf(folder, "a.exr");
  const bool isFirst = attributes.contains("interrupted") &&
                       std::get<AttributeText>(attributes.at("interrupted")).starts_with("0 to 1 ");
  CAPTURE(folder.bytes("error"));
  CHECK(isFirst == (folder.bytes("error").find("; pixels without a sample are black") != std::string::npos));
  // The statistics lack the samples that not all pixels have.
  const bool partial = attributes.contains("interrupted");
  const auto statistics = parseJson(folder.bytes("s.json"));
  for (const char* key : {"mean_path_length", "largest_contributions", "firefly_cut_fraction"})
    CHECK(statistics[key].is_null() == partial);
  CHECK(attributes.contains("fireflyCut") != partial);
}

TEST_CASE("loberender: the message of an interrupted render says what could not be written") {
  for (const auto& [outputs, end] :
       {std::pair("-o sub/b.png --checkpoint run.ckpt", "not all outputs are written; --resume run.ckpt goes on\n"),
        std::pair("-o b.png --checkpoint sub/run.ckpt", "not all outputs are written\n")}) {
    const SceneFolder folder(false);
    fs::create_directory(folder / "sub");
    Background render(folder, kLong + " --snapshot-every 0.1 --stats s.json " + outputs);
    waitFor([&] { return folder.has("s.json"); });  // a snapshot
    fs::rename(folder / "sub", folder / "away");
    render.send(SIGTERM);
    CHECK(render.wait() == 1);
    const std::string errors = folder.bytes("error");
    CAPTURE(outputs, errors);
    CHECK_THAT(errors, Contains("interrupted: ") &&
                           Contains(std::string(" of 1000000000 samples per pixel are rendered, but ") + end) &&
                           Contains("cannot write: No such file or directory"));
    CHECK(readImage(folder / "a.exr").width == 16);
  }
}

TEST_CASE("loberender: an interruption before rendering writes nothing") {
  const SceneFolder folder(true);
  folder.write("noted.xml", sceneWithNote());
  Background render(folder, "loberender noted.xml -o a.exr --spp 4 --passes 1000000 --checkpoint run.ckpt");
  waitFor([&] { return folder.bytes("error").find("note: ") != std::string::npos; });  // the scene is read
  const std::set<std::string> before = folder.names();
  render.send(SIGTERM);
  CHECK(render.wait() == 143);
  CHECK_THAT(folder.bytes("error"), Contains("loberender: interrupted: before rendering"));
  CHECK(folder.names() == before);
  CHECK_FALSE(folder.has("a.exr"));
}

TEST_CASE("loberender: an interruption ends the tracing of the AOVs of a resumed render") {
  const SceneFolder folder(false);
  REQUIRE(folder.run(kPath + " --spp 1 -o a.exr --checkpoint run.ckpt").code == 0);
  // A checkpoint with more samples than can be traced in the time limit of tests.
  const CheckpointFile file = CheckpointFile::open(folder / "run.ckpt");
  std::vector<StoredPixel> pixels(file.pixels().begin(), file.pixels().end());
  for (StoredPixel& pixel : pixels) pixel.count = 1000000000;
  const std::vector<std::byte> bytes = encodeCheckpoint(file.info(), pixels, {}, {});
  writeAtomically(folder / "run.ckpt", std::span<const std::byte>(bytes));
  Background render(folder, kPath + " --spp 1000000001 -o b.exr --aov albedo --resume run.ckpt");
  waitFor([&] { return folder.bytes("error").find("continues with sample") != std::string::npos; });
  std::this_thread::sleep_for(std::chrono::seconds(2));  // until the AOVs are traced
  render.send(SIGTERM);
  CHECK(render.wait() == 143);
  CHECK_THAT(folder.bytes("error"), Contains("loberender: interrupted: before rendering"));
  CHECK_FALSE(folder.has("b.exr"));
}

TEST_CASE("lobefit: an interruption keeps the caches that are complete") {
  const SceneFolder folder(false);
  Background fit(folder, "lobefit scene.xml --elevations 100000");
  waitFor([&] { return folder.has("lobes"); });
  fit.send(SIGINT);
  CHECK(fit.wait() == 130);
  CHECK_THAT(folder.bytes("error"), Contains("lobefit: interrupted: 0 of 2 caches are complete; the same command"));
  CHECK(folder.caches().empty());
}

TEST_CASE("tools: signals while an output is written leave no temporary files") {
  const SceneFolder folder(true);
  REQUIRE(folder.run(kPath + " --spp 1 -o a.exr").code == 0);
  const std::string cache = fs::relative(folder.caches().front(), folder.path()).string();
  const auto isHidden = [](const std::string& name) { return fs::path(name).filename().string().starts_with("."); };
  for (const std::string& command :
       {std::string("lobecompare a.exr a.exr --map map.png"), std::string("lobecompare --png a.exr b.png"),
        "lobedump " + cache + " --html cache.html", kPath + " --spp 1 -o b.exr", kQuickFit + " -o others"}) {
    CAPTURE(command);
    const std::string preload = "exec env LD_PRELOAD='" LOBE_SIGNALS_AT_FSYNC "' " + kBin;
    CHECK(runIn(folder, preload + command + " >/dev/null 2>&1") == "signal");
    CHECK(std::ranges::none_of(folder.names(), isHidden));
  }
}

TEST_CASE("loberender: a second interruption ends at once") {
  const SceneFolder folder(false);
  Background render(folder, kLong + " --snapshot-every 0.1");
  waitFor([&] { return folder.has("a.exr"); });
  for (int i = 0; i < 2; ++i) render.send(SIGTERM);
  const int code = render.wait();
  CHECK((code == -1 || code == 143));
  CHECK(readImage(folder / "a.exr").width == 16);
}

TEST_CASE("loberender: a resumed render has the bytes of an uninterrupted one") {
  const SceneFolder folder(true);
  for (const std::string integrator :
       {"path --firefly-limit 0.2", "bdpt", "vcm --merge-radius 0.05", "guided", "product", "bdpt --guide illumination",
        "product --light-paths on --firefly-limit 0.2"}) {
    const bool trained =
        integrator.find("guide") != std::string::npos || integrator.find("product") != std::string::npos;
    const std::string render =
        "loberender scene.xml --size 32x24 --integrator " + integrator + (trained ? kTraining : "");
    REQUIRE(folder.run(render + " --spp 6 -o whole.exr --stats whole.json").code == 0);
    REQUIRE(folder.run(render + " --spp 2 -o part.exr --checkpoint run.ckpt").code == 0);
    const ToolRun resumed = folder.run(
        render + " --spp 6 -o part.exr --stats part.json --checkpoint run.ckpt --resume run.ckpt --threads 1");
    CAPTURE(resumed.error);
    REQUIRE(resumed.code == 0);
    CHECK_THAT(resumed.error, Contains("run.ckpt: continues with sample 3 of each pixel"));
    CHECK(folder.bytes("part.exr") == folder.bytes("whole.exr"));
    const auto whole = parseJson(folder.bytes("whole.json")), part = parseJson(folder.bytes("part.json"));
    for (const char* key : {"scene_hash", "cache_hashes", "rays", "spp", "training_particles", "records",
                            "strategy_fractions", "guiding_decisions", "largest_contributions", "firefly_cut_fraction"})
      CHECK(whole[key] == part[key]);
    const ToolRun again = folder.run(render + " --spp 6 -o again.exr --resume run.ckpt");
    CHECK(again.code == 0);
    CHECK_THAT(again.error, Contains("run.ckpt: is complete already with --spp 6; a larger number adds samples"));
    CHECK_THAT(again.error, !Contains("continues"));
    CHECK(folder.bytes("again.exr") == folder.bytes("whole.exr"));
    CHECK_THAT(fault(folder, render + " --spp 5 -o part.exr --resume run.ckpt", 1), Contains("more than --spp 5"));
  }
}

TEST_CASE("loberender: a resumed timed run keeps its choice of the integrator and of light paths") {
  const SceneFolder folder(true);
  for (const auto& [integrator, key] : {std::pair("auto", "pilot"), std::pair("product", "light_paths")}) {
    const std::string render = fmt::format("loberender scene.xml --integrator {}{} -o a.exr", integrator, kTraining);
    REQUIRE(folder.run(render + " --seconds 0.5 --stats part.json --checkpoint run.ckpt").code == 0);
    REQUIRE(folder.run(render + " --seconds 1 --stats whole.json --resume run.ckpt").code == 0);
    const auto part = parseJson(folder.bytes("part.json")), whole = parseJson(folder.bytes("whole.json"));
    CHECK(part[key].is_object());
    CHECK(part[key] == whole[key]);  // with its time, which differs if the comparison is repeated
  }
}

TEST_CASE("loberender: a checkpoint of another run is refused") {
  const SceneFolder folder(true);
  const std::string render = "loberender scene.xml -o a.exr --spp 2" + kTraining;
  REQUIRE(folder.run(render + " --checkpoint run.ckpt").code == 0);
  REQUIRE(folder.run(render + " --save-illumination a.illum").code == 0);
  std::string other = kScene;
  other.replace(other.find("value=\"5\"/></emitter>"), 9, "value=\"6\"");
  folder.write("other.xml", other);
  const auto refusal = [&](const std::string& command) { return fault(folder, command + " --resume run.ckpt", 1); };
  for (const auto& [options, what] : std::vector<std::pair<std::string, std::string>>{
           {" --integrator guided", "--integrator was auto, and is guided now"},
           {" --size 8x8", "the size was 16x12, and is 8x8 now"},
           {" --seed 2", "--seed was 1, and is 2 now"},
           {" --sampler independent", "--sampler was sobol"},
           {" --max-depth 3", "--max-depth was"},
           {" --reduction 0.1", "--reduction was 0"},
           {" --light-paths on", "--light-paths was auto, and is on now"},
           {" --firefly-limit 2", "--firefly-limit was none, and is 2 now"},
           {" --components 4", "--components was 8"}})
    CHECK_THAT(refusal(render + options), Contains("run.ckpt: a checkpoint of another run: ") && Contains(what));
  for (const auto& [was, now] : std::vector<std::pair<std::string, std::string>>{
           {"bdpt --passes 1 --photons 2000 --guide illumination", "bdpt --passes 1 --photons 2000 --guide product"},
           {"vcm --merge-radius 0.01", "vcm --merge-radius 0.02"},
           {"vcm --merge-alpha 0.5", "vcm --merge-alpha 0.75"}}) {
    const std::string option = was.substr(was.rfind("--"), was.rfind(' ') - was.rfind("--"));
    const std::string start = "loberender scene.xml -o a.exr --spp 2 --integrator ";
    REQUIRE(folder.run(start + was + " --checkpoint other.ckpt").code == 0);
    CHECK_THAT(fault(folder, start + now + " --resume other.ckpt", 1),
               Contains("another run: " + option + " was " + was.substr(was.rfind(' ') + 1)));
  }
  CHECK_THAT(refusal("loberender other.xml -o a.exr --spp 2" + kTraining),
             Contains("the hash of scene and camera was"));
  CHECK_THAT(refusal("loberender scene.xml -o a.exr --spp 2 --illumination a.illum"), Contains("another run"));
  CHECK_THAT(fault(folder, render + " --resume a.exr", 2), Contains("both an input and an output"));
  CHECK_THAT(fault(folder, render + " --resume run.ckpt --reference a.exr --convergence e.csv", 2),
             Contains("--convergence cannot be combined with --resume"));
  CHECK_THAT(fault(folder, render + " --resume a.illum", 1), Contains("a Lobe file of kind 'ILLU', expected 'CKPT'"));
  folder.write("run.ckpt", folder.bytes("run.ckpt").substr(0, 5000));
  CHECK_THAT(refusal(render), Contains("run.ckpt: truncated"));
}

TEST_CASE("loberender: a checkpoint with impossible contributions of paths is refused") {
  const Folder folder;
  const fs::path path = folder / "run.ckpt";
  // The contribution in one place of a heap, with the least in front; the others are none.
  const auto readBack = [&](LargestContributions::Key key, std::size_t place) {
    RenderResult result;
    result.statistics.largest.keys[place] = key;
    const std::vector<std::byte> bytes = encodeCheckpoint({}, Film(1, 1), result, Guiding(), {}, {});
    writeAtomically(path, std::span<const std::byte>(bytes));
    return resultOf(CheckpointFile::open(path), path).statistics.largest.keys[place];
  };
  constexpr std::size_t kLast = LargestContributions::kCount - 1;
  // Of luminance 1, with 2 segments, by next-event estimation.
  constexpr LargestContributions::Key kPossible = 0x3f800000'00020100;
  CHECK(readBack(kPossible, kLast) == kPossible);
  CHECK_THROWS_WITH(readBack(kPossible, 0), Contains("run.ckpt: damaged"));
  const std::vector<LargestContributions::Key> impossible{0x3f800000'00020500, 0x3f800000'0002ff00, 0x7f800000'00020100,
                                                          0xbf800000'00020100, 0x00000000'00020100};
  for (const LargestContributions::Key key : impossible)
    CHECK_THROWS_WITH(readBack(key, kLast), Contains("run.ckpt: damaged"));
}
