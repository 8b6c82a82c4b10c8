#include "scenes/mitsuba/reader.h"

#include <algorithm>
#include <array>
#include <optional>
#include <stdexcept>

#include <fmt/format.h>

#include "runtime/core/parallel.h"
#include "scenes/mitsuba/reader_emitters.h"
#include "scenes/mitsuba/reader_parameters.h"
#include "scenes/mitsuba/reader_sensor.h"
#include "scenes/mitsuba/reader_shapes.h"
#include "scenes/mitsuba/values.h"
#include "scenes/scene_scale.h"

namespace lobe {
namespace {

constexpr std::string_view kKnown =
    "alias, bsdf, default, emitter, film, include, integrator, medium, path, rfilter, sampler, sensor, shape, texture";
/// Elements that need not be read here: they have been handled by SceneFile, or are read where they are referenced.
constexpr std::array<std::string_view, 7> kElsewhere = {"alias", "default", "film",   "medium",
                                                        "path",  "rfilter", "sampler"};

class SceneReader {
 public:
  /// cameraFile: where the sensor is read; null: in the scene.
  SceneReader(ReadContext& context, const SceneFile* cameraFile)
      : context_(context),
        cameraFile_(cameraFile),
        textures_(context),
        materials_(context, textures_),
        shapes_(context, textures_, materials_),
        emitters_(context, textures_) {}

  void read() {
    for (const pugi::xml_node node : context_.file.scene().children()) {
      throwIfCancelled();
      context_.attempt(fmt::format("{} is left out", nameOf(node)), [&] { readElement(node); });
    }
    if (context_.options.geometry) readOtherSensor();
    if (!sensor_ && context_.options.geometry)
      context_.unsupported(context_.file.scene(), "no sensor", "the scene has no <sensor>", "");
    emitters_.finish();
    if (!context_.options.geometry) return;
    shapes_.readMeshes();
    bringIntoRange();
    shapes_.leaveOutFlatInstances();
  }

 private:
  void readElement(pugi::xml_node node) {
    if (SceneFile::hasUndefinedName(node)) return;
    const std::string_view tag = elementName(node);
    if (tag == "shape")
      shapes_.add(node);
    else if (tag == "bsdf")
      materials_.check(node);
    else if (tag == "texture")
      textures_.read(node);
    else if (tag == "emitter")
      emitters_.add(node);
    else if (tag == "sensor")
      readOwnSensor(node);
    else if (tag == "integrator")
      readFirstIntegrator(node);
    else if (std::ranges::find(kElsewhere, tag) == kElsewhere.end())
      reject(node);
  }

  void bringIntoRange() {
    try {
      lobe::bringIntoRange(context_.scene);
    } catch (const std::runtime_error& error) {
      context_.unsupported(context_.file.scene(), "scale", error.what(), "");
    }
    if (context_.scene.scale != 1.0f)
      context_.note(fmt::format("all lengths are multiplied by {:g}, because the scene is extremely large or small",
                                context_.scene.scale));
  }

  void readFirstIntegrator(pugi::xml_node node) {
    if (integrator_) return context_.note("only the first of several integrators is used");
    integrator_ = true;
    readIntegrator(context_, node);
  }

  void readFirstSensor(ReadContext& context, pugi::xml_node node) {
    if (sensor_) return context.note("only the first of several sensors is used");
    sensor_ = true;
    // Nothing can be rendered without a camera, so lenient reading does not tolerate its faults.
    context.attempt("", [&] { readSensor(context, node); });
  }

  void readOwnSensor(pugi::xml_node node) {
    if (!cameraFile_) readFirstSensor(context_, node);
  }

  void readOtherSensor() {
    if (!cameraFile_) return;
    ReadContext context(*cameraFile_, context_.options, context_.scene, context_.findings);
    for (const pugi::xml_node node : cameraFile_->scene().children())
      if (elementName(node) == "sensor") readFirstSensor(context, node);
    if (!sensor_) context.unsupported(cameraFile_->scene(), "no sensor", "the file has no <sensor>", "");
    sensor_ = true;
  }

  void reject(pugi::xml_node node) {
    rejectText(context_, node);
    context_.unsupported(node, fmt::format("<{}> in scene", node.name()),
                         fmt::format("unknown element <{}>; {}", node.name(), knownAre(node.name(), kKnown)),
                         fmt::format("<{}> is left out", node.name()));
  }

  ReadContext& context_;
  const SceneFile* cameraFile_;
  TextureReader textures_;
  MaterialReader materials_;
  ShapeReader shapes_;
  EmitterReader emitters_;
  bool sensor_ = false, integrator_ = false;
};

/// Reports a fault when lenient reading has left neither shapes nor an environment.
void checkSomethingIsLeft(const std::filesystem::path& path, const Scene& scene, const ReadOptions& options,
                          Findings& findings) {
  if (options.lenient && options.geometry && !findings.faults().empty() && scene.shapes.empty() && !scene.environment)
    findings.fault(path.string(), "nothing left", "nothing is left to draw after leaving out what has faults", "");
}

Scene read(const std::filesystem::path& path, const ReadOptions& options, Findings& findings) {
  const SceneFile file(path, options.definitions, findings);
  std::optional<SceneFile> camera;
  if (!options.camera.empty()) camera.emplace(options.camera, options.definitions, findings);
  const SceneFile* cameraOrNull = camera ? &*camera : nullptr;
  file.checkDefinitionsUsed(options.definitions, cameraOrNull);
  Scene scene;
  ReadContext context(file, options, scene, findings);
  SceneReader(context, cameraOrNull).read();
  checkSomethingIsLeft(path, scene, options, findings);
  return scene;
}

/// Whether a scene with these faults must not be used.
bool mustRefuse(const std::vector<Fault>& faults, const ReadOptions& options) {
  if (faults.empty()) return false;
  return !options.lenient || std::ranges::any_of(faults, [](const Fault& fault) { return fault.consequence.empty(); });
}

std::string asWarning(const Fault& fault) {
  const std::string more = fault.count > 1 ? fmt::format(" ({} more of this kind)", fault.count - 1) : "";
  return fmt::format("{}: {}: {}{}", fault.where, fault.message, fault.consequence, more);
}

}  // namespace

Scene readScene(const std::filesystem::path& path, const ReadOptions& options) {
  Findings findings;
  Scene scene = read(path, options, findings);
  if (mustRefuse(findings.faults(), options)) throw SceneError(findings.faults());
  scene.warnings = findings.warnings();
  for (const Fault& fault : findings.faults()) scene.warnings.push_back(asWarning(fault));
  scene.notes = findings.notes();
  scene.files = findings.files();
  return scene;
}

SceneCheck checkScene(const std::filesystem::path& path, const ReadOptions& options) {
  Findings findings;
  SceneCheck check;
  try {
    read(path, options, findings);
    check.faults = findings.faults();
    check.readable = !mustRefuse(check.faults, options);
  } catch (const SceneError& error) {
    check.faults = findings.faults();
    check.faults.insert(check.faults.end(), error.faults().begin(), error.faults().end());
  }
  check.warnings = findings.warnings();
  check.notes = findings.notes();
  return check;
}

}  // namespace lobe
