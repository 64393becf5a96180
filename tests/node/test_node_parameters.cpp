// SPDX-License-Identifier: Apache-2.0
#include <algorithm>

#include <gtest/gtest.h>

#include "palpate/kernel/core/parameters.hpp"
#include "palpate/net/node/node_parameters.hpp"

#include "tests/support/errors.hpp"

namespace palpate {
namespace test_node_parameters {

using ros::ParameterValue;

class NodeParametersTest : public ::testing::Test {
 protected:
  void set(const std::string& name, const ParameterValue& value) {
    parameters_.set(settings_, {name, value});
  }

  NodeParameters parameters_{standard_methods()};
  ServoSettings settings_;
};

TEST_F(NodeParametersTest, HasEveryRowOfTheTablesWithItsRange) {
  for (const ParameterInfo& row : parameter_table()) {
    const ros::ParameterDescriptor described = parameters_.describe(std::string(row.name));
    EXPECT_EQ(described.type, ParameterValue::number) << row.name;
    EXPECT_NE(described.description.find(row.meaning), std::string::npos) << row.name;
    ASSERT_EQ(described.floating_point_range.size(), 1U) << row.name;
    EXPECT_EQ(described.floating_point_range[0].from, row.min) << row.name;
    EXPECT_EQ(described.floating_point_range[0].to, row.max) << row.name;
    EXPECT_FALSE(described.read_only);
    EXPECT_EQ(parameters_.get(settings_, std::string(row.name)),
              ParameterValue::of(row.get(settings_.parameters)));
  }
  EXPECT_NE(parameters_.describe("stiffness").description.find("[N/m]"), std::string::npos);
  EXPECT_TRUE(parameters_.describe("safety.max_device_force").read_only);
  EXPECT_EQ(parameters_.describe("no_such").type, ParameterValue::not_set);
  EXPECT_EQ(parameters_.get(settings_, "no_such"), ParameterValue{});
  const std::string methods = parameters_.describe("method").additional_constraints;
  EXPECT_NE(methods.find("sight"), std::string::npos) << methods;
  EXPECT_EQ(parameters_.get(settings_, "method"), ParameterValue::of(std::string("sight")));
}

TEST_F(NodeParametersTest, SetsNumbersWholeOnesAndTheMethod) {
  set("stiffness", ParameterValue::of(432.5));
  EXPECT_EQ(settings_.parameters.coupling.stiffness, 432.5);
  set("stiffness", ParameterValue::of(std::int64_t{300}));
  EXPECT_EQ(settings_.parameters.coupling.stiffness, 300.0);
  set("placement.scale", ParameterValue::of(2.0));
  EXPECT_EQ(settings_.placement.workspace_scale, 2.0);
  set("method", ParameterValue::of(std::string("paper")));
  EXPECT_EQ(settings_.method, "paper");
}

// Hazard: ros-node
TEST_F(NodeParametersTest, SaysWhyItRefuses) {
  const auto refuses = [&](const std::string& name, const ParameterValue& value,
                           const std::string& why, const std::string& remedy) {
    EXPECT_TRUE(test::fails_saying([&] { set(name, value); }, name, why, remedy));
  };
  refuses("stiffnes", ParameterValue::of(300.0), "no such", "stiffness");
  refuses("stiffness", ParameterValue::of(-1.0), "-1", "N/m");
  refuses("stiffness", ParameterValue::of(std::string("much")), "number", "1.5");
  refuses("stiffness", ParameterValue{}, "deleted", "default");
  refuses("method", ParameterValue::of(3.0), "text", "sight");
  refuses("safety.max_device_force", ParameterValue::of(1.0), "network", "--limit");
  EXPECT_EQ(settings_.parameters.coupling.stiffness, ServoSettings{}.parameters.coupling.stiffness);
  EXPECT_EQ(settings_.safety.max_force, ServoSettings{}.safety.max_force);
}

TEST_F(NodeParametersTest, ListsByPrefixAndDepth) {
  const auto has = [](const std::vector<std::string>& names, const std::string& name) {
    return std::find(names.begin(), names.end(), name) != names.end();
  };
  const auto all = parameters_.list({{}, 0});
  EXPECT_EQ(all.names.size(), parameters_.all(settings_).size());
  EXPECT_TRUE(std::is_sorted(all.names.begin(), all.names.end()));
  EXPECT_EQ(all.prefixes, (std::vector<std::string>{"placement", "safety"}));
  const auto top = parameters_.list({{}, 1});
  EXPECT_TRUE(has(top.names, "method"));
  EXPECT_FALSE(has(top.names, "safety.max_speed"));
  const auto safety = parameters_.list({{"safety"}, 0});
  EXPECT_TRUE(has(safety.names, "safety.max_speed"));
  EXPECT_FALSE(has(safety.names, "method"));
  EXPECT_EQ(parameters_.list({{"safety"}, 1}).names, safety.names);  // its direct children
  EXPECT_EQ(parameters_.list({{"method"}, 1}).names, std::vector<std::string>{"method"});
  EXPECT_TRUE(parameters_.list({{"meth"}, 0}).names.empty());
}

}  // namespace test_node_parameters
}  // namespace palpate
