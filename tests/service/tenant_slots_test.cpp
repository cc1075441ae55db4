#include "server/tenant_slots.h"

#include <gtest/gtest.h>

#include "server/convert.h"

namespace remesh {
namespace {

TEST(TenantSlots, LetNoTenantHaveAll) {
    TenantSlots slots("things", 3, 2);
    const auto first = slots.take("a");
    auto second = slots.take("a");

    EXPECT_THROW(static_cast<void>(slots.take("a")), StatusError);
    const auto others = slots.take("b");
    EXPECT_EQ(slots.taken(), 3);
    EXPECT_THROW(static_cast<void>(slots.take("b")), StatusError) << "there are no more";

    second.reset();
    EXPECT_EQ(slots.taken(), 2);
    EXPECT_NO_THROW(static_cast<void>(slots.take("b")));
    EXPECT_EQ(slots.taken(), 2);
}

TEST(TenantSlots, SayWhichLimitWasPassed) {
    TenantSlots slots("things", 3, 0);

    try {
        static_cast<void>(slots.take("a"));
        FAIL();
    } catch (const StatusError& error) {
        EXPECT_EQ(error.status().error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED);
        EXPECT_EQ(error.status().error_message(), "a tenant has at most 0 things at a time");
    }
}

}  // namespace
}  // namespace remesh
