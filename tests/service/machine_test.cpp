#include "server/machine.h"

#include <gtest/gtest.h>

namespace remesh {
namespace {

TEST(Machine, ReadsTheQuotaOfACgroup) {
    EXPECT_EQ(processors_of_quota("200000 100000"), 2);
    EXPECT_EQ(processors_of_quota("150000 100000"), 2);
    EXPECT_EQ(processors_of_quota("max 100000"), 0);
    EXPECT_EQ(processors_of_quota(""), 0);
    EXPECT_GE(available_processors(), 1);
}

TEST(Machine, ReadsTheMemoryOfACgroup) {
    EXPECT_EQ(bytes_of_limit("536870912"), 536'870'912);
    EXPECT_EQ(bytes_of_limit("max"), 0);
    EXPECT_EQ(bytes_of_limit(""), 0);
    EXPECT_GT(available_memory(), 0);
}

TEST(Machine, KnowsWhatAnAddressIs) {
    EXPECT_TRUE(is_address("127.0.0.1:0"));
    EXPECT_TRUE(is_address("[::1]:65535"));
    EXPECT_TRUE(is_address("unix:/run/remesh.sock"));
    EXPECT_FALSE(is_address("127.0.0.1:65536"));
    EXPECT_FALSE(is_address("127.0.0.1:99999999999999999999"));
    EXPECT_FALSE(is_address("127.0.0.1:-1"));
    EXPECT_FALSE(is_address("127.0.0.1:"));
    EXPECT_FALSE(is_address("127.0.0.1"));
    EXPECT_FALSE(is_address(":50051"));
    EXPECT_FALSE(is_address("unix:"));
    EXPECT_FALSE(is_address(""));
}

TEST(Machine, KnowsWhichAddressesStayOnIt) {
    EXPECT_TRUE(is_loopback("127.0.0.1:50051"));
    EXPECT_TRUE(is_loopback("localhost:0"));
    EXPECT_TRUE(is_loopback("[::1]:50051"));
    EXPECT_TRUE(is_loopback("unix:/run/remesh.sock"));
    EXPECT_FALSE(is_loopback("0.0.0.0:50051"));
    EXPECT_FALSE(is_loopback("[::]:50051"));
    EXPECT_FALSE(is_loopback("127.evil.example:50051"));
    EXPECT_FALSE(is_loopback("example.org:50051"));
}

}  // namespace
}  // namespace remesh
