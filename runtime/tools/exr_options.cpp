#include "runtime/tools/exr_options.h"

#include <utility>

#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include "runtime/tools/option_names.h"
#include "runtime/tools/tool.h"

namespace lobe {

std::vector<CLI::Option*> addExrOptions(CLI::App& app, ExrFormat& format) {
  using Type = ExrFormat::Type;
  using Compression = ExrFormat::Compression;
  static const std::vector<std::pair<std::string, Type>> types{{"float", Type::floats}, {"half", Type::halves}};
  static const std::vector<std::pair<std::string, Compression>> compressions{
      {"none", Compression::none}, {"rle", Compression::rle},   {"zips", Compression::zips}, {"zip", Compression::zip},
      {"piz", Compression::piz},   {"dwaa", Compression::dwaa}, {"dwab", Compression::dwab}};
  return {
      app.add_option("--exr-type", format.type,
                     "Type of the pixels of .exr files: float (32 bits) or half (16 bits, values up to 65504); the "
                     "AOVs depth, variance and samples are always float")
          ->transform(oneOf(types))
          ->default_str("float"),
      app.add_option("--exr-compression", format.compression,
                     "Compression of .exr files: lossless, except for dwaa and dwab, which store values up to 32752")
          ->transform(oneOf(compressions))
          ->default_str("zip")};
}

void noteClamped(const std::string& tool, const std::filesystem::path& path, std::size_t clamped,
                 const ExrFormat& format) {
  if (clamped == 0) return;
  const bool isDwaa = format.compression == ExrFormat::Compression::dwaa;
  const std::string option =
      format.isLossy() ? fmt::format("--exr-compression {}", isDwaa ? "dwaa" : "dwab") : "--exr-type half";
  printNote(tool, fmt::format("{}: {} values are too large for {}, and are stored as {}", path.string(), clamped,
                              option, format.isLossy() ? kLargestDwa : kLargestHalf));
}

}  // namespace lobe
