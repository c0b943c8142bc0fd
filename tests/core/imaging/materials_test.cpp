#include "core/imaging/materials.h"

#include <cmath>
#include <stdexcept>

#include <gtest/gtest.h>

namespace fluorocut {
namespace {

struct Published {
    Material material;
    double energy_kev;
    double mass_attenuation;
};

// NIST's own table of compounds (NISTIR 5632, table 4), computed there from the unrounded cross-sections: an
// independent check of the elements' table and of the compositions. 0.2 % allows for four digits per element.
TEST(Materials, AgreeWithPublishedCompounds) {
    const Published published[] = {
        {Material::water, 40, 0.2683},        {Material::water, 60, 0.2059},
        {Material::water, 80, 0.1837},        {Material::water, 100, 0.1707},
        {Material::softTissue, 40, 0.2688},   {Material::softTissue, 60, 0.2048},
        {Material::softTissue, 100, 0.1693},  {Material::corticalBone, 40, 0.6655},
        {Material::corticalBone, 50, 0.4242}, {Material::corticalBone, 60, 0.3148},
        {Material::corticalBone, 80, 0.2229}, {Material::corticalBone, 100, 0.1855},
        {Material::fat, 40, 0.2396},          {Material::fat, 60, 0.1974},
        {Material::fat, 80, 0.1800},          {Material::acrylic, 40, 0.2350},
        {Material::acrylic, 60, 0.1924},      {Material::acrylic, 100, 0.1641},
        {Material::air, 60, 0.1875},          {Material::aluminium, 60, 0.2778},
        {Material::copper, 60, 1.593},
    };
    for (const Published& p : published) {
        EXPECT_NEAR(massAttenuationCm2PerGram(p.material, p.energy_kev), p.mass_attenuation, 0.002 * p.mass_attenuation)
            << name(p.material) << " at " << p.energy_kev << " keV";
    }
}

// Straight lines in log-log coordinates between nodes: at 45 and 90 keV within 1.5 % of XCOM (values of xraylib 4.0).
TEST(Materials, InterpolateBetweenTheNodes) {
    EXPECT_NEAR(massAttenuationCm2PerGram(Material::water, 45), 0.2436, 0.015 * 0.2436);
    EXPECT_NEAR(massAttenuationCm2PerGram(Material::water, 90), 0.1766, 0.015 * 0.1766);
    EXPECT_NEAR(massAttenuationCm2PerGram(Material::water, 120), 0.1614, 0.002 * 0.1614);
    for (const Material material : materials()) {
        for (const double node : {50.0, 60.0, 70.0, 80.0, 100.0, 120.0}) {  // continuous across the nodes
            const double value = massAttenuationCm2PerGram(material, node);
            EXPECT_NEAR(massAttenuationCm2PerGram(material, node - 1e-6), value, 1e-6 * value);
            EXPECT_NEAR(massAttenuationCm2PerGram(material, node + 1e-6), value, 1e-6 * value);
        }
        EXPECT_GT(massAttenuationCm2PerGram(material, 40), massAttenuationCm2PerGram(material, 150));
    }
}

TEST(Materials, KnowTheirRange) {
    EXPECT_GT(massAttenuationCm2PerGram(Material::water, 150), 0.1);
    EXPECT_THROW(massAttenuationCm2PerGram(Material::water, 39.9), std::logic_error);
    EXPECT_THROW(massAttenuationCm2PerGram(Material::water, 151), std::logic_error);
    EXPECT_THROW(massAttenuationCm2PerGram(Material::water, NAN), std::logic_error);
}

TEST(Materials, OrderFromAirToCopper) {
    const Material order[] = {Material::air,      Material::fat,   Material::water,        Material::softTissue,
                              Material::acrylic,  Material::ptfe,  Material::corticalBone, Material::aluminium,
                              Material::titanium, Material::steel, Material::cobaltChrome};
    for (std::size_t i = 1; i < std::size(order); ++i)
        EXPECT_LT(attenuationPerMm(order[i - 1]), attenuationPerMm(order[i])) << name(order[i]);
    // 10 % of barium sulphate makes cement about as opaque as dense bone: that is what it is for.
    EXPECT_GT(attenuationPerMm(Material::cement), attenuationPerMm(Material::corticalBone));
    EXPECT_LT(attenuationPerMm(Material::cement), 2 * attenuationPerMm(Material::corticalBone));
}

TEST(Materials, NamesAreUniqueAndReadBack) {
    for (const Material material : materials())
        EXPECT_EQ(materialFromName(name(material)), material);
    EXPECT_FALSE(materialFromName("unobtainium").has_value());
    EXPECT_FALSE(materialFromName("").has_value());
}

TEST(Materials, HounsfieldUnitsAreRelativeToWater) {
    const double mu_water = attenuationPerMm(Material::water);
    EXPECT_NEAR(mu_water, 0.0206, 0.0001);
    EXPECT_DOUBLE_EQ(attenuationFromHounsfield(0, 0.02), 0.02);
    EXPECT_DOUBLE_EQ(attenuationFromHounsfield(1500, 0.02), 0.05);
    EXPECT_EQ(attenuationFromHounsfield(-1024, 0.02), 0);
    EXPECT_NEAR(hounsfieldFromAttenuation(attenuationFromHounsfield(321, mu_water), mu_water), 321, 1e-9);
    EXPECT_NEAR(hounsfieldOf(Material::water), 0, 1e-9);
    EXPECT_NEAR(hounsfieldOf(Material::air), -1000, 2);
    EXPECT_NEAR(hounsfieldOf(Material::acrylic), 112, 3);  // 1.19 * 0.1924 / 0.2059 - 1
    EXPECT_NEAR(hounsfieldOf(Material::fat), -89, 3);      // 0.95 * 0.1974 / 0.2059 - 1
}

}  // namespace
}  // namespace fluorocut
