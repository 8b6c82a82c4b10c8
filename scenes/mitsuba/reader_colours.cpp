#include "scenes/mitsuba/reader_colours.h"

#include <algorithm>
#include <array>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "runtime/core/colour.h"
#include "runtime/core/files.h"
#include "scenes/mitsuba/reader_parameters.h"
#include "scenes/mitsuba/reader_values.h"
#include "scenes/mitsuba/spectra.h"
#include "scenes/mitsuba/values.h"

namespace lobe {
namespace {

constexpr std::array<std::string_view, 9> kSpectra = {"blackbody", "d65",  "irregular", "rawconstant", "regular",
                                                      "rgb",       "srgb", "srgb_d65",  "uniform"};

bool isInEmitter(pugi::xml_node node) {
  while (node && elementName(node) != "emitter") node = node.parent();
  return static_cast<bool>(node);
}

Illuminant illuminantOf(const ReadContext& context, pugi::xml_node node) {
  return context.file.isOfToday() && !isInEmitter(node) ? Illuminant::d65 : Illuminant::equalEnergy;
}

std::optional<Rgb> parseRgb(std::string_view text) {
  return text.find('#') == std::string_view::npos ? parseColour(text) : parseSrgb(text);
}

std::optional<Rgb> parseXyz(std::string_view text) {
  const auto values = parseNumbers(text);
  if (!values || values->size() != 3) return std::nullopt;
  return rgbOfXyz(Eigen::Vector3d(values->data()));
}

SpectrumFile readSpectrumFile(const std::filesystem::path& path) {
  try {
    return nameErrors(path, [&]() -> SpectrumFile {
      const std::optional<SpectrumPoints> points = parseSpectrumFile(readFile(path));
      if (!points) throw std::runtime_error("each line must have a wavelength, greater than the last, and a value");
      return {rgbOfSpectrum(*points, Illuminant::equalEnergy), rgbOfSpectrum(*points, Illuminant::d65)};
    });
  } catch (const std::runtime_error& error) {
    return {Rgb::Zero(), Rgb::Zero(), error.what()};
  }
}

/// The colour of the spectrum in the file of this name, which is read once, for an element. Throws std::runtime_error
/// that names the file.
Rgb colourFrom(ReadContext& context, pugi::xml_node node, const std::string& name, std::ptrdiff_t location) {
  const auto [entry, isNew] = context.spectra.try_emplace(context.file.resolve(name, location));
  SpectrumFile& file = entry->second;
  if (isNew) file = readSpectrumFile(entry->first);
  if (!file.fault.empty()) throw std::runtime_error(file.fault);
  return illuminantOf(context, node) == Illuminant::d65 ? file.d65 : file.equalEnergy;
}

Rgb readSpectrum(ReadContext& context, pugi::xml_node node) {
  if (node.attribute("filename")) {
    checkAttributes(context, node, {"name", "filename", "intent"});
    try {
      return colourFrom(context, node, node.attribute("filename").value(), SceneFile::location(node));
    } catch (const std::runtime_error& error) {
      context.file.fail(node, fmt::format("<spectrum>: {}", error.what()));
    }
  }
  if (const std::optional<SpectrumPoints> points = parseSpectrum(node.attribute("value").value())) {
    valueText(context, node);  // checks the other attributes
    return rgbOfSpectrum(*points, illuminantOf(context, node));
  }
  // A single number is a constant spectrum, but it is converted to grey even in emitters, as in Mitsuba's RGB modes.
  return parsedValue<Rgb>(context, node, parseColour,
                          "one or three numbers, or wavelength:value pairs with increasing wavelengths");
}

bool isTemperature(double kelvin) {
  return kelvin >= 100 && kelvin <= 1e6;
}

Rgb readBlackbody(const ReadContext& context, pugi::xml_node node) {
  checkAttributes(context, node, {"name", "temperature", "scale"});
  std::string_view temperature = node.attribute("temperature").value();
  if (temperature.ends_with('K') || temperature.ends_with('k')) temperature.remove_suffix(1);
  const std::optional<double> kelvin = parseNumber(temperature);
  const std::optional<double> scale = parseNumber(node.attribute("scale").as_string("1"));
  if (!kelvin || !isTemperature(*kelvin) || !scale)
    context.file.fail(node, "<blackbody> needs a temperature from 100 to 1e6 such as 5000K, and a number as scale");
  return rgbOfBlackbody(*kelvin) * static_cast<float>(*scale);
}

// ---- spectra with a type

float scaleOf(const Parameters& parameters) {
  return static_cast<float>(parameters.number("scale", 1.0));
}

/// The first of the names that is given.
const char* nameGiven(const Parameters& parameters, std::initializer_list<const char*> names) {
  for (const char* name : names)
    if (parameters.has(name)) return name;
  throw ParameterError("", fmt::format("one of the parameters {} is needed", fmt::join(names, ", ")));
}

Rgb makeBlackbody(const Parameters& parameters) {
  const double kelvin = parameters.number("temperature", 0.0);
  if (!isTemperature(kelvin))
    throw ParameterError("temperature", fmt::format("temperature must be from 100 to 1e6 K, not {}", kelvin));
  return rgbOfBlackbody(kelvin) * scaleOf(parameters);
}

TexturePtr makeD65(const Parameters& parameters) {
  const Rgb scale = grey(scaleOf(parameters));
  for (const char* name : {"color", "value", "texture"})
    if (parameters.has(name)) return scaledTexture(parameters.texture(name, grey(1.0f)), scale);
  return constantTexture(scale);
}

std::vector<double> numbersIn(const Parameters& parameters, const char* name) {
  const auto numbers = parseNumbers(requiredText(parameters, name));
  if (!numbers) throw ParameterError(name, fmt::format("{} must be numbers, separated by commas", name));
  return *numbers;
}

std::vector<double> equallySpaced(const Parameters& parameters, std::size_t count) {
  const double low = parameters.number(nameGiven(parameters, {"wavelength_min", "lambda_min"}), 0.0);
  const double high = parameters.number(nameGiven(parameters, {"wavelength_max", "lambda_max"}), 0.0);
  std::vector<double> result;
  for (std::size_t i = 0; i < count; ++i)
    result.push_back(std::lerp(low, high, static_cast<double>(i) / static_cast<double>(count - 1)));
  return result;
}

SpectrumPoints readCurve(const std::string& type, const Parameters& parameters) {
  const std::vector<double> values = numbersIn(parameters, "values");
  const bool regular = type == "regular";
  const std::optional<SpectrumPoints> points =
      spectrumOf(regular ? equallySpaced(parameters, values.size()) : numbersIn(parameters, "wavelengths"), values);
  if (!points)
    throw ParameterError("values", "a spectrum needs two or more increasing wavelengths and a value for each");
  return *points;
}

Rgb makeCurve(ReadContext& context, pugi::xml_node node, const std::string& type, const Parameters& parameters) {
  if (parameters.has("value"))
    return parameters.colour("value", Rgb::Zero());  // wavelength:value pairs, already converted
  if (!parameters.has("filename")) return rgbOfSpectrum(readCurve(type, parameters), illuminantOf(context, node));
  try {
    return colourFrom(context, node, parameters.text("filename", ""), parameters.location("filename"));
  } catch (const std::runtime_error& error) {
    throw ParameterError("filename", error.what());
  }
}

}  // namespace

std::optional<Rgb> readColour(ReadContext& context, pugi::xml_node node) {
  const std::string_view tag = elementName(node);
  if (tag == "srgb") return parsedValue<Rgb>(context, node, parseSrgb, "one or three numbers or #rrggbb");
  if (tag == "xyz") return parsedValue<Rgb>(context, node, parseXyz, "three numbers");
  if (tag == "blackbody") return readBlackbody(context, node);
  if (tag == "spectrum") return readSpectrum(context, node);
  if (tag == "rgb" || tag == "color")
    return parsedValue<Rgb>(context, node, parseRgb, "one or three numbers or #rrggbb");
  return std::nullopt;
}

bool isSpectrum(std::string_view type) {
  return std::ranges::find(kSpectra, type) != kSpectra.end();
}

std::string knownSpectra() {
  return fmt::format("{}", fmt::join(kSpectra, ", "));
}

TexturePtr makeSpectrum(ReadContext& context, pugi::xml_node node, const std::string& type,
                        const Parameters& parameters) {
  const auto colour = [&](std::initializer_list<const char*> names) {
    return parameters.colour(nameGiven(parameters, names), Rgb::Zero());
  };
  if (type == "d65") return makeD65(parameters);
  if (type == "blackbody") return constantTexture(makeBlackbody(parameters));
  if (type == "irregular" || type == "regular") return constantTexture(makeCurve(context, node, type, parameters));
  if (type == "uniform" || type == "rawconstant") return constantTexture(colour({"value"}));
  return constantTexture(colour({"color", "value"}));
}

}  // namespace lobe
