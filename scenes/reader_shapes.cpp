#include "scenes/reader_shapes.h"

#include <algorithm>
#include <array>
#include <exception>

#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include "scenes/obj.h"
#include "scenes/ply.h"
#include "scenes/primitives.h"
#include "scenes/reader_parameters.h"

namespace lobe {
namespace {

constexpr std::array<std::string_view, 6> kTypes = {"cube", "disk", "obj", "ply", "rectangle", "sphere"};

bool isMesh(std::string_view type) {
  return type == "obj" || type == "ply";
}

MeshOptions readOptions(const std::string& type, const Parameters& parameters) {
  MeshOptions options;
  options.toWorld = toWorld(parameters);
  options.flipNormals = parameters.flag("flip_normals", false);
  if (!isMesh(type)) return options;
  options.faceNormals = parameters.flag("face_normals", false);
  // Mitsuba flips what an OBJ holds unless told otherwise, and the reader of OBJ files does so by itself.
  const bool usual = type == "obj";
  options.flipTexCoords = parameters.flag("flip_tex_coords", usual) != usual;
  return options;
}

Sphere makeSphereFrom(const Parameters& parameters, const MeshOptions& options) {
  const double radius = parameters.number("radius", 1.0);
  if (!(radius > 0.0)) throw ParameterError("radius", fmt::format("the radius must be positive, not {}", radius));
  return makeSphere(parameters.colour("center", Rgb::Zero()).matrix(), static_cast<float>(radius), options);
}

Geometry makePrimitive(const std::string& type, const Parameters& parameters, const MeshOptions& options) {
  try {
    if (type == "rectangle") return makeRectangle(options);
    if (type == "cube") return makeCube(options);
    if (type == "disk") return makeDisk(options);
    return makeSphereFrom(parameters, options);
  } catch (const ParameterError&) {
    throw;
  } catch (const std::runtime_error& error) {
    throw ParameterError("to_world", error.what());
  }
}

}  // namespace

void ShapeReader::add(pugi::xml_node node) {
  const std::string type = typeOf(context_, node);
  if (std::ranges::find(kTypes, type) == kTypes.end()) {
    context_.unsupported(node, "shape " + type,
                         fmt::format("unknown shape type \"{}\"; known are {}", type, fmt::join(kTypes, ", ")),
                         "it is left out");
    return;
  }
  Parts parts;
  const Parameters parameters =
      readParameters(context_, node, "bsdf, ref, emitter",
                     [&](pugi::xml_node child, const std::string&, Parameters&) { return take(child, parts); });
  Shape shape = makeFrom(context_, node, parameters, [&](const Parameters& p) { return make(node, type, p); });
  shape.material = parts.bsdf ? materials_.use(parts.bsdf) : materials_.useDefault(parts.emitter.has_value());
  shape.emitter = std::move(parts.emitter);
  context_.scene.shapes.push_back(std::move(shape));
}

bool ShapeReader::take(pugi::xml_node child, Parts& parts) {
  const std::string_view tag = elementName(child);
  if (tag == "bsdf") {
    if (parts.bsdf) context_.file.fail(child, "a second bsdf for the same shape");
    parts.bsdf = child;
  } else if (tag == "emitter") {
    takeEmitter(child, parts);
  } else if (tag == "medium") {
    noteMedium(context_);
  } else {
    return false;
  }
  return true;
}

void ShapeReader::takeEmitter(pugi::xml_node node, Parts& parts) {
  const std::string type = typeOf(context_, node);
  if (type != "area") {
    context_.unsupported(node, "shape's emitter " + type,
                         fmt::format("unknown emitter type \"{}\" in a shape; known is area", type), "it is left out");
    return;
  }
  if (parts.emitter) context_.file.fail(node, "a second emitter for the same shape");
  const Parameters parameters = readParameters(
      context_, node, "texture",
      [this](pugi::xml_node child, const std::string& name, Parameters& p) { return textures_.take(child, name, p); });
  parts.emitter = makeFrom(context_, node, parameters,
                           [](const Parameters& p) { return AreaEmitter{p.texture("radiance", grey(1.0f))}; });
}

Shape ShapeReader::make(pugi::xml_node node, const std::string& type, const Parameters& parameters) {
  Shape shape;
  shape.name = node.attribute("id").value();
  const MeshOptions options = readOptions(type, parameters);
  if (isMesh(type))
    addMesh(type, parameters, options, shape);
  else
    shape.geometry = makePrimitive(type, parameters, options);
  if (shape.name.empty()) shape.name = type;
  return shape;
}

void ShapeReader::addMesh(const std::string& type, const Parameters& parameters, const MeshOptions& options,
                          Shape& shape) {
  const std::string filename = requiredText(parameters, "filename");
  if (shape.name.empty()) shape.name = filename;
  meshes_.push_back({context_.scene.shapes.size(), parameters.location("filename"), type,
                     context_.file.resolve(filename), options, ""});
}

void ShapeReader::readMeshes() {
  tbb::parallel_for(std::size_t{0}, meshes_.size(), [this](std::size_t i) {
    Mesh& mesh = meshes_[i];
    try {
      context_.scene.shapes[mesh.shape].geometry =
          mesh.type == "obj" ? readObj(mesh.path, mesh.options) : readPly(mesh.path, mesh.options);
    } catch (const std::exception& error) {
      mesh.fault = error.what();
    }
  });
  reportFaults();
}

void ShapeReader::reportFaults() {
  std::vector<std::size_t> missing;
  for (const Mesh& mesh : meshes_) {
    if (mesh.fault.empty()) continue;
    const std::string message = fmt::format("shape \"{}\": {}", mesh.type, mesh.fault);
    if (std::filesystem::exists(mesh.path)) context_.file.fail(mesh.location, message);
    context_.unsupported(mesh.location, "missing mesh " + mesh.path.string(), message, "the shape is left out");
    missing.push_back(mesh.shape);
  }
  std::vector<Shape>& shapes = context_.scene.shapes;
  for (auto shape = missing.rbegin(); shape != missing.rend(); ++shape)
    shapes.erase(shapes.begin() + static_cast<std::ptrdiff_t>(*shape));
}

}  // namespace lobe
