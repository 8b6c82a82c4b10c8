#pragma once
// A record of the trained illumination as a picture over the disc of directions: what it holds, what it learnt from
// last, and what it was to learn.
//
// Three panels from the left, all densities over the disc on one logarithmic scale that ends kRecordDecades below the
// largest of them: the mixture, with the ellipses of its Gaussians; the particles around the record, in cells; f of
// received_light.h (the incident radiance × cosθ by path tracing, without what emitter sampling finds) at the place
// looked at, in the same cells. z is the normal and x the record's tangent: mixture and particles stand in the record's
// frame, the light in that of the place, as the renderer puts the mixture there. Two lines of numbers stand below: the
// record's position and normal, how far from it the place is and by how many degrees its normal is turned; then what it
// has learnt from and the NEV of the mixture, alone and half and half with the cosine.

#include <stdexcept>
#include <string>

#include "runtime/analysis/incident_radiance.h"
#include "runtime/analysis/raster.h"
#include "runtime/guiding/particle_neighbours.h"
#include "runtime/render/training/training.h"

namespace lobe {

inline constexpr double kRecordDecades = 3;

/// Why there is no picture of a record.
class NoRecord : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

struct RecordView {
  Raster raster;
  std::string caption;  ///< the lines of numbers below
};

/// What the middle of a pixel shows, see firstReceiver. Throws NoRecord when the pixel is outside the picture or shows
/// no surface that scatters light.
Receiver receiverAt(const RenderScene& scene, const RayCamera& camera, int x, int y);

/// Of the record that serves a receiver. Without particles (trained elsewhere, or not kept) their panel stays empty.
/// options: what was trained with. Throws NoRecord when none serves it.
RecordView viewRecord(const RenderScene& scene, const Receiver& receiver, const TrainedIllumination& illumination,
                      const FieldOptions& options);

}  // namespace lobe
