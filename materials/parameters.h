#pragma once
// The named parameters of one element of a scene file, as used by the models and the scene reader.
//
// Names are in snake_case regardless of the spelling in the file: the reader converts alphaU to alpha_u and intIOR to
// int_ior. Every query marks its parameter as used, so that unused parameters can be reported instead of ignored.

#include <cstddef>
#include <cstdint>
#include <map>
#include <set>
#include <stdexcept>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "materials/bsdf.h"
#include "materials/texture.h"
#include "runtime/core/vec.h"

namespace lobe {

/// A parameter is missing or has an invalid value. The reader adds file, line and column.
class ParameterError : public std::runtime_error {
 public:
  ParameterError(std::string parameter, const std::string& message)
      : std::runtime_error(message), name(std::move(parameter)) {}
  std::string name;  ///< empty if the error concerns the whole element
};

using ParameterValue = std::variant<bool, double, std::string, Rgb, Eigen::Matrix4d, TexturePtr>;

class Parameters {
 public:
  /// location: offset of the parameter in its file, which location() returns.
  void set(const std::string& name, ParameterValue value, std::ptrdiff_t location = 0);
  /// Records that part of the element could not be read, so that missing parameters are not reported as further errors.
  void markIncomplete() { incomplete_ = true; }
  bool isIncomplete() const { return incomplete_; }

  /// Removes a parameter, as if the file did not contain it.
  void erase(const std::string& name) { entries_.erase(name); }
  /// Sets a parameter unless the file contains it. It counts as used even if it is never queried.
  void setDefault(const std::string& name, ParameterValue value);
  void addChild(BsdfPtr bsdf) { children_.push_back(std::move(bsdf)); }

  /// Hash of all names and values, with the fingerprints of textures. Children are excluded, and so are file names,
  /// because a path does not identify the content.
  std::uint64_t fingerprint() const;

  /// Whether the parameter is present. has() records that the model knows the name; contains() does not, and is for
  /// code that only passes parameters on.
  bool has(std::string_view name) const;
  bool contains(std::string_view name) const;
  /// Whether the parameter is present and holds text, for parameters that accept a name or a number.
  bool holdsText(std::string_view name) const;
  /// The same for parameters that accept a number or a texture.
  bool holdsTexture(std::string_view name) const;
  /// Whether the parameter is a texture other than a constant one.
  bool varies(std::string_view name) const;

  // Each returns the fallback if the parameter is missing and throws ParameterError if it has another type.
  bool flag(std::string_view name, bool fallback) const;
  double number(std::string_view name, double fallback) const;
  std::string text(std::string_view name, std::string fallback) const;
  /// Accepts rgb, a number (as grey) or a constant texture.
  Rgb colour(std::string_view name, const Rgb& fallback) const;
  /// Accepts a texture, rgb or a number. Throws ParameterError also if rgb or number is negative or not finite.
  TexturePtr texture(std::string_view name, const Rgb& fallback) const;
  Eigen::Matrix4d transform(std::string_view name) const;  ///< identity when missing
  /// The only texture among the parameters, regardless of its name (a nested texture may have none). Throws
  /// ParameterError if there is none or more than one.
  TexturePtr onlyTexture() const;

  const std::vector<BsdfPtr>& children() const { return children_; }
  /// The only nested BSDF. Throws ParameterError if there is none or more than one.
  BsdfPtr onlyChild() const;

  std::vector<std::string> unused() const;
  /// All names that were queried, present or not: the parameters that the model knows, for messages.
  const std::set<std::string, std::less<>>& asked() const { return asked_; }
  std::ptrdiff_t location(std::string_view name) const;  ///< 0 when unknown

  /// Adds a one-line note for the user about how parameters were interpreted. Libraries do not print; the tools do.
  void note(std::string text) const { notes_.push_back(std::move(text)); }
  const std::vector<std::string>& notes() const { return notes_; }

  /// A questionable value. The text says what was found and what is used; the reader adds file, line and column of the
  /// parameter (of the element if the name is empty).
  struct Warning {
    std::string name, text;
  };
  void warn(std::string name, std::string text) const { warnings_.push_back({std::move(name), std::move(text)}); }
  const std::vector<Warning>& warnings() const { return warnings_; }

 private:
  struct Entry {
    ParameterValue value;
    std::ptrdiff_t location;
    mutable bool used = false;
  };
  const Entry* find(std::string_view name) const;

  std::map<std::string, Entry, std::less<>> entries_;
  mutable std::set<std::string, std::less<>> asked_;
  mutable std::vector<std::string> notes_;
  mutable std::vector<Warning> warnings_;
  std::vector<BsdfPtr> children_;
  bool incomplete_ = false;
};

}  // namespace lobe
