#include "scenes/meshes/mtl.h"

#include <optional>
#include <stdexcept>

#include <fmt/format.h>

#include "runtime/core/colour.h"
#include "runtime/core/numbers.h"
#include "scenes/meshes/obj_lines.h"

namespace lobe {
namespace {

class MtlParser {
 public:
  explicit MtlParser(std::string_view text) : lines_(text) {}

  std::vector<MtlMaterial> parse() {
    while (const std::optional<std::string_view> line = lines_.next()) readLine(trimmed(*line));
    return std::move(materials_);
  }

 private:
  void readLine(std::string_view line) {
    const std::string_view key = takeWord(line);
    const std::string_view rest = trimmed(line);
    if (key == "newmtl") {
      materials_.emplace_back();
      materials_.back().name = rest;
    } else if (!materials_.empty()) {
      readStatement(key, rest, materials_.back());
    }
  }

  void readStatement(std::string_view key, std::string_view rest, MtlMaterial& material) {
    if (key == "Kd") {
      material.diffuse = readColour(rest);
      material.diffuseFile.clear();
    } else if (key == "Ks") {
      material.specular = readColour(rest);
      material.specularFile.clear();
    } else if (key == "Ns") {
      material.exponent = readNumber(rest);
    } else if (key == "d") {
      material.opacity = readNumber(rest);
      material.opacityFile.clear();
    } else if (key == "illum") {
      material.illumination = parseInteger(rest).value_or(0);
    } else if (std::string* file = fileOf(key, material)) {
      *file = readFile(rest, material);
    }
  }

  static std::string* fileOf(std::string_view key, MtlMaterial& material) {
    if (key == "map_Kd") return &material.diffuseFile;
    if (key == "map_Ks") return &material.specularFile;
    if (key == "map_d") return &material.opacityFile;
    return key == "bump" ? &material.bumpFile : nullptr;
  }

  float readNumber(std::string_view rest) const {
    const std::string_view word = takeWord(rest);
    const std::optional<double> number = parseReal(word);
    if (!number) throw std::runtime_error(lines_.describe(fmt::format("\"{}\" is not a number", word)));
    return static_cast<float>(*number);
  }

  /// A single number is grey.
  Rgb readColour(std::string_view rest) const {
    Rgb colour = grey(readNumber(rest));
    takeWord(rest);
    if (!trimmed(rest).empty())
      for (int i = 1; i < 3; ++i) {
        colour[i] = readNumber(rest);
        takeWord(rest);
      }
    return decodeSrgb(colour);
  }

  /// File names may contain blanks; options before the name shift or scale the image.
  std::string readFile(std::string_view rest, MtlMaterial& material) const {
    if (!rest.starts_with('-')) return std::string(rest);
    material.faults.push_back(lines_.describe("the options of the image are ignored"));
    return std::string(rest.substr(rest.find_last_of(" \t") + 1));
  }

  ObjLines lines_;
  std::vector<MtlMaterial> materials_;
};

}  // namespace

std::vector<MtlMaterial> parseMtl(std::string_view text) {
  return MtlParser(text).parse();
}

}  // namespace lobe
