#pragma once
// Transforms of scene files.

#include <initializer_list>
#include <optional>
#include <string_view>

#include <Eigen/Core>

#include "scenes/mitsuba/read_context.h"

namespace lobe {

/// The product of a <transform>'s steps, the first applied first. Every step is affine. Throws SceneError.
Eigen::Matrix4d readTransform(ReadContext& context, pugi::xml_node transform);

/// Camera-to-world: +z from origin to target, +y towards up, +x to the left. If up is parallel to the viewing
/// direction, +y is arbitrary. nullopt when the target is the origin.
std::optional<Eigen::Matrix4d> lookAt(const Eigen::Vector3d& origin, const Eigen::Vector3d& target,
                                      const Eigen::Vector3d& up);

/// The components of a vector element: "x= y= z=" (missing ones are `fallback`) or "value=" with three numbers or, if
/// oneForAll, with one number for all three. Throws SceneError for anything else.
Eigen::Vector3d readVector(const ReadContext& context, pugi::xml_node node, double fallback, bool oneForAll = false);

/// Throws SceneError when the element has an attribute that is not listed.
void checkAttributes(const ReadContext& context, pugi::xml_node node, std::initializer_list<std::string_view> known);

}  // namespace lobe
