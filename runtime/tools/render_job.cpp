#include "runtime/tools/render_job.h"

#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <stdexcept>

#include <fmt/format.h>

#include "runtime/core/files.h"
#include "runtime/image/image_output.h"
#include "runtime/tools/exr_options.h"
#include "runtime/tools/tool.h"
#include "scenes/camera.h"

namespace lobe {
const char* nameOf(IntegratorKind kind) {
  constexpr std::array names{"auto", "path", "bdpt", "vcm", "guided", "product"};
  return names[static_cast<std::size_t>(kind)];
}

const char* nameOf(BdptGuide guide) {
  constexpr std::array names{"none", "illumination", "product"};
  return names[static_cast<std::size_t>(guide)];
}

const char* nameOf(LightPathUse use) {
  constexpr std::array names{"auto", "on", "off"};
  return names[static_cast<std::size_t>(use)];
}

bool RenderJob::guided() const {
  return integrator == IntegratorKind::bdpt ? guide != BdptGuide::none
                                            : integrator == IntegratorKind::guided || mayUseProduct();
}

bool RenderJob::mayUseProduct() const {
  if (integrator == IntegratorKind::bdpt) return guide == BdptGuide::product;
  return integrator == IntegratorKind::product || integrator == IntegratorKind::automatic;
}

void RenderJob::validate() const {
  const auto require = [](bool condition, const std::string& message) {
    if (!condition) throw UsageError(message);
  };
  require(samples || seconds, "--spp or --seconds is required");
  require(!samples || !seconds, "--spp and --seconds cannot be combined");
  require(!samples || *samples >= 1, "--spp must be at least 1");
  require(sampleOffset >= 0, "--sample-offset must be at least 0");
  require(sampleOffset == 0 || samples,
          "--sample-offset requires --spp, because --seconds does not fix the number of samples");
  require(!samples || *samples <= std::numeric_limits<int>::max() - sampleOffset,
          fmt::format("the sum of --sample-offset and --spp must be at most {}", std::numeric_limits<int>::max()));
  require(guided() || (illumination.empty() && saveIllumination.empty()),
          "--illumination and --save-illumination require --integrator auto, guided or product, or bdpt with --guide");
  require(illumination.empty() || saveIllumination.empty() || trainsFurther(),
          "--save-illumination cannot be combined with --illumination, which replaces training, unless --passes or "
          "--train-seconds continue the training");
  require(!seconds || (*seconds > 0 && std::isfinite(*seconds)), "--seconds must be a finite number greater than 0");
  const auto isSize = [](const std::pair<int, int>& pixels) {
    const auto [width, height] = pixels;
    return width >= 1 && height >= 1 && width <= kMaxPictureSide && height <= kMaxPictureSide &&
           std::int64_t{width} * height <= kMaxPicturePixels;
  };
  require(!size || isSize(*size), fmt::format("--size must be at least 1x1 and at most {} pixels, and {} on a side",
                                              kMaxPicturePixels, kMaxPictureSide));
  require(!maxDepth || *maxDepth >= 1, "--max-depth must be at least 1");
  require(!trainSeconds || (*trainSeconds > 0 && std::isfinite(*trainSeconds)),
          "--train-seconds must be a finite number greater than 0");
  require(!trainSeconds || !seconds || *trainSeconds < *seconds, "--train-seconds must be less than --seconds");
  require(!passes || *passes >= 1, "--passes must be at least 1");
  require(reference.empty() == convergence.empty(), "--reference and --convergence require each other");
  require(reduction >= 0 && std::isfinite(reduction), "--reduction must be a finite number of at least 0");
  require(!outputs.empty(), "-o FILE is required");
  require(!record || guided(), "--record requires --integrator auto, guided or product, or bdpt with --guide");
  require(!gradients || integrator != IntegratorKind::vcm,
          "--gradients requires --integrator auto, path, bdpt, guided or product");
  require(!gradients || sampleOffset == 0,
          "--gradients cannot be combined with --sample-offset, because a picture is reconstructed as a whole");
  require(!gradients || (checkpoint.empty() && resume.empty()),
          "--gradients cannot be combined with --checkpoint and --resume, because a checkpoint holds no gradients");
  require(!gradients || !fireflyLimit,
          "--gradients cannot be combined with --firefly-limit, because the differences of pixels are not limited");
  require(!gradients || !aovs.contains(Aov::variance),
          "--gradients cannot be combined with --aov variance, because it is not known for a reconstructed picture");
  checkLossless(exr, aovs);
  require(merge.first > 0 && std::isfinite(merge.first), "--merge-radius must be a finite number greater than 0");
  require(merge.alpha > 0 && merge.alpha <= 1, "--merge-alpha must be greater than 0 and at most 1");
  require(!fireflyLimit || (*fireflyLimit > 0 && std::isfinite(*fireflyLimit)),
          "--firefly-limit must be a finite number greater than 0");
  require(!snapshotEvery || (*snapshotEvery >= 0 && std::isfinite(*snapshotEvery)),
          "--snapshot-every must be a finite number of at least 0");
  require(resume.empty() || !record, "--record cannot be combined with --resume, because the particles are not stored");
  require(resume.empty() || convergence.empty(),
          "--convergence cannot be combined with --resume, because the earlier errors are not stored");
  require(extensionOf(recordImage) == ".png", "--record-image must name a .png file");
  try {
    training.validate();
    for (const auto& output : outputs) checkImageName(output);
  } catch (const std::runtime_error& e) {
    throw UsageError(e.what());  // libraries check their own limits and do not know the command line
  }
}

std::string lobefitCommand(const RenderJob& job) {
  std::string command =
      fmt::format("lobefit {} -o {}", shellQuoted(job.scene.string()), shellQuoted(job.cacheFolder.string()));
  if (!job.camera.empty()) command += fmt::format(" --camera {}", shellQuoted(job.camera.string()));
  for (const auto& [name, value] : job.definitions)
    command += fmt::format(" -D {}", shellQuoted(fmt::format("{}={}", name, value)));
  if (job.lenient) command += " --lenient";
  return command;
}

}  // namespace lobe
