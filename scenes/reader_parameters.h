#pragma once
// The children of a scene file's element as named parameters.

#include <functional>
#include <string>
#include <string_view>

#include "materials/parameters.h"
#include "scenes/read_context.h"

namespace lobe {

/// Told of each child that is no plain value, with references already followed, and the name that its parent knows it
/// by, as it is written (may be empty). Returns whether such a child has its place here.
using ChildHandler = std::function<bool(pugi::xml_node child, const std::string& name, Parameters& parameters)>;

/// The plain values among the children, names in snake_case; points and vectors are colours, integers are numbers. What
/// else there is goes to onChild; knownChildren lists for messages what that takes. Throws SceneError.
Parameters readParameters(ReadContext& context, pugi::xml_node node, const std::string& knownChildren,
                          const ChildHandler& onChild);

/// The same for elements without other children.
Parameters readParameters(ReadContext& context, pugi::xml_node node);

/// Throws SceneError at the parameter that the error names, or else at the element.
[[noreturn]] void failAt(const ReadContext& context, pugi::xml_node node, const Parameters& parameters,
                         const ParameterError& error);

/// Complains about every parameter that nobody asked for; notes those which may be there but have no effect here.
void checkUnused(ReadContext& context, pugi::xml_node node, const Parameters& parameters);

/// Notes in one line what parameters the element has that nobody asked for: they have no effect.
void noteUnused(ReadContext& context, pugi::xml_node node, const Parameters& parameters);

/// Passes on what the makers of the element noted and warned of.
void passOnRemarks(ReadContext& context, pugi::xml_node node, const Parameters& parameters);

/// make(parameters), its ParameterError put in its place and its notes and warnings passed on; afterwards checkUnused.
template <typename Make>
auto makeFrom(ReadContext& context, pugi::xml_node node, const Parameters& parameters, Make&& make) {
  try {
    auto result = make(parameters);
    checkUnused(context, node, parameters);
    passOnRemarks(context, node, parameters);
    return result;
  } catch (const ParameterError& error) {
    failAt(context, node, parameters, error);
  }
}

/// The text parameter that must be there, else a ParameterError.
std::string requiredText(const Parameters& parameters, const std::string& name);

/// The rotation in a transform of something infinitely far away, where a uniform scale and a translation do not matter.
/// ParameterError when there is more in it.
Eigen::Matrix3f rotationOf(const Parameters& parameters, const char* name);

/// As floats, for the world of shapes and cameras.
Eigen::Matrix4f toWorld(const Parameters& parameters);

}  // namespace lobe
