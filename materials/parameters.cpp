#include "materials/parameters.h"

#include <fmt/format.h>

#include "runtime/core/fingerprint.h"

namespace lobe {
namespace {

// In the order of ParameterValue's alternatives.
constexpr const char* kKindNames[] = {"boolean", "number", "text", "colour", "transform", "texture"};

[[noreturn]] void wrongKind(std::string_view name, const ParameterValue& value, const char* wanted) {
  throw ParameterError(std::string(name), fmt::format("parameter \"{}\" is of type {}, but type {} is needed", name,
                                                      kKindNames[value.index()], wanted));
}

/// Adds a parameter value of any type to a hash.
struct FingerprintOfValue {
  Fingerprint& hash;
  void operator()(bool value) const { hash.number(value); }
  void operator()(double value) const { hash.number(value); }
  void operator()(const std::string& value) const { hash.text(value); }
  void operator()(const Rgb& value) const { hash.coefficients(value); }
  void operator()(const Eigen::Matrix4d& value) const { hash.coefficients(value); }
  void operator()(const TexturePtr& value) const { hash.number(value->fingerprint()); }
};

}  // namespace

std::uint64_t Parameters::fingerprint() const {
  Fingerprint hash;
  for (const auto& [name, entry] : entries_) {
    if (name == "filename") continue;
    hash.text(name);
    hash.number(entry.value.index());
    std::visit(FingerprintOfValue{hash}, entry.value);
  }
  return hash.value();
}

void Parameters::set(const std::string& name, ParameterValue value, std::ptrdiff_t location) {
  entries_.insert_or_assign(name, Entry{std::move(value), location, false});
}

void Parameters::setDefault(const std::string& name, ParameterValue value) {
  entries_.try_emplace(name, Entry{std::move(value), 0, true});
}

const Parameters::Entry* Parameters::find(std::string_view name) const {
  asked_.emplace(name);
  const auto it = entries_.find(name);
  if (it == entries_.end()) return nullptr;
  it->second.used = true;
  return &it->second;
}

bool Parameters::has(std::string_view name) const {
  asked_.emplace(name);
  return contains(name);
}

bool Parameters::contains(std::string_view name) const {
  return entries_.find(name) != entries_.end();
}

bool Parameters::holdsText(std::string_view name) const {
  const auto it = entries_.find(name);
  return it != entries_.end() && std::holds_alternative<std::string>(it->second.value);
}

bool Parameters::holdsTexture(std::string_view name) const {
  const auto it = entries_.find(name);
  return it != entries_.end() && std::holds_alternative<TexturePtr>(it->second.value);
}

bool Parameters::varies(std::string_view name) const {
  return holdsTexture(name) && !std::get<TexturePtr>(entries_.find(name)->second.value)->constantColour();
}

bool Parameters::flag(std::string_view name, bool fallback) const {
  const Entry* entry = find(name);
  if (!entry) return fallback;
  if (const bool* value = std::get_if<bool>(&entry->value)) return *value;
  wrongKind(name, entry->value, "boolean");
}

double Parameters::number(std::string_view name, double fallback) const {
  const Entry* entry = find(name);
  if (!entry) return fallback;
  if (const double* value = std::get_if<double>(&entry->value)) return *value;
  wrongKind(name, entry->value, "number");
}

std::string Parameters::text(std::string_view name, std::string fallback) const {
  const Entry* entry = find(name);
  if (!entry) return fallback;
  if (const std::string* value = std::get_if<std::string>(&entry->value)) return *value;
  wrongKind(name, entry->value, "text");
}

Rgb Parameters::colour(std::string_view name, const Rgb& fallback) const {
  const Entry* entry = find(name);
  if (!entry) return fallback;
  if (const Rgb* value = std::get_if<Rgb>(&entry->value)) return *value;
  if (const double* value = std::get_if<double>(&entry->value)) return grey(static_cast<float>(*value));
  if (const TexturePtr* value = std::get_if<TexturePtr>(&entry->value))
    if (const std::optional<Rgb> constant = (*value)->constantColour()) return *constant;
  wrongKind(name, entry->value, "colour");
}

TexturePtr Parameters::texture(std::string_view name, const Rgb& fallback) const {
  if (const Entry* entry = find(name))
    if (const TexturePtr* value = std::get_if<TexturePtr>(&entry->value); value && !(*value)->constantColour())
      return *value;
  const Rgb constant = colour(name, fallback);
  // Negated, so that NaN is rejected, too.
  if (!((constant >= 0.0f).all() && constant.allFinite()))
    throw ParameterError(std::string(name), fmt::format("{} must be finite and not negative, but is {} {} {}", name,
                                                        constant.x(), constant.y(), constant.z()));
  return constantTexture(constant);
}

TexturePtr Parameters::onlyTexture() const {
  TexturePtr only;
  for (const auto& [name, entry] : entries_) {
    const TexturePtr* value = std::get_if<TexturePtr>(&entry.value);
    if (!value) continue;
    if (only) throw ParameterError(name, "one nested texture is needed, but there are several");
    only = *value;
    entry.used = true;
  }
  if (!only) throw ParameterError("", "a nested texture is needed, but there is none");
  return only;
}

Eigen::Matrix4d Parameters::transform(std::string_view name) const {
  const Entry* entry = find(name);
  if (!entry) return Eigen::Matrix4d::Identity();
  if (const Eigen::Matrix4d* value = std::get_if<Eigen::Matrix4d>(&entry->value)) return *value;
  wrongKind(name, entry->value, "transform");
}

BsdfPtr Parameters::onlyChild() const {
  if (children_.size() != 1)
    throw ParameterError("", fmt::format("one nested bsdf is needed, but there are {}", children_.size()));
  return children_.front();
}

std::vector<std::string> Parameters::unused() const {
  std::vector<std::string> names;
  for (const auto& [name, entry] : entries_)
    if (!entry.used) names.push_back(name);
  return names;
}

std::ptrdiff_t Parameters::location(std::string_view name) const {
  const auto it = entries_.find(name);
  return it == entries_.end() ? 0 : it->second.location;
}

}  // namespace lobe
