#pragma once
// The named parameters of one element of a scene file, as models and the scene reader see them.
//
// Names are in snake_case whatever the file's spelling: the reader turns alphaU into alpha_u and intIOR into int_ior.
// Every query marks its parameter as used, so that what nobody asked for can be reported instead of ignored.

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

/// A parameter is missing or has a wrong value. The reader adds file, line and column.
class ParameterError : public std::runtime_error {
 public:
  ParameterError(std::string parameter, const std::string& message)
      : std::runtime_error(message), name(std::move(parameter)) {}
  std::string name;  ///< empty: the element as a whole
};

using ParameterValue = std::variant<bool, double, std::string, Rgb, Eigen::Matrix4d, TexturePtr>;

class Parameters {
 public:
  /// location: where the parameter stands in its file (an offset), handed back by unused() and location().
  void set(const std::string& name, ParameterValue value, std::ptrdiff_t location = 0);
  /// That something given could not be read: what is missing then is no fault of its own.
  void markIncomplete() { incomplete_ = true; }
  bool isIncomplete() const { return incomplete_; }

  /// As if it had never been given.
  void erase(const std::string& name) { entries_.erase(name); }
  /// The value of a parameter that the file does not give. It is as if it were there, but nobody has to ask for it.
  void setDefault(const std::string& name, ParameterValue value);
  void addChild(BsdfPtr bsdf) { children_.push_back(std::move(bsdf)); }

  /// Of all names and values, textures by what they show. Not of the children, nor of file names, which say where
  /// something is, not what.
  std::uint64_t fingerprint() const;

  /// For those who know what to do with it: the name counts as asked for. contains is for those who only pass it on.
  bool has(std::string_view name) const;
  bool contains(std::string_view name) const;
  /// Whether the parameter is there and is text, for what may be given by name or by number.
  bool holdsText(std::string_view name) const;
  /// The same for what may be a number or a texture.
  bool holdsTexture(std::string_view name) const;
  /// Whether it is a texture of more than one colour.
  bool varies(std::string_view name) const;

  // Each returns the fallback when there is no such parameter and throws ParameterError when it has another type.
  bool flag(std::string_view name, bool fallback) const;
  double number(std::string_view name, double fallback) const;
  std::string text(std::string_view name, std::string fallback) const;
  /// From rgb, a number as grey, or a texture that is the same colour everywhere.
  Rgb colour(std::string_view name, const Rgb& fallback) const;
  /// From texture, rgb or number; ParameterError also where one of the latter is negative or not finite.
  TexturePtr texture(std::string_view name, const Rgb& fallback) const;
  Eigen::Matrix4d transform(std::string_view name) const;  ///< identity when missing
  /// The only texture among the parameters, whatever its name (a nested texture may have none); ParameterError when
  /// there are none or several.
  TexturePtr onlyTexture() const;

  const std::vector<BsdfPtr>& children() const { return children_; }
  /// The only nested BSDF; ParameterError when there are none or several.
  BsdfPtr onlyChild() const;

  std::vector<std::string> unused() const;
  /// Every name that was asked for, there or not: what the model knows, for messages.
  const std::set<std::string, std::less<>>& asked() const { return asked_; }
  std::ptrdiff_t location(std::string_view name) const;  ///< 0 when unknown

  /// Something the user should know of what became of the parameters, one line; libraries do not print.
  void note(std::string text) const { notes_.push_back(std::move(text)); }
  const std::vector<std::string>& notes() const { return notes_; }

  /// A value that was not taken as it stands: the reader adds file, line and column of the parameter (of the element
  /// when the name is empty). The text says what was found and what is used instead.
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
