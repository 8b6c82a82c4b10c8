#pragma once
// Reads the children of a scene file's element as named parameters.

#include <functional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "materials/parameters.h"
#include "scenes/mitsuba/read_context.h"

namespace lobe {

/// Called for each child that is not a plain value, with references already resolved. name: the child's name attribute
/// as written (may be empty). Returns whether such a child is allowed here.
using ChildHandler = std::function<bool(pugi::xml_node child, const std::string& name, Parameters& parameters)>;

/// The plain values among the children, with names in snake_case; points and vectors become colours, integers become
/// numbers. All other children are passed to onChild; knownChildren lists, for messages, those that it accepts. Throws
/// SceneError.
Parameters readParameters(ReadContext& context, pugi::xml_node node, const std::string& knownChildren,
                          const ChildHandler& onChild);

/// The same for elements without other children.
Parameters readParameters(ReadContext& context, pugi::xml_node node);

/// Warns at this element that a parameter is given again: the last one is used.
void warnOfRepetition(ReadContext& context, pugi::xml_node node, const std::string& name);

/// Reports a fault for every parameter that was never queried, or a warning in files below version 2, because their
/// renderer ignores such parameters; a note for those that do not change the picture.
void checkUnused(ReadContext& context, pugi::xml_node node, const Parameters& parameters);

/// Reports the notes and warnings that were added to the parameters while the element was made.
void passOnRemarks(ReadContext& context, pugi::xml_node node, const Parameters& parameters);

/// Throws SceneError with this fault, or without a fault when another part of the element could not be read, which has
/// been reported already.
[[noreturn]] void failUnlessIncomplete(const ReadContext& context, pugi::xml_node node, const Parameters& parameters,
                                       std::string_view message);

/// Collects the parameters that a model rejects.
class RefusedParameters {
 public:
  /// Erases the parameter that the error names. If there is no such parameter, the element itself is rejected: throws
  /// SceneError with the fault of the last erased parameter or, if there is none, with this error.
  void erase(ReadContext& context, pugi::xml_node node, Parameters& parameters, const ParameterError& error);
  /// Reports a fault for each of them.
  void report(ReadContext& context) const;

 private:
  struct Refused {
    std::string name, message;
    std::ptrdiff_t location;
  };
  std::vector<Refused> all_;
};

/// Returns make(parameters), reports its notes and warnings, and calls checkUnused. When make rejects a parameter by a
/// ParameterError, this is reported as a fault, and make is called again without the parameter, so it must not have
/// side effects when it throws. Throws SceneError when the element itself is rejected.
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

/// A required text parameter. Throws ParameterError when it is missing.
std::string requiredText(const Parameters& parameters, const std::string& name);

/// The rotation in the transform of something infinitely far away, for which a uniform scale and a translation have no
/// effect. Throws ParameterError when it contains anything else.
Eigen::Matrix3f rotationOf(const Parameters& parameters, const char* name);

/// The parameter to_world in single precision.
Eigen::Matrix4f toWorld(const Parameters& parameters);

/// The same for an object at the origin of its local frame. Throws ParameterError when it is too far away (see
/// scene_scale.h).
Eigen::Matrix4f placeInWorld(const Parameters& parameters);

/// Throws ParameterError with this name when the position is too far away.
void requireInRange(const Vec3& position, const char* name);

}  // namespace lobe
