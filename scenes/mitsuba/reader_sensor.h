#pragma once
// Sensors and integrators of scene files.

#include "materials/parameters.h"
#include "scenes/mitsuba/read_context.h"

namespace lobe {

/// Sets camera and pixel filter from a sensor. Throws SceneError.
void readSensor(ReadContext& context, pugi::xml_node node);

/// Sets the field of view from fov and fov_axis, or from focal_length. Throws ParameterError.
void readFieldOfView(const Parameters& parameters, Camera& camera);

/// Takes an integrator's max_depth (also that of an integrator inside) and notes that the rest is ours.
void readIntegrator(ReadContext& context, pugi::xml_node node);

}  // namespace lobe
