// Sizes and patches between the contract and the engine.

#include <gmock/gmock.h>
#include <google/protobuf/util/message_differencer.h>
#include <gtest/gtest.h>

#include "server/convert.h"
#include "server/convert/sizing.h"
#include "server/jobs/registry.h"

namespace remesh {
namespace {

v1::Sizing full() {
    v1::Sizing sizing;
    sizing.set_guard_thickness(false);
    sizing.set_min_size(0.1);
    sizing.set_max_size(4.0);
    sizing.set_gradation(0.15);
    sizing.set_propagation(v1::Sizing::PROPAGATION_COUPLED);
    sizing.set_reaction(-0.25);
    sizing.set_chord_error(0.05);
    sizing.set_elements_across(3.0);
    sizing.mutable_boundary_layer()->set_first_size(0.4);
    sizing.mutable_boundary_layer()->set_growth(1.15);
    sizing.set_vertex_field("thickness");
    sizing.set_return_field(true);
    for (const double x : {1.0, 2.0, 3.0}) {
        sizing.add_regions()->set_size(x);
    }
    sizing.add_regions()->set_growth(1.1);
    for (const double x : {1.0, 2.0, 3.0, 4.0, 5.0, 6.0}) {
        sizing.mutable_regions(0)->mutable_points()->add_coordinates(x);
        sizing.mutable_regions(1)->mutable_polyline()->add_coordinates(x);
    }
    for (const double x : {1.0, 2.0, 3.0}) {
        sizing.mutable_regions(2)->mutable_sphere()->add_center(x);
        sizing.mutable_regions(3)->mutable_box()->add_low(x);
        sizing.mutable_regions(3)->mutable_box()->add_high(2.0 * x);
    }
    sizing.mutable_regions(2)->mutable_sphere()->set_radius(0.5);
    return sizing;
}

std::string field_refused_in(const v1::Sizing& sizing) {
    try {
        static_cast<void>(to_core(sizing));
    } catch (const JobError& error) {
        return error.problems().at(0).field;
    }
    return "";
}

TEST(ConvertSizing, ComesBackAsItWent) {
    const v1::Sizing there = full();
    const v1::Sizing back = to_proto(to_core(there));

    std::string difference;
    google::protobuf::util::MessageDifferencer differencer;
    differencer.ReportDifferencesToString(&difference);
    EXPECT_TRUE(differencer.Compare(there, back)) << difference;
}

TEST(ConvertSizing, TakesTheEnginesDefaultForWhatIsAbsent) {
    const SizingOptions options = to_core(v1::Sizing{});

    EXPECT_TRUE(options.guard_thickness);
    EXPECT_EQ(options.gradation, SizingOptions{}.gradation);
    EXPECT_FALSE(options.is_graded());
}

TEST(ConvertSizing, NamesTheRegionThatHasTooFewNumbersOrNoShape) {
    v1::Sizing sizing = full();
    sizing.mutable_regions(1)->mutable_polyline()->add_coordinates(7.0);
    EXPECT_EQ(field_refused_in(sizing), "sizing.regions[1].polyline.coordinates");

    sizing = full();
    sizing.mutable_regions(3)->mutable_box()->clear_low();
    EXPECT_EQ(field_refused_in(sizing), "sizing.regions[3].box.low");

    sizing = full();
    sizing.add_regions()->set_size(1.0);
    EXPECT_EQ(field_refused_in(sizing), "sizing.regions[4]");
}

TEST(ConvertPatches, ComeBackAsTheyWentAndAreTheInputsIfAbsent) {
    for (const auto source :
         {v1::Features::PATCHES_INPUT, v1::Features::PATCHES_FACES, v1::Features::PATCHES_NONE}) {
        v1::Options options;
        options.mutable_features()->set_patches(source);
        EXPECT_EQ(to_proto(to_core(options)).features().patches(), source);
    }
    EXPECT_EQ(to_core(v1::Options{}).patches, PatchSource::Input);
}

}  // namespace
}  // namespace remesh
