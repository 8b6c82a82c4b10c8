#pragma once
// Indices of refraction: by number or by the names scene files use.

#include <string_view>

#include "materials/parameters.h"

namespace lobe {

/// The parameter as a number or as a name ("bk7", any case); the fallback is a name. ParameterError: an unknown name or
/// an index that is not positive.
double readIor(const Parameters& parameters, std::string_view name, std::string_view fallback);

/// int_ior over ext_ior (default air). ParameterError as above.
double readRelativeIor(const Parameters& parameters, std::string_view interiorFallback);

struct ComplexIor {
  Rgb eta;
  Rgb k;
};

/// material (default Cu, as in Mitsuba 0.6; "none" is a perfect mirror; "_palik" after a name is passed over), eta, k
/// and ext_eta (default air), which both are divided by. Negative components of eta and k become zero, with a note.
/// ParameterError: an unknown name, a number that is not finite, or an ext_eta that is not positive.
ComplexIor readConductor(const Parameters& parameters);

}  // namespace lobe
