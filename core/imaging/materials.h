// Materials: how strongly bone, implants and fiducials weaken the beam of a C-arm.
//
//     mu(material, E) = density * sum over elements of weight fraction * (mu/rho)(element, E)     [1/mm]
//
// (the mixture rule; coherent scattering included). Mass attenuation coefficients of the elements are those of NIST
// (Hubbell and Seltzer, NISTIR 5632 and XCOM) at eight energies from 40 to 150 keV, joined by straight lines in log-log
// coordinates (within 1.5 % between them); no absorption edge of an element in use lies in that range. Compositions of
// tissues are those of ICRU Report 44.
//
// The beam is treated as monochromatic, at one effective energy. A spectrum is a weighted sum over energies of what is
// here.
#pragma once

#include <optional>
#include <span>
#include <string_view>

namespace fluorocut {

enum class Material {
    air,
    water,
    fat,
    softTissue,
    corticalBone,
    acrylic,    // PMMA without additives
    cement,     // bone cement: PMMA with 10 % barium sulphate by weight
    polyamide,  // nylon 6
    ptfe,
    aluminium,
    titanium,      // Ti-6Al-4V, ASTM F136
    cobaltChrome,  // Co-28Cr-6Mo, ASTM F75
    steel,         // 316L, ASTM F138
    copper,
};

// Every material, in the order above.
std::span<const Material> materials();

// "cortical-bone", "aluminium", ...: the name used in files.
std::string_view name(Material material);
std::optional<Material> materialFromName(std::string_view name);

// Mean energy of the photons that make the picture: about 75 kVp through 3 mm of aluminium and a hip.
constexpr double kEffectiveEnergyKev = 60;
constexpr double kLowestEnergyKev = 40;
constexpr double kHighestEnergyKev = 150;

double densityGramPerCm3(Material material);

// An energy outside [kLowestEnergyKev, kHighestEnergyKev] is a broken contract and throws std::logic_error.
double massAttenuationCm2PerGram(Material material, double energy_kev = kEffectiveEnergyKev);
double attenuationPerMm(Material material, double energy_kev = kEffectiveEnergyKev);

// mu = max(0, mu_water (1 + HU / 1000)) and back.
double attenuationFromHounsfield(double hounsfield, double mu_water_per_mm);
double hounsfieldFromAttenuation(double mu_per_mm, double mu_water_per_mm);

// What a CT of that effective energy shows for the material.
double hounsfieldOf(Material material, double energy_kev = kEffectiveEnergyKev);

}  // namespace fluorocut
