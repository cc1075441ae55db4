// Random damage to a real anatomy: every run ends in a mesh that is valid, or in a clear refusal.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <random>

#include "core/error.h"
#include "core/io/mesh_io.h"
#include "core/pipeline.h"
#include "core/stages/verify.h"
#include "tests/support/shapes.h"

namespace remesh {
namespace {

constexpr double kEdgeLength = 4.0;

const SurfaceMesh& aorta() {
    static const SurfaceMesh mesh = [] {
        std::ifstream file(REMESH_TEST_DATA_DIR "/aorta.stl", std::ios::binary);
        const std::string bytes{std::istreambuf_iterator<char>(file), {}};
        return read_surface(bytes, "aorta.stl").mesh;
    }();
    return mesh;
}

/// One kind of damage after the other, each to a share of a surface's triangles or vertices.
class Vandal {
public:
    Vandal(SurfaceMesh mesh, unsigned seed) : mesh_(std::move(mesh)), random_(seed) {}

    SurfaceMesh wreck() {
        const auto blows = 1 + random_() % 4;
        for (unsigned blow = 0; blow < blows; ++blow) {
            const double share = 0.3 * std::pow(uniform(), 2.0);
            switch (random_() % 8) {
                case 0: mesh_ = testing::with_triangles_removed(mesh_, share, seed()); break;
                case 1: mesh_ = testing::with_triangles_flipped(mesh_, share, seed()); break;
                case 2: mesh_ = testing::with_noise(mesh_, 8.0 * share, seed()); break;
                case 3: mesh_ = testing::as_soup(mesh_); break;
                case 4: repeat(share); break;
                case 5: cross(share); break;
                case 6: bite(60.0 * share); break;
                default: pull_spikes(0.1 * share); break;
            }
        }
        return mesh_;
    }

private:
    unsigned seed() { return static_cast<unsigned>(random_()); }
    double uniform() { return static_cast<double>(random_()) / 4294967296.0; }
    Vec3 any_direction() {
        return Vec3(uniform() - 0.5, uniform() - 0.5, uniform() - 0.5).normalized();
    }

    /// Repeats triangles, half of them reversed.
    void repeat(double share) {
        for (std::size_t i = mesh_.triangles.size(); i-- > 0;) {
            if (uniform() < share) {
                Triangle t = mesh_.triangles[i];
                if (uniform() < 0.5) {
                    std::swap(t[0], t[1]);
                }
                mesh_.triangles.push_back(t);
            }
        }
    }

    /// Lets corners of triangles go to vertices anywhere.
    void cross(double share) {
        for (auto& t : mesh_.triangles) {
            if (uniform() < 0.05 * share) {
                t[random_() % 3] = static_cast<Index>(random_() % mesh_.vertices.size());
            }
        }
    }

    /// Takes away all around some vertex.
    void bite(double radius) {
        const Vec3 middle = mesh_.vertices[random_() % mesh_.vertices.size()];
        std::erase_if(mesh_.triangles, [&](const Triangle& t) {
            return (mesh_.vertices[static_cast<std::size_t>(t[0])] - middle).norm() < radius;
        });
    }

    void pull_spikes(double share) {
        for (auto& v : mesh_.vertices) {
            if (uniform() < share) {
                v += 30.0 * uniform() * any_direction();
            }
        }
    }

    SurfaceMesh mesh_;
    std::mt19937 random_;
};

/// The seeds tried; more if REMESH_DAMAGE_RUNS says how many.
unsigned runs() {
    const char* text = std::getenv("REMESH_DAMAGE_RUNS");
    return text != nullptr ? static_cast<unsigned>(std::strtoul(text, nullptr, 10)) : 24U;
}

TEST(RandomDamage, EndsInAValidMeshOrAClearRefusal) {
    unsigned refused = 0;
    for (unsigned seed = 1; seed <= runs(); ++seed) {
        const SurfaceMesh wreck = Vandal(aorta(), seed).wreck();
        try {
            RunContext run;
            const auto result = run_pipeline(wreck, {.edge_length = kEdgeLength}, run);

            EXPECT_FALSE(check_tets(result.tets, RunContext()).any()) << "seed " << seed;
            EXPECT_FALSE(check_surface(result.surface, RunContext()).any()) << "seed " << seed;
        } catch (const Error& error) {
            EXPECT_TRUE(error.code() == ErrorCode::Unmeshable ||
                        error.code() == ErrorCode::InvalidInput)
                << "seed " << seed << ": " << error.what();
            EXPECT_GT(std::string(error.what()).size(), 20U) << "seed " << seed;
            ++refused;
        }
    }
    EXPECT_LE(refused, runs() / 4);
}

}  // namespace
}  // namespace remesh
