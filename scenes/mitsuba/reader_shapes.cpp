#include "scenes/mitsuba/reader_shapes.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <exception>
#include <new>

#include <fmt/format.h>

#include "runtime/core/parallel.h"
#include "scenes/meshes/duplicates.h"
#include "scenes/meshes/primitives.h"
#include "scenes/mitsuba/emission.h"
#include "scenes/mitsuba/reader_parameters.h"
#include "scenes/mitsuba/values.h"
#include "scenes/scene_scale.h"

namespace lobe {
namespace {

constexpr std::array<std::string_view, 10> kTypes = {"cube", "cylinder",  "disk",       "instance",   "obj",
                                                     "ply",  "rectangle", "serialized", "shapegroup", "sphere"};
constexpr int kTop = -1;

bool isMesh(std::string_view type) {
  return type == "obj" || type == "ply" || type == "serialized";
}

std::optional<float> readSmoothAngle(const Parameters& parameters) {
  if (!parameters.has("max_smooth_angle")) return std::nullopt;
  const double degrees = parameters.number("max_smooth_angle", 0);
  if (!(degrees >= 0 && degrees <= 180))
    throw ParameterError("max_smooth_angle",
                         fmt::format("max_smooth_angle must be between 0 and 180 degrees, not {}", degrees));
  return static_cast<float>(degrees);
}

MeshOptions readOptions(const std::string& type, const Parameters& parameters) {
  MeshOptions options;
  options.toWorld = toWorld(parameters);
  options.flipNormals = parameters.flag("flip_normals", false);
  if (!isMesh(type)) return options;
  options.faceNormals = parameters.flag("face_normals", false);
  options.maxSmoothAngle = readSmoothAngle(parameters);
  if (options.faceNormals && options.maxSmoothAngle)
    throw ParameterError("max_smooth_angle", "give either face_normals or max_smooth_angle");
  // By default, Mitsuba flips the texture coordinates of an OBJ, and the reader of OBJ files always flips them.
  const bool usual = type == "obj";
  options.flipTexCoords = parameters.flag("flip_tex_coords", usual) != usual;
  return options;
}

float readRadius(const Parameters& parameters) {
  const double radius = parameters.number("radius", 1.0);
  if (!(radius > 0.0)) throw ParameterError("radius", fmt::format("the radius must be positive, not {}", radius));
  return static_cast<float>(radius);
}

Sphere makeSphereFrom(const Parameters& parameters, const MeshOptions& options, SphereTransform kind) {
  return makeSphere(parameters.colour("center", Rgb::Zero()).matrix(), readRadius(parameters), options, kind);
}

Cylinder makeCylinderFrom(const Parameters& parameters, const MeshOptions& options) {
  const Vec3 start = parameters.colour("p0", Rgb::Zero()).matrix();
  const Vec3 end = parameters.colour("p1", Rgb(0, 0, 1)).matrix();
  if (start == end) throw ParameterError("p1", "a cylinder's ends p0 and p1 must differ");
  return makeCylinder(start, end, readRadius(parameters), options);
}

Geometry makePrimitive(const std::string& type, const Parameters& parameters, const MeshOptions& options,
                       bool isOfToday) {
  try {
    if (type == "rectangle") return makeRectangle(options);
    if (type == "cube") return makeCube(options);
    if (type == "disk") return makeDisk(options);
    if (type == "cylinder") return makeCylinderFrom(parameters, options);
    return makeSphereFrom(parameters, options, isOfToday ? SphereTransform::today : SphereTransform::old);
  } catch (const ParameterError&) {
    throw;
  } catch (const std::runtime_error& error) {
    throw ParameterError("to_world", error.what());
  }
}

int readIndex(const Parameters& parameters, int fallback) {
  const double index = parameters.number("shape_index", fallback);
  if (!(index >= std::min(fallback, 0) && index <= 1e9) || index != std::floor(index))
    throw ParameterError("shape_index", fmt::format("shape_index must be an integer from 0, not {}", index));
  return static_cast<int>(index);
}

ObjGrouping readGrouping(const Parameters& parameters, bool isOfToday) {
  if (parameters.flag("collapse", false)) return ObjGrouping::collapsed;
  return isOfToday ? ObjGrouping::joined : ObjGrouping::separate;
}

Instance makeInstance(int group, const Parameters& parameters) {
  const Eigen::Affine3f placed(toWorld(parameters));
  if (!placed.matrix().allFinite() || placed.linear().cast<double>().determinant() == 0)
    throw ParameterError("to_world", "an instance's transform must be finite and not singular");
  return {group, placed};
}

bool isEmptyMesh(const Shape& shape) {
  const auto* mesh = std::get_if<TriangleMesh>(&shape.geometry);
  return mesh && mesh->triangles.empty();
}

}  // namespace

void ShapeReader::add(pugi::xml_node node) {
  addTo(kTop, node);
}

void ShapeReader::addTo(int group, pugi::xml_node node) {
  const std::string type = typeOf(context_, node);
  if (std::ranges::find(kTypes, type) == kTypes.end()) {
    context_.unsupported(
        node, "shape " + type,
        fmt::format("unknown shape type \"{}\"; {}", type, knownAre(type, fmt::format("{}", fmt::join(kTypes, ", ")))),
        "the shape is left out");
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
  const auto onChild = [&](pugi::xml_node child, const std::string& name, Parameters&) {
    return take(child, name, type, parts);
  };
  const Parameters parameters = readParameters(context_, node, "bsdf, ref, emitter", onChild);
  if (group != kTop && parts.emitter) context_.file.fail(node, "a shape in a shapegroup cannot emit light");
  const std::string id = node.attribute("id").value();
  if (isMesh(type)) {
    Mesh mesh = makeFrom(context_, node, parameters,
                         [&](const Parameters& p) { return makeMesh(type, p, readOptions(type, p)); });
    const std::string file = parameters.text("filename", "");
    addMesh(group, node, std::move(mesh), id.empty() ? file : id, parts);
    return;
  }
  Geometry geometry = makeFrom(context_, node, parameters, [&](const Parameters& p) {
    return makePrimitive(type, p, readOptions(type, p), context_.file.isOfToday());
  });
  shapesOf(group).push_back({id.empty() ? type : id, std::move(geometry), materialOf(parts), parts.emitter});
}

int ShapeReader::materialOf(const Parts& parts) {
  return parts.bsdf ? materials_.use(parts.bsdf) : materials_.useDefault(parts.emitter.has_value());
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
  if (!group) failUnlessIncomplete(context_, node, parameters, "an instance needs a <ref> to a shapegroup");
  const std::string id = node.attribute("id").value();
  Shape shape = makeFrom(context_, node, parameters, [&](const Parameters& p) {
    return Shape{id.empty() ? "instance" : id, makeInstance(*group, p), -1, std::nullopt};
  });
  instances_.emplace_back(context_.scene.shapes.size(), SceneFile::location(node));
  context_.scene.shapes.push_back(std::move(shape));
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

bool ShapeReader::take(pugi::xml_node child, const std::string& name, const std::string& type, Parts& parts) {
  const std::string_view tag = elementName(child);
  if (tag == "bsdf") {
    takeBsdf(child, name, type, parts);
  } else if (tag == "emitter") {
    takeEmitter(child, parts);
  } else if (tag == "medium") {
    rejectMedium(context_, child);
  } else {
    return false;
  }
  return true;
}

/// A named bsdf of an OBJ is for the material of that name; Mitsuba 3 uses the name "bsdf" for the only one.
void ShapeReader::takeBsdf(pugi::xml_node child, const std::string& name, const std::string& type, Parts& parts) {
  if (type == "obj" && !name.empty() && name != "bsdf") {
    parts.named.emplace_back(name, child);
    return;
  }
  if (parts.bsdf) context_.file.fail(child, "a second bsdf for the same shape");
  parts.bsdf = child;
}

void ShapeReader::takeEmitter(pugi::xml_node node, Parts& parts) {
  const std::string type = typeOf(context_, node);
  if (type != "area") {
    context_.unsupported(node, "shape's emitter " + type,
                         fmt::format("unknown emitter type \"{}\" in a shape; known is area", type),
                         "the emitter is left out");
    return;
  }
  if (parts.emitter) context_.file.fail(node, "a second emitter for the same shape");
  const Parameters parameters = readParameters(
      context_, node, "texture",
      [this](pugi::xml_node child, const std::string& name, Parameters& p) { return textures_.take(child, name, p); });
  parts.emitter = makeFrom(context_, node, parameters, [&](const Parameters& p) {
    readSamplingWeight(context_, node, p);
    return AreaEmitter{emissionTexture(p, "radiance", grey(1.0f))};
  });
}

ShapeReader::Mesh ShapeReader::makeMesh(const std::string& type, const Parameters& parameters,
                                        const MeshOptions& options) {
  const std::filesystem::path path =
      context_.file.resolve(requiredText(parameters, "filename"), parameters.location("filename"));
  MeshSource source{type, path, 0, {}};
  bool loadMaterials = false;
  if (type == "serialized") source.index = readIndex(parameters, 0);
  if (type == "obj") {
    const bool isOfToday = context_.file.isOfToday();
    source.obj = {{}, readIndex(parameters, -1), readGrouping(parameters, isOfToday)};
    loadMaterials = parameters.flag("load_materials", !isOfToday);
  }
  return {{}, parameters.location("filename"), std::move(source), options, loadMaterials, false, ""};
}

void ShapeReader::addMesh(int group, pugi::xml_node node, Mesh mesh, const std::string& name, const Parts& parts) {
  std::vector<Shape>& shapes = shapesOf(group);
  const auto add = [&](const std::string& part, int material) {
    mesh.shapes.push_back({group, shapes.size()});
    shapes.push_back({part, TriangleMesh(), material, parts.emitter});
  };
  for (const auto& [material, bsdf] : parts.named) {
    mesh.source.obj.materials.push_back(material);
    add(fmt::format("{}:{}", name, material), materials_.use(bsdf));
  }
  if (mesh.loadMaterials && !parts.bsdf)
    for (const auto& [material, index] : libraryMaterials(node, mesh)) {
      mesh.source.obj.materials.push_back(material);
      add(fmt::format("{}:{}", name, material), index);
    }
  mesh.isNamed = context_.file.isOfToday() && parts.named.size() == 1 && !parts.bsdf && !mesh.loadMaterials;
  add(name, mesh.isNamed ? shapes.back().material : materialOf(parts));
  meshes_.push_back(std::move(mesh));
}

/// Each material is a shape of its own, and many shapes can name one OBJ with many materials.
std::vector<std::pair<std::string, int>> ShapeReader::libraryMaterials(pugi::xml_node node, const Mesh& mesh) {
  constexpr std::size_t kMost = std::size_t{1} << 18;
  std::vector<std::pair<std::string, int>> found;
  if (libraryMaterials_ <= kMost) found = objMaterials_.read(node, mesh.location, mesh.source);
  libraryMaterials_ += found.size();
  if (libraryMaterials_ > kMost)
    context_.file.fail(
        mesh.location,
        fmt::format("the shapes of the scene have more than {} materials from libraries of OBJ files together", kMost));
  return found;
}

void ShapeReader::readMeshes() {
  for (const Mesh& mesh : meshes_) budget_.addFile(mesh.source.path);
  parallelFor(std::size_t{0}, meshes_.size(), [this](std::size_t i) {
    read(meshes_[i]);
    if (context_.options.onProgress) context_.options.onProgress(1.0 / static_cast<double>(meshes_.size()));
  });
  if (budget_.isExceeded()) leaveOutMeshes();
  for (const Mesh& mesh : meshes_) reportFault(mesh);
  clearInstancesOutOfRange();
  for (const Mesh& mesh : meshes_) limitToMaterial(mesh);
  for (const Mesh& mesh : meshes_) noteUnusedMaterials(mesh);
  dropEmpty();
  for (Shape& shape : context_.scene.shapes)
    if (shape.emitter) dropDuplicates(shape);
}

/// A ray hits only one of several equal triangles, but each would be sampled as a light source of its own.
void ShapeReader::dropDuplicates(Shape& shape) {
  auto* mesh = std::get_if<TriangleMesh>(&shape.geometry);
  if (!mesh) return;
  if (const std::size_t count = removeDuplicateTriangles(*mesh); count > 0)
    context_.note(fmt::format("emitting shape \"{}\": {} triangles are equal to others of it, and are left out",
                              shape.name, count));
}

void ShapeReader::read(Mesh& mesh) {
  if (budget_.isExceeded()) return;
  try {
    std::vector<TriangleMesh> parts = lobe::readMeshes(mesh.source, mesh.options);
    for (const TriangleMesh& part : parts) budget_.addMesh(part.triangles.size(), part.positions.size());
    for (std::size_t i = 0; i < parts.size(); ++i)
      shapesOf(mesh.shapes[i].group)[mesh.shapes[i].index].geometry = std::move(parts[i]);
  } catch (const std::bad_alloc&) {
    throw;  // no fault of the file, so lenient reading must not go on without the mesh
  } catch (const std::exception& error) {
    mesh.fault = error.what();
  }
}

/// Which meshes have been read within the limit, or have other faults, depends on the order in which the threads have
/// read them.
void ShapeReader::leaveOutMeshes() {
  for (Mesh& mesh : meshes_) {
    mesh.fault = budget_.fault();
    for (const Place& place : mesh.shapes) shapesOf(place.group)[place.index].geometry = TriangleMesh();
  }
}

void ShapeReader::reportFault(const Mesh& mesh) {
  if (mesh.fault.empty()) return;
  const std::string message = fmt::format("shape \"{}\": {}", mesh.source.type, mesh.fault);
  context_.unsupported(mesh.location, message, message, "the shape is left out");
}

/// Cleared instances remain in the list of shapes, because others are referred to by index; readMeshes removes them at
/// its end.
void ShapeReader::clearInstancesOutOfRange() {
  const std::vector<Eigen::AlignedBox3d> groups = boundsOfGroups(context_.scene);
  std::erase_if(instances_, [&](const auto& entry) {
    const auto& [index, location] = entry;
    Geometry& geometry = context_.scene.shapes[index].geometry;
    const Eigen::AlignedBox3d box = boundsOf(std::get<Instance>(geometry), groups);
    if (box.isEmpty() || (isInRange(box.min().cast<float>()) && isInRange(box.max().cast<float>()))) return false;
    context_.unsupported(
        location, fmt::format("instance at {}", location),
        fmt::format("shape \"instance\": coordinates over {:g} in the world are not supported", kLargestCoordinate),
        "the instance is left out");
    geometry = TriangleMesh();
    return true;
  });
}

void ShapeReader::leaveOutFlatInstances() {
  if (instances_.empty()) return;
  const double reach = reachOfRays(context_.scene);
  const std::vector<Eigen::AlignedBox3d> groups = boundsOfGroups(context_.scene);
  auto place = instances_.begin();
  for (Shape& shape : context_.scene.shapes) {
    const auto* instance = std::get_if<Instance>(&shape.geometry);
    if (!instance) continue;
    const std::ptrdiff_t location = (place++)->second;
    if (isTraceable(*instance, reach) || !isResolved(boundsOf(*instance, groups), reach)) continue;
    context_.unsupported(location, "flat instance", "shape \"instance\": the instance is too flat to be traced",
                         "the instance is left out");
    shape.geometry = TriangleMesh();
  }
  dropEmpty();
}

/// Mitsuba 2 and 3 ignore the names of BSDFs, so that the only BSDF is that of all faces. A name that is that of a
/// material of the OBJ is taken as in Mitsuba 0.6, where the other faces have the default BSDF.
void ShapeReader::limitToMaterial(const Mesh& mesh) {
  if (!mesh.isNamed) return;
  const auto shapeAt = [this](const Place& place) -> Shape& { return shapesOf(place.group)[place.index]; };
  Shape& others = shapeAt(mesh.shapes[1]);
  if (!isEmptyMesh(shapeAt(mesh.shapes[0])) && !isEmptyMesh(others))
    others.material = materials_.useDefault(others.emitter.has_value());
}

void ShapeReader::noteUnusedMaterials(const Mesh& mesh) {
  if (!mesh.fault.empty() || mesh.isNamed) return;
  for (std::size_t i = 0; i < mesh.source.obj.materials.size(); ++i)
    if (isEmptyMesh(shapesOf(mesh.shapes[i].group)[mesh.shapes[i].index]))
      context_.note(fmt::format("{}: no face has the material \"{}\"", mesh.source.path.filename().string(),
                                mesh.source.obj.materials[i]));
}

void ShapeReader::dropEmpty() {
  std::erase_if(context_.scene.shapes, isEmptyMesh);
  for (ShapeGroup& group : context_.scene.groups) std::erase_if(group.shapes, isEmptyMesh);
}

}  // namespace lobe
