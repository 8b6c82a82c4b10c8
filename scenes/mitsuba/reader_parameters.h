#pragma once
// The children of a scene file's element as named parameters.

#include <functional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "materials/parameters.h"
#include "scenes/mitsuba/read_context.h"

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

/// Warns that a parameter is given again at this element: the last one is used.
void warnOfRepetition(ReadContext& context, pugi::xml_node node, const std::string& name);

/// A fault for every parameter that nobody asked for, or a warning in files below version 2, whose renderer ignores
/// them; a note for those that do not change the picture.
void checkUnused(ReadContext& context, pugi::xml_node node, const Parameters& parameters);

/// Passes on what the makers of the element noted and warned of.
void passOnRemarks(ReadContext& context, pugi::xml_node node, const Parameters& parameters);

/// Throws SceneError: with this fault, or with none when something in the element could not be read already.
[[noreturn]] void failUnlessIncomplete(const ReadContext& context, pugi::xml_node node, const Parameters& parameters,
                                       std::string_view message);

/// Parameters that a model refuses, one after the other.
class RefusedParameters {
 public:
  /// Erases the parameter that the error names. Throws SceneError when it names none that is there: the element itself
  /// is refused, for the last parameter's sake if there was one.
  void erase(ReadContext& context, pugi::xml_node node, Parameters& parameters, const ParameterError& error);
  /// A fault for each.
  void report(ReadContext& context) const;

 private:
  struct Refused {
    std::string name, message;
    std::ptrdiff_t location;
  };
  std::vector<Refused> all_;
};

/// make(parameters), with its notes and warnings passed on; afterwards checkUnused. A parameter that make refuses by a
/// ParameterError is a fault, and make is called again without it, so that it must leave nothing behind when it throws.
/// SceneError: the element itself is refused.
template <typename Make>
auto makeFrom(ReadContext& context, pugi::xml_node node, Parameters parameters, Make&& make) {
  RefusedParameters refused;
  for (;;) {
    try {
      auto result = make(std::as_const(parameters));
      refused.report(context);
      checkUnused(context, node, parameters);
      passOnRemarks(context, node, parameters);
      return result;
    } catch (const ParameterError& error) {
      refused.erase(context, node, parameters, error);
    }
  }
}

/// The text parameter that must be there, else a ParameterError.
std::string requiredText(const Parameters& parameters, const std::string& name);

/// The rotation in a transform of something infinitely far away, where a uniform scale and a translation do not matter.
/// ParameterError when there is more in it.
Eigen::Matrix3f rotationOf(const Parameters& parameters, const char* name);

/// As floats, for the world of shapes and cameras.
Eigen::Matrix4f toWorld(const Parameters& parameters);

/// The same for what stands at its origin. ParameterError when that is too far away (see scene_scale.h).
Eigen::Matrix4f placeInWorld(const Parameters& parameters);

/// ParameterError of that name when the position is too far away.
void requireInRange(const Vec3& position, const char* name);

}  // namespace lobe
