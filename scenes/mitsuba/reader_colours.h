#pragma once
// Colours and spectra of scene files.

#include "materials/parameters.h"
#include "scenes/mitsuba/read_context.h"

namespace lobe {

/// The colour of an element rgb, srgb, color, xyz, spectrum or blackbody; nullopt for any other, and for one with a
/// type, which is a texture. Spectra become colours as Mitsuba's RGB modes do it: in files for Mitsuba 2 and 3,
/// reflectances are looked at in daylight, so that 1 is white, and emission in emitters is seen as it is; in older
/// files everything is taken as it is. Throws SceneError.
std::optional<Rgb> readColour(const ReadContext& context, pugi::xml_node node);

/// Whether a texture type is one of Mitsuba 3's spectra: blackbody, d65, irregular, rawconstant, regular, rgb, srgb,
/// srgb_d65 or uniform.
bool isSpectrum(std::string_view type);

/// The types, separated by ", ".
std::string knownSpectra();

/// A texture of such a type, from the parameters of its element: one colour, or for d65 with a texture inside, that
/// texture scaled. Throws ParameterError.
TexturePtr makeSpectrum(const ReadContext& context, pugi::xml_node node, const std::string& type,
                        const Parameters& parameters);

}  // namespace lobe
