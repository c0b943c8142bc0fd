#include "core/imaging/materials.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>

#include <fmt/format.h>

namespace fluorocut {
namespace {

constexpr std::array<double, 8> kEnergiesKev{40, 50, 60, 70, 80, 100, 120, 150};

enum Element { H, C, N, O, F, Na, Mg, Al, P, S, Cl, Ar, K, Ca, Ti, V, Cr, Fe, Co, Ni, Cu, Mo, Ba, kElements };

// mu/rho in cm2/g at kEnergiesKev. NIST XCOM, as tabulated in NISTIR 5632 and in xraylib 4.0 (CS_Total), which agree to
// one unit of the last digit; 70 and 120 keV, which the report leaves out, from xraylib.
constexpr std::array<std::array<double, 8>, kElements> kMassAttenuation{{
    /* H  */ {0.3458, 0.3355, 0.3260, 0.3173, 0.3091, 0.2944, 0.2816, 0.2651},
    /* C  */ {0.2076, 0.1871, 0.1753, 0.1672, 0.1610, 0.1514, 0.1438, 0.1347},
    /* N  */ {0.2288, 0.1980, 0.1817, 0.1714, 0.1639, 0.1529, 0.1448, 0.1353},
    /* O  */ {0.2585, 0.2132, 0.1907, 0.1772, 0.1678, 0.1551, 0.1462, 0.1361},
    /* F  */ {0.2828, 0.2214, 0.1920, 0.1750, 0.1639, 0.1496, 0.1401, 0.1298},
    /* Na */ {0.3969, 0.2804, 0.2268, 0.1976, 0.1796, 0.1585, 0.1459, 0.1335},
    /* Mg */ {0.4880, 0.3292, 0.2570, 0.2184, 0.1951, 0.1686, 0.1536, 0.1394},
    /* Al */ {0.5685, 0.3681, 0.2778, 0.2301, 0.2018, 0.1704, 0.1533, 0.1378},
    /* P  */ {0.8095, 0.4918, 0.3494, 0.2754, 0.2324, 0.1865, 0.1630, 0.1432},
    /* S  */ {0.9873, 0.5850, 0.4053, 0.3123, 0.2586, 0.2020, 0.1738, 0.1506},
    /* Cl */ {1.116, 0.6484, 0.4394, 0.3316, 0.2696, 0.2050, 0.1733, 0.1480},
    /* Ar */ {1.228, 0.7012, 0.4664, 0.3453, 0.2760, 0.2043, 0.1696, 0.1427},
    /* K  */ {1.541, 0.8678, 0.5678, 0.4134, 0.3252, 0.2345, 0.1912, 0.1582},
    /* Ca */ {1.830, 1.019, 0.6579, 0.4717, 0.3655, 0.2571, 0.2059, 0.1674},
    /* Ti */ {2.213, 1.213, 0.7661, 0.5361, 0.4052, 0.2721, 0.2102, 0.1649},
    /* V  */ {2.472, 1.348, 0.8438, 0.5845, 0.4371, 0.2877, 0.2185, 0.1682},
    /* Cr */ {2.855, 1.551, 0.9640, 0.6620, 0.4905, 0.3166, 0.2365, 0.1788},
    /* Fe */ {3.629, 1.958, 1.205, 0.8164, 0.5952, 0.3717, 0.2693, 0.1964},
    /* Co */ {3.980, 2.144, 1.314, 0.8853, 0.6414, 0.3949, 0.2822, 0.2023},
    /* Ni */ {4.600, 2.475, 1.511, 1.014, 0.7306, 0.4439, 0.3131, 0.2208},
    /* Cu */ {4.861, 2.613, 1.593, 1.064, 0.7630, 0.4584, 0.3195, 0.2217},
    /* Mo */ {12.94, 7.037, 4.274, 2.809, 1.962, 1.096, 0.6979, 0.4208},
    /* Ba */ {24.57, 13.79, 8.511, 5.650, 3.963, 2.196, 1.367, 0.7828},
}};

struct Part {
    Element element;
    double weight;
};

struct Entry {
    Material material;
    std::string_view name;
    double density;  // g/cm3
    std::array<Part, 9> parts;
};

constexpr std::array<Entry, 14> kMaterials{{
    {Material::air, "air", 0.001205, {{{C, 0.000124}, {N, 0.755268}, {O, 0.231781}, {Ar, 0.012827}}}},
    {Material::water, "water", 1.0, {{{H, 0.111898}, {O, 0.888102}}}},
    {Material::fat,
     "fat",
     0.95,
     {{{H, 0.114}, {C, 0.598}, {N, 0.007}, {O, 0.278}, {Na, 0.001}, {S, 0.001}, {Cl, 0.001}}}},
    {Material::softTissue,
     "soft-tissue",
     1.06,
     {{{H, 0.102}, {C, 0.143}, {N, 0.034}, {O, 0.708}, {Na, 0.002}, {P, 0.003}, {S, 0.003}, {Cl, 0.002}, {K, 0.003}}}},
    {Material::corticalBone,
     "cortical-bone",
     1.92,
     {{{H, 0.034}, {C, 0.155}, {N, 0.042}, {O, 0.435}, {Na, 0.001}, {Mg, 0.002}, {P, 0.103}, {S, 0.003}, {Ca, 0.225}}}},
    {Material::acrylic, "acrylic", 1.19, {{{H, 0.080538}, {C, 0.599848}, {O, 0.319614}}}},
    // 0.9 acrylic + 0.1 BaSO4 (4.5 g/cm3)
    {Material::cement, "cement", 1.284, {{{H, 0.072484}, {C, 0.539863}, {O, 0.315073}, {S, 0.013740}, {Ba, 0.058840}}}},
    {Material::polyamide, "polyamide", 1.14, {{{H, 0.097976}, {C, 0.636856}, {N, 0.123779}, {O, 0.141389}}}},
    {Material::ptfe, "ptfe", 2.2, {{{C, 0.240183}, {F, 0.759817}}}},
    {Material::aluminium, "aluminium", 2.699, {{{Al, 1.0}}}},
    {Material::titanium, "titanium", 4.43, {{{Ti, 0.90}, {Al, 0.06}, {V, 0.04}}}},
    {Material::cobaltChrome, "cobalt-chrome", 8.3, {{{Co, 0.66}, {Cr, 0.28}, {Mo, 0.06}}}},
    {Material::steel, "steel", 7.95, {{{Fe, 0.655}, {Cr, 0.18}, {Ni, 0.14}, {Mo, 0.025}}}},
    {Material::copper, "copper", 8.96, {{{Cu, 1.0}}}},
}};

static_assert(
    [] {
        for (const Entry& material : kMaterials) {
            double sum = 0;
            for (const Part& part : material.parts)
                sum += part.weight;
            if (sum < 0.999 || sum > 1.001) return false;
        }
        return true;
    }(),
    "the weight fractions of a material add up to one");

constexpr auto kList = [] {
    std::array<Material, kMaterials.size()> list{};
    for (std::size_t i = 0; i < list.size(); ++i)
        list[i] = kMaterials[i].material;
    return list;
}();

const Entry& entry(Material material) {
    for (const Entry& candidate : kMaterials)
        if (candidate.material == material) return candidate;
    throw std::logic_error("Material outside its enumeration");
}

}  // namespace

std::span<const Material> materials() {
    return kList;
}

std::string_view name(Material material) {
    return entry(material).name;
}

std::optional<Material> materialFromName(std::string_view name) {
    for (const Entry& candidate : kMaterials)
        if (candidate.name == name) return candidate.material;
    return std::nullopt;
}

double densityGramPerCm3(Material material) {
    return entry(material).density;
}

double massAttenuationCm2PerGram(Material material, double energy_kev) {
    if (!(energy_kev >= kLowestEnergyKev && energy_kev <= kHighestEnergyKev)) {
        throw std::logic_error(fmt::format("massAttenuation: {} keV is outside the table", energy_kev));
    }
    const auto above = std::upper_bound(kEnergiesKev.begin() + 1, kEnergiesKev.end() - 1, energy_kev);
    const auto high = static_cast<std::size_t>(above - kEnergiesKev.begin());
    const std::size_t low = high - 1;
    const double weight = std::log(energy_kev / kEnergiesKev[low]) / std::log(kEnergiesKev[high] / kEnergiesKev[low]);
    double sum = 0;
    for (const Part& part : entry(material).parts) {
        const auto& table = kMassAttenuation[part.element];
        sum += part.weight * table[low] * std::pow(table[high] / table[low], weight);
    }
    return sum;
}

double attenuationPerMm(Material material, double energy_kev) {
    return 0.1 * densityGramPerCm3(material) * massAttenuationCm2PerGram(material, energy_kev);
}

double attenuationFromHounsfield(double hounsfield, double mu_water_per_mm) {
    return std::max(0.0, mu_water_per_mm * (1 + hounsfield / 1000));
}

double hounsfieldFromAttenuation(double mu_per_mm, double mu_water_per_mm) {
    return 1000 * (mu_per_mm / mu_water_per_mm - 1);
}

double hounsfieldOf(Material material, double energy_kev) {
    return hounsfieldFromAttenuation(attenuationPerMm(material, energy_kev),
                                     attenuationPerMm(Material::water, energy_kev));
}

}  // namespace fluorocut
