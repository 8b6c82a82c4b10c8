#pragma once
// Sensors and integrators of scene files.

#include "scenes/read_context.h"

namespace lobe {

/// Sets camera and pixel filter from a sensor. Throws SceneError.
void readSensor(ReadContext& context, pugi::xml_node node);

/// Takes an integrator's max_depth (also that of an integrator inside) and notes that the rest is ours.
void readIntegrator(ReadContext& context, pugi::xml_node node);

}  // namespace lobe
