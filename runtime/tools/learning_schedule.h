#pragma once
// When the illumination records are fitted to the samples of the picture, in runs of a fixed time.

#include "runtime/render/integrators/renderer.h"

namespace lobe {

/// The first fit takes place after a twelfth of the time for rendering, and the number of samples doubles from one fit
/// to the next. A fit is postponed until it takes less than a fixed fraction of the time so far, judged by the one
/// before, and there is none after more than half of the time, because few samples would profit from it.
class LearningSchedule {
 public:
  /// seconds: time for rendering.
  explicit LearningSchedule(double seconds) : seconds_(seconds) {}

  bool isDue(const RenderProgress& progress) const {
    return !isOver(progress) && progress.seconds >= kFirst * seconds_ && progress.samples >= 2 * last_.samples &&
           lastFit_ <= kLargestCost * progress.seconds;
  }
  /// Whether no fit is due any more.
  bool isOver(const RenderProgress& progress) const {
    return progress.seconds > kEnd * seconds_ || 2 * last_.seconds > kEnd * seconds_;
  }
  /// After a fit at `progress` that has taken `seconds`.
  void fitted(const RenderProgress& progress, double seconds) {
    last_ = progress;
    lastFit_ = seconds;
  }

 private:
  static constexpr double kFirst = 1.0 / 12, kEnd = 0.55, kLargestCost = 0.04;
  double seconds_;
  RenderProgress last_{0, 0};
  double lastFit_ = 0;
};

}  // namespace lobe
