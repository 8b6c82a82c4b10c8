#pragma once
// An image of one illumination record over the disc of directions: its mixture, the particles around it, and the
// incident-radiance reference.
//
// Three panels from left to right show densities over the disc on one logarithmic scale, from the largest value down to
// kRecordDecades below it: the mixture with the ellipses of its Gaussians; a histogram of the particles around the
// record; and, in the same cells, the reference f of incident_radiance.h (path-traced incident radiance × cosθ without
// the part that next-event estimation finds) at the selected surface point. z is the normal and x the record's tangent.
// Mixture and particles are shown in the frame of the record, the reference in that of the selected point, where the
// renderer evaluates the mixture. Below are the scale, a legend, and a text that gives the position and normal of the
// record, the distance of the selected point and the angle between the normals in degrees, the number of samples that
// the record has learnt from, and the relative variance (NEV) of the mixture alone and of the mean of mixture and
// cosine density.

#include <stdexcept>
#include <string>

#include "runtime/analysis/incident_radiance.h"
#include "runtime/analysis/raster.h"
#include "runtime/guiding/particle_neighbours.h"
#include "runtime/render/training/training.h"

namespace lobe {

inline constexpr double kRecordDecades = 3;

/// Thrown if no record can be shown; the message says why.
class NoRecord : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

struct RecordView {
  Raster raster;
  std::string caption;  ///< the text below the panels; phrases are separated by double spaces
};

/// The surface point at the centre of a pixel, see firstReceiver. Throws NoRecord if the pixel is outside the image or
/// shows no surface that scatters light.
Receiver receiverAt(const RenderScene& scene, const RayCamera& camera, int x, int y);

/// Shows the record that serves a receiver. If the particles were not kept, or the illumination was read from a file,
/// their panel is empty. options: those of the training. Throws NoRecord if no record serves the receiver.
RecordView viewRecord(const RenderScene& scene, const Receiver& receiver, const TrainedIllumination& illumination,
                      const FieldOptions& options);

}  // namespace lobe
