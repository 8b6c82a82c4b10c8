#include "tests/fuzz/fuzz_targets.h"

#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "lobe/field.h"
#include "runtime/image/aov.h"
#include "runtime/image/image.h"
#include "runtime/image/image_output.h"
#include "runtime/image/merge.h"
#include "scenes/meshes/mtl.h"
#include "scenes/meshes/obj.h"
#include "scenes/meshes/ply.h"
#include "scenes/meshes/serialized.h"
#include "scenes/mitsuba/reader.h"
#include "schema/checkpoint_file.h"
#include "schema/illumination_file.h"
#include "schema/lobe_cache.h"
#include "tests/fuzz/sampling_checks.h"

namespace lobe::fuzz {
namespace {

namespace fs = std::filesystem;

/// A folder in memory, if there is one, for the file that readers open.
const fs::path& folder() {
  static const fs::path path = [] {
    const fs::path base = fs::exists("/dev/shm") ? "/dev/shm" : fs::temp_directory_path();
    fs::path own = base / ("lobe-fuzz-" + std::to_string(getpid()));
    fs::create_directory(own);
    std::atexit([] { fs::remove_all(folder()); });
    return own;
  }();
  return path;
}

fs::path inputFile(const std::string& name, Bytes bytes) {
  fs::path path = folder() / name;
  std::ofstream out(path, std::ios::binary | std::ios::trunc);
  out.write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
  return path;
}

/// A reader of a file with this name.
FuzzTarget ofFile(const std::string& name, std::function<void(const fs::path&)> read) {
  return [name, read = std::move(read)](Bytes bytes) { read(inputFile(name, bytes)); };
}

/// A reader of a container: the input is the payload, or a whole file whose payload is used, so that the hash is right
/// and the checks of the content are reached.
FuzzTarget ofPayload(const FileFormat& format, const FuzzTarget& read) {
  return [format, read](Bytes bytes) {
    constexpr std::size_t kHeader = 32;
    if (bytes.size() >= kHeader && isOfKind(format, bytes)) bytes = bytes.subspan(kHeader);
    read(wrapPayload(format, bytes));
  };
}

void readIllumination(const fs::path& path) {
  checkSamplingOfField(Field::load(path));
}

void readCheckpoint(const fs::path& path) {
  const CheckpointFile file = CheckpointFile::open(path);
  if (!file.illumination().empty()) IlluminationFile::parse(file.illumination(), path);
}

/// A reader that may refuse the file while others read it.
template <class Read>
void attempt(const Read& read) {
  try {
    read();
  } catch (const std::runtime_error&) {  // refused
  }
}

/// Reads files by a scene that names them, as users do.
Scene readByScene(const std::string& version, const std::string& body) {
  const fs::path path = folder() / "scene.xml";
  std::ofstream(path) << "<scene version=\"" << version << "\"><sensor type=\"perspective\"/>" << body << "</scene>";
  return readScene(path);
}

void readMeasured(const std::string& type, const fs::path& path) {
  checkSamplingOfMaterials(readByScene("3.0.0", "<shape type=\"sphere\"><bsdf type=\"" + type +
                                                    "\"><string name=\"filename\" value=\"" + path.filename().string() +
                                                    "\"/></bsdf></shape>"));
}

void readSpectrum(const fs::path& path) {
  const auto spectrum = [&](const std::string& name) {
    return "<spectrum name=\"" + name + "\" filename=\"" + path.filename().string() + "\"/>";
  };
  readByScene("3.0.0", "<shape type=\"sphere\"><bsdf type=\"diffuse\">" + spectrum("reflectance") +
                           "</bsdf></shape><emitter type=\"constant\">" + spectrum("radiance") + "</emitter>");
}

/// An OBJ file, and its material library from the first "newmtl" on.
void readObjWithMaterials(Bytes bytes) {
  const std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  const std::size_t library = std::min(text.find("newmtl"), text.size());
  inputFile("a.mtl", bytes.subspan(library));
  inputFile("a.obj", bytes.first(library));
  // Only version 0.6 reads libraries.
  readByScene("0.6.0", "<shape type=\"obj\"><string name=\"filename\" value=\"a.obj\"/></shape>");
}

void readMeshes(const fs::path& path) {
  attempt([&] { readSerialized(path, 0, {}); });
  readSerialized(path, 1, {});
}

/// Fills a table of the standard size with copies of the values after the header, so that short inputs are read.
void readMerl(Bytes bytes) {
  constexpr std::size_t kHeader = 12, kSize = kHeader + 3 * sizeof(double) * 90 * 90 * 180;
  std::vector<std::byte> whole(bytes.begin(), bytes.end());
  if (bytes.size() > kHeader) {
    whole.reserve(kSize);
    for (Bytes values = bytes.subspan(kHeader); whole.size() < kSize;)
      whole.insert(whole.end(), values.begin(), values.begin() + std::min(values.size(), kSize - whole.size()));
  }
  readMeasured("merl", inputFile("a.binary", whole));
}

void readPicture(const fs::path& path) {
  attempt([&] { readAlpha(path); });
  if (path.extension() == ".exr") {
    attempt([&] { readAovs(path); });
    attempt([&] { sampleRanges(readAttributes(path)); });
    attempt([&] { samplesOf(path); });
  }
  readImage(path);
}

FuzzTargets makeTargets() {
  const auto lobe = ofFile("a.lobe", checkSamplingOfLobe), illum = ofFile("a.illum", readIllumination),
             checkpoint = ofFile("a.ckpt", readCheckpoint);
  FuzzTargets targets{
      {"lobe", lobe},
      {"lobe-payload", ofPayload(kLobeFormat, lobe)},
      {"illum", illum},
      {"illum-payload", ofPayload(kIlluminationFormat, illum)},
      {"checkpoint", checkpoint},
      {"checkpoint-payload", ofPayload(kCheckpointFormat, checkpoint)},
      {"xml", ofFile("scene.xml", [](const fs::path& path) { checkScene(path); })},
      {"obj", ofFile("a.obj", [](const fs::path& path) { readObj(path, {}); })},
      {"mtl",
       [](Bytes bytes) { parseMtl(std::string_view(reinterpret_cast<const char*>(bytes.data()), bytes.size())); }},
      {"obj-mtl", readObjWithMaterials},
      {"ply", ofFile("a.ply", [](const fs::path& path) { readPly(path, {}); })},
      {"serialized", ofFile("a.serialized", readMeshes)},
      {"spd", ofFile("a.spd", readSpectrum)},
      {"rgl", ofFile("a.bsdf", [](const fs::path& path) { readMeasured("measured", path); })},
      {"merl", readMerl}};
  for (const char* format : {"exr", "png", "jpg", "hdr", "bmp", "tga"})
    targets.emplace(format, ofFile(std::string("a.") + format, readPicture));
  return targets;
}

}  // namespace

const FuzzTargets& fuzzTargets() {
  static const FuzzTargets targets = makeTargets();
  return targets;
}

void readOrRefuse(const FuzzTarget& read, Bytes bytes) {
  attempt([&] { read(bytes); });
}

}  // namespace lobe::fuzz
