#include "tests/support/analytic_domain.h"

#include <gtest/gtest.h>

namespace remesh::testing {
namespace {

// Facets whose own centroid is said to lie on another one.
std::size_t wrong_facets(const Domain& domain) {
    std::size_t wrong = 0;
    const SurfaceMesh& mesh = domain.boundary();
    for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
        Vec3 center = Vec3::Zero();
        for (const Index v : mesh.triangles[t]) {
            center += mesh.vertices[static_cast<std::size_t>(v)] / 3.0;
        }
        wrong += domain.closest(center).facet != static_cast<Index>(t);
    }
    return wrong;
}

TEST(AnalyticDomain, NamesTheFacetThatAPointLiesOn) {
    EXPECT_EQ(wrong_facets(SphereDomain(2.0, Vec3(1, 2, 3), 3)), 0u);
    EXPECT_EQ(wrong_facets(TorusDomain(3.0, 1.0, 24, 12)), 0u);
    EXPECT_EQ(wrong_facets(BoxDomain(Vec3(1.0, 2.0, 0.5))), 0u);
}

TEST(AnalyticDomain, KnowsInsideFromOutside) {
    EXPECT_EQ(SphereDomain(2.0).region_at(Vec3(0, 1.9, 0)), 1);
    EXPECT_EQ(TorusDomain(3.0, 1.0).region_at(Vec3::Zero()), 0);
    EXPECT_EQ(TorusDomain(3.0, 1.0).region_at(Vec3(2.5, 0, 0)), 1);
    EXPECT_EQ(BoxDomain(Vec3(1, 2, 3)).region_at(Vec3(0.5, 1.9, 3.1)), 0);
}

TEST(AnalyticDomain, FindsTheOppositeWall) {
    const auto across = [](const Domain& domain, const Vec3& from, const Vec3& normal) {
        return domain.first_hit(from, -normal, 0.01, 10.0, normal, -0.3).value_or(-1.0);
    };

    EXPECT_NEAR(across(SphereDomain(2.0), Vec3(2, 0, 0), Vec3::UnitX()), 4.0, 1e-6);
    EXPECT_NEAR(across(TorusDomain(3.0, 1.0), Vec3(4, 0, 0), Vec3::UnitX()), 2.0, 1e-6);
    EXPECT_NEAR(across(BoxDomain(Vec3(1, 2, 3)), Vec3(0.5, 1, 3), Vec3::UnitZ()), 3.0, 1e-6);
}

}  // namespace
}  // namespace remesh::testing
