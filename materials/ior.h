#pragma once
// Indices of refraction, given as numbers or by the names used in scene files.

#include <string_view>

#include "materials/parameters.h"

namespace lobe {

/// Reads an index given as a number or as a name such as "bk7", in any case; the fallback is a name. Throws
/// ParameterError for an unknown name or an index that is not positive.
double readIor(const Parameters& parameters, std::string_view name, std::string_view fallback);

/// int_ior divided by ext_ior (default air). Throws ParameterError as readIor.
double readRelativeIor(const Parameters& parameters, std::string_view interiorFallback);

struct ComplexIor {
  Rgb eta;
  Rgb k;
};

/// Reads material (default Cu, as in Mitsuba 0.6, which the scene reader replaces by "none" from version 2; "none" is a
/// perfect mirror; a suffix "_palik" is ignored), eta, k and ext_eta (default air), by which eta and k are divided.
/// Negative components of eta and k are replaced by their absolute values, with a note. Throws ParameterError for an
/// unknown name, a number that is not finite, or an ext_eta that is not positive.
ComplexIor readConductor(const Parameters& parameters);

}  // namespace lobe
