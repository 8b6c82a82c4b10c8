#include "scenes/mitsuba/transforms.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <fmt/format.h>
#include <Eigen/Geometry>

#include "scenes/mitsuba/values.h"

namespace lobe {
namespace {

double readNumber(const ReadContext& context, pugi::xml_node node, const char* attribute, double fallback) {
  const pugi::xml_attribute text = node.attribute(attribute);
  if (!text) return fallback;
  const std::optional<double> value = parseNumber(text.value());
  if (!value)
    context.file.fail(node, fmt::format("{}=\"{}\" of <{}> is not a number", attribute, text.value(), node.name()));
  return *value;
}

Eigen::Vector3d readTriple(const ReadContext& context, pugi::xml_node node, const char* attribute) {
  const std::string text = node.attribute(attribute).value();
  const auto values = parseNumbers(text);
  if (!values || values->size() != 3)
    context.file.fail(node, fmt::format("{}=\"{}\" of <{}> is not three numbers", attribute, text, node.name()));
  return Eigen::Vector3d(values->data());
}

Eigen::Matrix4d readRotation(const ReadContext& context, pugi::xml_node node) {
  checkAttributes(context, node, {"x", "y", "z", "value", "angle"});
  const Eigen::Vector3d axis = readVector(context, node, 0);
  if (!(axis.norm() > 0)) context.file.fail(node, "<rotate> needs an axis that is not zero");
  const double radians = readNumber(context, node, "angle", 0) * std::numbers::pi / 180;
  Eigen::Matrix4d m = Eigen::Matrix4d::Identity();
  m.topLeftCorner<3, 3>() = Eigen::AngleAxisd(radians, axis.normalized()).toRotationMatrix();
  return m;
}

/// The vector that Mitsuba 3 (today), or 0.6, takes as `up` if none is given: the first one of a frame about the unit
/// vector n (Duff et al. 2017, "Building an Orthonormal Basis, Revisited", or the cross product with an axis).
Eigen::Vector3d defaultUp(const Eigen::Vector3d& n, bool today) {
  if (today) {
    const double sign = std::copysign(1.0, n.z()), a = -1 / (sign + n.z());
    return {1 + sign * n.x() * n.x() * a, sign * n.x() * n.y() * a, -sign * n.x()};
  }
  const Eigen::Vector3d across =
      std::abs(n.x()) > std::abs(n.y()) ? Eigen::Vector3d(n.z(), 0, -n.x()) : Eigen::Vector3d(0, n.z(), -n.y());
  return across.normalized().cross(n);
}

Eigen::Matrix4d readLookAt(const ReadContext& context, pugi::xml_node node) {
  checkAttributes(context, node, {"origin", "target", "up"});
  const Eigen::Vector3d origin = readTriple(context, node, "origin"), target = readTriple(context, node, "target");
  Eigen::Vector3d up = node.attribute("up") ? readTriple(context, node, "up") : Eigen::Vector3d::Zero();
  if (up.isZero(0)) up = defaultUp((target - origin).normalized(), context.file.isOfToday());
  const auto m = lookAt(origin, target, up);
  if (!m) context.file.fail(node, "<lookat> has its target at its origin");
  return *m;
}

Eigen::Matrix4d readMatrix(const ReadContext& context, pugi::xml_node node) {
  checkAttributes(context, node, {"value"});
  const auto values = parseNumbers(node.attribute("value").value());
  const std::size_t count = values ? values->size() : 0;
  if (count != 16 && count != 9) context.file.fail(node, "<matrix> needs 16 or 9 numbers in its value");
  if (count == 9) {
    Eigen::Matrix4d m = Eigen::Matrix4d::Identity();
    m.topLeftCorner<3, 3>() = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>(values->data());
    return m;
  }
  Eigen::Matrix4d m = Eigen::Matrix<double, 4, 4, Eigen::RowMajor>(values->data());
  const Eigen::RowVector4d affine(0, 0, 0, 1);
  constexpr double kRounding = 1e-6;
  if (!((m.row(3) - affine).cwiseAbs().maxCoeff() <= kRounding))
    context.file.fail(node, "the last row of <matrix> is not 0 0 0 1: perspective is not supported here");
  m.row(3) = affine;
  return m;
}

Eigen::Matrix4d readStep(const ReadContext& context, pugi::xml_node node) {
  const std::string_view name = elementName(node);
  if (name == "rotate") return readRotation(context, node);
  if (name == "lookat") return readLookAt(context, node);
  if (name == "matrix") return readMatrix(context, node);
  Eigen::Matrix4d m = Eigen::Matrix4d::Identity();
  if (name == "translate" || name == "scale") checkAttributes(context, node, {"x", "y", "z", "value"});
  if (name == "translate")
    m.topRightCorner<3, 1>() = readVector(context, node, 0);
  else if (name == "scale")
    m.diagonal().head<3>() = readVector(context, node, 1, true);
  else
    context.file.fail(
        node, fmt::format("unknown element <{}> in a transform; known are translate, scale, rotate, lookat, matrix",
                          node.name()));
  return m;
}

}  // namespace

Eigen::Matrix4d readTransform(ReadContext& context, pugi::xml_node transform) {
  checkAttributes(context, transform, {"name"});
  Eigen::Matrix4d product = Eigen::Matrix4d::Identity();
  for (const pugi::xml_node step : transform.children()) {
    rejectText(context, step);
    product = readStep(context, step) * product;
  }
  return product;
}

std::optional<Eigen::Matrix4d> lookAt(const Eigen::Vector3d& origin, const Eigen::Vector3d& target,
                                      const Eigen::Vector3d& up) {
  const Eigen::Vector3d view = (target - origin).normalized();
  if (!(view.norm() > 0)) return std::nullopt;
  Eigen::Vector3d left = up.cross(view);
  if (!(left.norm() > 1e-9 * up.norm())) left = view.unitOrthogonal();
  Eigen::Matrix4d m = Eigen::Matrix4d::Identity();
  m.col(0).head<3>() = left.normalized();
  m.col(1).head<3>() = view.cross(left.normalized());
  m.col(2).head<3>() = view;
  m.col(3).head<3>() = origin;
  return m;
}

Eigen::Vector3d readVector(const ReadContext& context, pugi::xml_node node, double fallback, bool oneForAll) {
  if (!node.attribute("value"))
    return {readNumber(context, node, "x", fallback), readNumber(context, node, "y", fallback),
            readNumber(context, node, "z", fallback)};
  if (node.attribute("x") || node.attribute("y") || node.attribute("z"))
    context.file.fail(node, fmt::format("<{}> has both a value and x, y or z", node.name()));
  if (oneForAll)
    if (const std::optional<double> value = parseNumber(node.attribute("value").value()))
      return Eigen::Vector3d::Constant(*value);
  return readTriple(context, node, "value");
}

void checkAttributes(const ReadContext& context, pugi::xml_node node, std::initializer_list<std::string_view> known) {
  for (const pugi::xml_attribute attribute : node.attributes())
    if (std::ranges::find(known, std::string_view(attribute.name())) == known.end())
      context.file.fail(node, fmt::format("unknown attribute {}=\"{}\" of <{}>; known are {}", attribute.name(),
                                          attribute.value(), node.name(), fmt::join(known, ", ")));
}

}  // namespace lobe
