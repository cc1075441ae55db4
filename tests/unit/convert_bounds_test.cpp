// Bounds on a result between the contract and the engine.

#include <gtest/gtest.h>

#include "server/convert.h"

namespace remesh {
namespace {

TEST(ConvertBounds, GoThereAndBackUnchanged) {
    v1::Options options;
    options.mutable_bounds()->set_min_dihedral(20.0);
    options.mutable_bounds()->set_max_deviation(0.5);
    options.mutable_bounds()->set_max_volume_change(0.01);
    options.set_max_tets(5000);

    const v1::Options back = to_proto(to_core(options));

    EXPECT_EQ(back.bounds().min_dihedral(), 20.0);
    EXPECT_EQ(back.bounds().max_deviation(), 0.5);
    EXPECT_EQ(back.bounds().max_volume_change(), 0.01);
    EXPECT_EQ(back.max_tets(), 5000);
}

TEST(ConvertBounds, AreAbsentWhereNoneWereAsked) {
    const v1::Options back = to_proto(to_core(v1::Options()));

    EXPECT_FALSE(back.bounds().has_min_dihedral());
    EXPECT_FALSE(back.bounds().has_max_deviation());
    EXPECT_FALSE(back.bounds().has_max_volume_change());
    EXPECT_FALSE(back.has_max_tets());
}

}  // namespace
}  // namespace remesh
