#include "scenes/reader.h"

#include <algorithm>
#include <array>

#include <fmt/format.h>

#include "scenes/reader_emitters.h"
#include "scenes/reader_parameters.h"
#include "scenes/reader_sensor.h"
#include "scenes/reader_shapes.h"
#include "scenes/values.h"

namespace lobe {
namespace {

constexpr std::string_view kKnown =
    "alias, bsdf, default, emitter, film, include, integrator, medium, path, rfilter, sampler, sensor, shape, texture";
/// Nothing to read where they stand: SceneFile has seen to them, or something may refer to them.
constexpr std::array<std::string_view, 6> kElsewhere = {"alias", "default", "film", "path", "rfilter", "sampler"};

class SceneReader {
 public:
  explicit SceneReader(ReadContext& context)
      : context_(context),
        textures_(context),
        materials_(context, textures_),
        shapes_(context, textures_, materials_),
        emitters_(context, textures_) {}

  void read() {
    for (const pugi::xml_node node : context_.file.scene().children()) readElement(node);
    if (!sensor_ && context_.options.geometry) context_.file.fail(context_.file.scene(), "the scene has no <sensor>");
    emitters_.finish();
    if (context_.options.geometry) shapes_.readMeshes();
  }

 private:
  void readElement(pugi::xml_node node) {
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
      readFirstSensor(node);
    else if (tag == "integrator")
      readIntegrator(context_, node);
    else if (tag == "medium")
      noteMedium(context_);
    else if (std::ranges::find(kElsewhere, tag) == kElsewhere.end())
      reject(node);
  }

  void readFirstSensor(pugi::xml_node node) {
    if (sensor_) return context_.note("only the first of several sensors is used");
    sensor_ = true;
    readSensor(context_, node);
  }

  void reject(pugi::xml_node node) {
    rejectText(context_, node);
    context_.unsupported(node, fmt::format("<{}> in scene", node.name()),
                         fmt::format("unknown element <{}>; {}", node.name(), knownAre(node.name(), kKnown)),
                         "it is left out");
  }

  ReadContext& context_;
  TextureReader textures_;
  MaterialReader materials_;
  ShapeReader shapes_;
  EmitterReader emitters_;
  bool sensor_ = false;
};

}  // namespace

Scene readScene(const std::filesystem::path& path, const ReadOptions& options) {
  const SceneFile file(path, options.definitions);
  Scene scene;
  ReadContext context(file, options, scene);
  SceneReader(context).read();
  return scene;
}

}  // namespace lobe
