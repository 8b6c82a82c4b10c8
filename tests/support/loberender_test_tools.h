#pragma once
// Helpers for the tests of loberender: a scene in a temporary folder, and runs that must fail.

#include <filesystem>
#include <set>
#include <string>
#include <vector>

#include "runtime/core/atomic_file.h"
#include "tests/support/tool_run.h"

namespace lobe::test {

// Three metal spheres with two different lobes under a light, on a diffuse floor.
inline const char* const kScene = R"(<scene version="0.6.0">
  <sensor type="perspective"><float name="fov" value="50"/>
    <transform name="toWorld"><lookat origin="0, 2, 6" target="0, 0.5, 0" up="0, 1, 0"/></transform>
    <film type="hdrfilm"><integer name="width" value="16"/><integer name="height" value="12"/></film></sensor>
  <bsdf type="roughconductor" id="Steel"><string name="distribution" value="ggx"/>
    <float name="alpha" value="0.3"/></bsdf>
  <bsdf type="roughconductor" id="Iron"><string name="distribution" value="ggx"/>
    <float name="alpha" value="0.3"/></bsdf>
  <bsdf type="roughconductor" id="Satin"><string name="distribution" value="ggx"/>
    <float name="alpha" value="0.15"/></bsdf>
  <shape type="sphere"><point name="center" x="-1" y="1" z="0"/><ref id="Steel"/></shape>
  <shape type="sphere"><point name="center" x="1" y="1" z="0"/><ref id="Satin"/></shape>
  <shape type="sphere"><point name="center" x="0" y="0.4" z="1.5"/><float name="radius" value="0.4"/>
    <ref id="Iron"/></shape>
  <shape type="rectangle"><transform name="toWorld"><scale value="5"/><rotate x="1" angle="-90"/></transform>
    <bsdf type="diffuse"/></shape>
  <shape type="rectangle"><transform name="toWorld"><rotate x="1" angle="90"/><translate y="4"/></transform>
    <bsdf type="diffuse"/><emitter type="area"><rgb name="radiance" value="5"/></emitter></shape>
</scene>)";

inline const std::string kTraining = " --passes 1 --photons 2000 --importons 1000";
inline const std::string kRender = "loberender scene.xml -o a.exr --spp 2" + kTraining;
inline const std::string kQuickFit = "lobefit scene.xml --elevations 4 --samples 256";

/// A folder with the scene and, if requested, its caches.
class SceneFolder : public Folder {
 public:
  explicit SceneFolder(bool caches) {
    write("scene.xml", kScene);
    if (caches) REQUIRE(run(kQuickFit).code == 0);
  }
  void write(const std::string& name, const std::string& text) const { writeAtomically(*this / name, text); }
  ToolRun run(const std::string& command) const { return runBinary(path(), command); }
  std::string bytes(const std::string& name) const { return readFile(*this / name); }
  bool has(const std::string& name) const { return std::filesystem::exists(*this / name); }

  std::vector<std::filesystem::path> caches() const {
    std::vector<std::filesystem::path> all;
    for (const auto& entry : std::filesystem::directory_iterator(*this / "lobes")) all.push_back(entry.path());
    return all;
  }
  /// Paths of all files and folders inside, relative to the folder.
  std::set<std::string> names() const {
    std::set<std::string> all;
    for (const auto& entry : std::filesystem::recursive_directory_iterator(path()))
      all.insert(std::filesystem::relative(entry.path(), path()).string());
    return all;
  }
};

/// Checks that the command fails with this exit code and a one-line error and writes nothing. Returns the line.
inline std::string fault(const SceneFolder& folder, const std::string& command, int code) {
  const std::set<std::string> before = folder.names();
  const ToolRun run = folder.run(command);
  CAPTURE(command, run.error);
  CHECK(run.code == code);
  CHECK(run.out.empty());
  CHECK(lineCount(run.error) == 1);
  CHECK(run.error.rfind("loberender: error: ", 0) == 0);
  CHECK(folder.names() == before);
  return run.error;
}

}  // namespace lobe::test
