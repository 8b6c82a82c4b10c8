#pragma once
// Sensors and integrators of scene files.

#include "materials/parameters.h"
#include "scenes/mitsuba/read_context.h"

namespace lobe {

/// Sets camera and pixel filter from a sensor. Throws SceneError.
void readSensor(ReadContext& context, pugi::xml_node node);

/// Sets the field of view from fov and fov_axis, or from focal_length. Throws ParameterError.
void readFieldOfView(const Parameters& parameters, Camera& camera);

/// Reads max_depth and hide_emitters of an integrator, or of the one nested in it, and notes that everything else is
/// ignored.
void readIntegrator(ReadContext& context, pugi::xml_node node);

}  // namespace lobe
