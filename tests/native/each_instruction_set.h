/// Tests that run under each instruction set of this machine.
#pragma once

#include <gtest/gtest.h>

#include <string>

#include "sinew/instruction_set.h"

namespace sinew {

/// The base of a suite; INSTANTIATE_TEST_SUITE_P(Kernels, Suite, each_instruction_set(), set_name) runs it.
class OnEachInstructionSet : public testing::TestWithParam<std::string> {
 protected:
  void SetUp() override { set_instruction_set(GetParam()); }
  void TearDown() override { set_instruction_set("auto"); }
};

inline auto each_instruction_set() { return testing::ValuesIn(instruction_sets()); }

inline std::string set_name(const testing::TestParamInfo<std::string>& set) { return set.param; }

}  // namespace sinew
