// SPDX-License-Identifier: BSD-3-Clause
//
// What the doctor makes of what it measures.
#include "ves/doctor/doctor.hpp"

#include <gtest/gtest.h>

#include "support/programs.hpp"

namespace ves {
namespace {

TEST(Latency, IsTheOrderStatistics) {
  std::vector<double> all;
  for (int i = 1000; i >= 0; --i) all.push_back(i * 1e-6);
  const Latency l = latencyOf(all);
  EXPECT_EQ(l.n, 1001);
  EXPECT_DOUBLE_EQ(l.median, 500e-6);
  EXPECT_DOUBLE_EQ(l.p99, 990e-6);
  EXPECT_DOUBLE_EQ(l.max, 1000e-6);
  EXPECT_EQ(latencyOf({}).n, 0);
}

TEST(Cyclictest, HistogramIsReadWithWhatOverflowedIt) {
  const auto l = cyclictestLatency(
      "# /dev/cpu_dma_latency set to 0us\n# Histogram\n000000 000000\n000010 000090\n"
      "000020 000008\n# Total: 000000098\n# Min Latencies: 00010\n# Avg Latencies: 00011\n"
      "# Max Latencies: 02425\n# Histogram Overflows: 00002\n");
  ASSERT_TRUE(l.has_value());
  EXPECT_EQ(l->n, 100);
  EXPECT_DOUBLE_EQ(l->median, 10e-6);
  EXPECT_DOUBLE_EQ(l->p99, 2425e-6);
  EXPECT_DOUBLE_EQ(l->max, 2425e-6);
  EXPECT_FALSE(cyclictestLatency("").has_value());
  EXPECT_FALSE(cyclictestLatency("unable to set scheduling\n000010 -1\n").has_value());
}

class Doctor : public test::Programs {};

TEST_F(Doctor, RefusesTimesThatAreNone) {
  EXPECT_EQ(test::sh(app("doctor") + "--seconds nan").status, 2);
  EXPECT_EQ(test::sh(app("doctor") + "--seconds 0").status, 2);
}

TEST_F(Doctor, SaysWhatItFoundAndWhatToDo) {
  const test::Output o = test::sh(app("doctor") + "--seconds 0.3");
  // The status says whether anything printed is bad.
  EXPECT_EQ(o.status, o.text.find("BAD") == std::string::npos ? 0 : 1) << o.text;
  for (const char* line :
       {"kernel", "processors", "clock", "scheduler", "memory", "socket buffers", "bus"})
    EXPECT_NE(o.text.find(line), std::string::npos) << o.text;
  if (o.text.find("BAD    bus") != std::string::npos) return;
  for (const char* line : {"a bare ticker wakes", "cyclictest", "LCM there and back"})
    EXPECT_NE(o.text.find(line), std::string::npos) << o.text;
}

}  // namespace
}  // namespace ves
