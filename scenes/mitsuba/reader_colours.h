#pragma once
// Colours and spectra of scene files.

#include "materials/parameters.h"
#include "scenes/mitsuba/read_context.h"

namespace lobe {

/// The colour of an element rgb, srgb, color, xyz, spectrum or blackbody; nullopt for any other, and for one with a
/// type, which is a texture. Spectra are converted to colours as in Mitsuba's RGB modes: in files for Mitsuba 2 and 3,
/// reflectance spectra are weighted by daylight (D65), so that 1 is white, and emission spectra of emitters are not; in
/// older files no spectrum is weighted. Throws SceneError.
std::optional<Rgb> readColour(ReadContext& context, pugi::xml_node node);

/// Whether a texture type is one of Mitsuba 3's spectra: blackbody, d65, irregular, rawconstant, regular, rgb, srgb,
/// srgb_d65 or uniform.
bool isSpectrum(std::string_view type);

/// The types, separated by ", ".
std::string knownSpectra();

/// A texture of one of these types from the parameters of its element: a constant colour or, for d65 with a nested
/// texture, that texture scaled. Throws ParameterError.
TexturePtr makeSpectrum(ReadContext& context, pugi::xml_node node, const std::string& type,
                        const Parameters& parameters);

}  // namespace lobe
