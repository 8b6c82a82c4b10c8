#include "scenes/reader_shapes.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <exception>

#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include "scenes/primitives.h"
#include "scenes/reader_parameters.h"

namespace lobe {
namespace {

constexpr std::array<std::string_view, 10> kTypes = {"cube", "cylinder",  "disk",       "instance",   "obj",
                                                     "ply",  "rectangle", "serialized", "shapegroup", "sphere"};
constexpr int kTop = -1;

bool isMesh(std::string_view type) {
  return type == "obj" || type == "ply" || type == "serialized";
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

float readRadius(const Parameters& parameters) {
  const double radius = parameters.number("radius", 1.0);
  if (!(radius > 0.0)) throw ParameterError("radius", fmt::format("the radius must be positive, not {}", radius));
  return static_cast<float>(radius);
}

Sphere makeSphereFrom(const Parameters& parameters, const MeshOptions& options) {
  return makeSphere(parameters.colour("center", Rgb::Zero()).matrix(), readRadius(parameters), options);
}

Cylinder makeCylinderFrom(const Parameters& parameters, const MeshOptions& options) {
  const Vec3 start = parameters.colour("p0", Rgb::Zero()).matrix();
  const Vec3 end = parameters.colour("p1", Rgb(0, 0, 1)).matrix();
  if (start == end) throw ParameterError("p1", "a cylinder's ends p0 and p1 must differ");
  return makeCylinder(start, end, readRadius(parameters), options);
}

Geometry makePrimitive(const std::string& type, const Parameters& parameters, const MeshOptions& options) {
  try {
    if (type == "rectangle") return makeRectangle(options);
    if (type == "cube") return makeCube(options);
    if (type == "disk") return makeDisk(options);
    if (type == "cylinder") return makeCylinderFrom(parameters, options);
    return makeSphereFrom(parameters, options);
  } catch (const ParameterError&) {
    throw;
  } catch (const std::runtime_error& error) {
    throw ParameterError("to_world", error.what());
  }
}

int readIndex(const Parameters& parameters) {
  const double index = parameters.number("shape_index", 0);
  if (!(index >= 0 && index <= 1e9) || index != std::floor(index))
    throw ParameterError("shape_index", fmt::format("shape_index must be a whole number from 0, not {}", index));
  return static_cast<int>(index);
}

Instance makeInstance(int group, const Parameters& parameters) {
  const Eigen::Affine3f placed(toWorld(parameters));
  if (!placed.matrix().allFinite() || placed.linear().cast<double>().determinant() == 0)
    throw ParameterError("to_world", "an instance's transform must be finite and not singular");
  return {group, placed};
}

}  // namespace

void ShapeReader::add(pugi::xml_node node) {
  addTo(kTop, node);
}

void ShapeReader::addTo(int group, pugi::xml_node node) {
  const std::string type = typeOf(context_, node);
  if (std::ranges::find(kTypes, type) == kTypes.end()) {
    context_.unsupported(node, "shape " + type,
                         fmt::format("unknown shape type \"{}\"; known are {}", type, fmt::join(kTypes, ", ")),
                         "it is left out");
    return;
  }
  if (group != kTop && (type == "instance" || type == "shapegroup"))
    context_.file.fail(node, fmt::format("{} inside a shapegroup: a group holds plain shapes only", describe(node)));
  if (type == "instance")
    addInstance(node);
  else if (type == "shapegroup")
    groupOf(node);
  else
    addShape(group, node, type);
}

void ShapeReader::addShape(int group, pugi::xml_node node, const std::string& type) {
  Parts parts;
  const Parameters parameters =
      readParameters(context_, node, "bsdf, ref, emitter",
                     [&](pugi::xml_node child, const std::string&, Parameters&) { return take(child, parts); });
  if (group != kTop && parts.emitter) context_.file.fail(node, "a shape in a shapegroup cannot emit light");
  Shape shape = makeFrom(context_, node, parameters, [&](const Parameters& p) { return make(group, node, type, p); });
  shape.material = parts.bsdf ? materials_.use(parts.bsdf) : materials_.useDefault(parts.emitter.has_value());
  shape.emitter = std::move(parts.emitter);
  shapesOf(group).push_back(std::move(shape));
}

void ShapeReader::addInstance(pugi::xml_node node) {
  std::optional<int> group;
  const auto onChild = [&](pugi::xml_node child, const std::string&, Parameters&) {
    if (elementName(child) != "shape") return false;
    if (typeOf(context_, child) != "shapegroup" || group) context_.file.fail(node, "an instance needs one shapegroup");
    group = groupOf(child);
    return true;
  };
  const Parameters parameters = readParameters(context_, node, "ref", onChild);
  if (!group) context_.file.fail(node, "an instance needs a <ref> to a shapegroup");
  const std::string id = node.attribute("id").value();
  Shape shape = makeFrom(context_, node, parameters, [&](const Parameters& p) {
    return Shape{id.empty() ? "instance" : id, makeInstance(*group, p), -1, std::nullopt};
  });
  shapesOf(kTop).push_back(std::move(shape));
}

int ShapeReader::groupOf(pugi::xml_node node) {
  const auto [entry, isNew] =
      groups_.try_emplace(SceneFile::location(node), static_cast<int>(context_.scene.groups.size()));
  if (isNew) {
    context_.scene.groups.emplace_back();
    readGroup(node, entry->second);
  }
  return entry->second;
}

void ShapeReader::readGroup(pugi::xml_node node, int group) {
  const auto onChild = [&](pugi::xml_node child, const std::string&, Parameters&) {
    if (elementName(child) != "shape") return false;
    addTo(group, child);
    return true;
  };
  const Parameters parameters = readParameters(context_, node, "shape", onChild);
  checkUnused(context_, node, parameters);
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

Shape ShapeReader::make(int group, pugi::xml_node node, const std::string& type, const Parameters& parameters) {
  Shape shape;
  shape.name = node.attribute("id").value();
  const MeshOptions options = readOptions(type, parameters);
  if (isMesh(type))
    addMesh(group, type, parameters, options, shape);
  else
    shape.geometry = makePrimitive(type, parameters, options);
  if (shape.name.empty()) shape.name = type;
  return shape;
}

void ShapeReader::addMesh(int group, const std::string& type, const Parameters& parameters, const MeshOptions& options,
                          Shape& shape) {
  const std::string filename = requiredText(parameters, "filename");
  if (shape.name.empty()) shape.name = filename;
  const MeshSource source{type, context_.file.resolve(filename), type == "serialized" ? readIndex(parameters) : 0};
  meshes_.push_back({{group, shapesOf(group).size()}, parameters.location("filename"), source, options, ""});
}

void ShapeReader::readMeshes() {
  tbb::parallel_for(std::size_t{0}, meshes_.size(), [this](std::size_t i) {
    Mesh& mesh = meshes_[i];
    try {
      shapesOf(mesh.shape.group)[mesh.shape.index].geometry = readMesh(mesh.source, mesh.options);
    } catch (const std::exception& error) {
      mesh.fault = error.what();
    }
  });
  reportFaults();
}

void ShapeReader::reportFaults() {
  std::vector<Place> missing;
  for (const Mesh& mesh : meshes_) {
    if (mesh.fault.empty()) continue;
    const std::string message = fmt::format("shape \"{}\": {}", mesh.source.type, mesh.fault);
    if (std::filesystem::exists(mesh.source.path)) context_.file.fail(mesh.location, message);
    context_.unsupported(mesh.location, "missing mesh " + mesh.source.path.string(), message, "the shape is left out");
    missing.push_back(mesh.shape);
  }
  for (auto place = missing.rbegin(); place != missing.rend(); ++place) {
    std::vector<Shape>& shapes = shapesOf(place->group);
    shapes.erase(shapes.begin() + static_cast<std::ptrdiff_t>(place->index));
  }
}

}  // namespace lobe
